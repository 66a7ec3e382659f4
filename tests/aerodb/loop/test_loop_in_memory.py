"""The closed loop on flights that stand in no store: what is planted is found, added and validated;
where nothing is, nothing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.errors import InputError
from aerodb.exchange.native import read_native
from aerodb.increments.validation import HoldOut
from aerodb.loop import (
    Accept,
    FlightSource,
    Library,
    LoopResult,
    beside_larger_unnamed,
    dependences_between_flights,
    freeze_library,
    run_loop,
    validate_loop,
    with_model_error,
    without_gain,
)
from aerodb.loop.downgraded import only_with_gain
from aerodb.loop.unexplained import material
from aerodb.support import Mask
from aerodb.tables.database import AeroDatabase
from aerodb.tracing import Evidence, FlightResidual, UnexplainedResidual
from tests.support import effect_flights, varied_flights
from tests.support.flights_in_memory import FlightsInMemory
from tests.support.tracing_flights import FLOOR, coloured

#: Flights that identify, and flights that validate.
IDENTIFY, VALIDATE = 5, 2
#: What the flown aircraft has beyond the database: Cm_q is -14 there.
DAMPING = -6.0


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    """Flights of an aircraft whose pitch damping is larger than in the database, with coloured
    noise on all coefficients."""
    vehicle, rng, flown = effect_flights.vehicle(), np.random.default_rng(12), {}
    for flight in effect_flights.flown_together(
        range(20, 20 + IDENTIFY + VALIDATE), database(-14.0 + DAMPING), vehicle
    ):
        made = total_coefficients(flight, vehicle, angular_acceleration="logged")
        n = len(flight.time)
        noise = {
            axis: size * (coloured(rng, n, step=flight.step) + rng.standard_normal(n))
            for axis, size in FLOOR.items()
        }
        noisy = {axis: values + noise[axis] for axis, values in made.values.items()}
        flown[flight.id] = (flight, replace(made, values=noisy))
    return FlightsInMemory(vehicle, flown)


def database(damping: float = -14.0) -> AeroDatabase:
    """That of the flights with this Cm_q."""
    text = effect_flights.HEADER_ONLY + effect_flights._MOMENTS + effect_flights._BODY
    assert text.count("q_hat = -14.0") == 1
    return read_native(text.replace("q_hat = -14.0", f"q_hat = {damping}"))


def hold_out(source: FlightsInMemory) -> HoldOut:
    flights = tuple(source.flown)
    return HoldOut(flights[:IDENTIFY], flights[IDENTIFY:], "held-out")


def closed(
    source: FlightSource, identified: Sequence[str], baseline: AeroDatabase
) -> tuple[Library, LoopResult]:
    library = freeze_library(source, identified, baseline)
    return library, run_loop(source, identified, baseline, library, Accept())


def test_what_is_planted_is_found_added_and_lowers_the_error_of_flights_left_out(
    source: FlightsInMemory,
) -> None:
    split = hold_out(source)
    library, loop = closed(source, split.identified, database())
    (finding,) = loop.added
    assert (finding.hypothesis, finding.verdict) == ("pitch_damping@Cm", "confirmed")
    assert finding.ci95[0] < DAMPING < finding.ci95[1]
    assert finding.value == pytest.approx(DAMPING, rel=0.1)
    (increment,) = loop.candidate.increments
    assert (increment.axis, increment.flights) == ("Cm", split.identified)
    assert float(increment.estimates[0]) == pytest.approx(DAMPING, rel=0.1)
    assert loop.baseline.increments == ()
    axes = {entry.axis: entry for entry in validate_loop(source, split, library, loop, Accept())}
    before, after = axes["Cm"].held_out_rms_before, axes["Cm"].held_out_rms_after
    truth = [_error(source, flight, database(-14.0 + DAMPING), "Cm") for flight in split.held_out]
    assert before is not None
    assert after is not None
    assert before > 10.0 * max(truth)
    assert after < 1.2 * max(truth)
    assert axes["CX"].outcome == "unchanged"


def _error(source: FlightSource, flight: str, model: AeroDatabase, axis: str) -> float:
    beside = source.comparison(flight, model)
    return float(np.sqrt(np.mean(beside.residual(axis)[beside.usable[axis]] ** 2)))


def test_bands_contain_what_the_shape_of_an_addition_misses(source: FlightsInMemory) -> None:
    """The candidate of the loop, and the same with half of the damping: the other half is left,
    and is the error of its shape on every flight."""
    split = hold_out(source)
    library, loop = closed(source, split.identified, database())
    right = with_model_error(source, split.identified, loop, library)
    (increment,) = loop.candidate.increments
    half = replace(increment, estimates=0.5 * increment.estimates)
    wrong = replace(loop, candidate=replace(loop.candidate, increments=(half,)))
    wide = with_model_error(source, split.identified, wrong, library)
    missing, noise, held, narrow = [], [], list[Mask](), list[Mask]()
    for id in split.held_out:
        channels = loop.candidate.resolved(loop.candidate.needs, source.flight(id).channels)
        value, model = half.evaluate(channels), wide.increments[0].evaluate(channels)
        assert np.array_equal(model.value, value.value)
        left = np.abs(value.value - value.value.mean())
        held += [left < 1.96 * model.standard_error]
        narrow += [left < 1.96 * value.standard_error]
        missing.append(float(np.std(value.value)))
        noise.append(_error(source, id, database(-14.0 + DAMPING), "Cm"))
    assert np.mean(held) > 0.9 > 2.0 * np.mean(narrow)
    (error,) = np.sqrt(np.diag(wide.increments[0].covariance)[1:])
    assert error == pytest.approx(np.sqrt(np.mean(np.square(missing))), rel=0.3)
    rest = np.sqrt(np.diag(right.increments[0].covariance)[1:])
    assert np.all(rest < 0.3 * max(noise))
    assert with_model_error(source, split.identified, replace(loop, candidate=database()), library)


def test_where_nothing_lacks_nothing_is_confirmed(source: FlightsInMemory) -> None:
    split = hold_out(source)
    _, loop = closed(source, split.identified, database(-14.0 + DAMPING))
    assert loop.added == ()
    assert [finding.hypothesis for finding in loop.findings if finding.verdict == "confirmed"] == []
    assert loop.candidate is loop.baseline
    assert loop.rounds == 1
    bounds = {entry.hypothesis: entry.upper_bound for entry in loop.traced.not_found}
    bound = bounds["pitch_damping@Cm"]
    assert bound is not None
    assert bound < abs(DAMPING)


def test_what_joined_the_library_after_a_look_is_suspected_at_most(source: FlightsInMemory) -> None:
    split = hold_out(source)
    _, loop = closed(
        replace(source, known=frozenset({"alpha_slope@CZ"})), split.identified, database()
    )
    assert loop.added == ()
    found = {finding.hypothesis: finding for finding in loop.findings}
    assert found["pitch_damping@Cm"].verdict == "suspected"
    assert "joined the list of effects" in found["pitch_damping@Cm"].because


def test_what_lowers_no_error_of_flights_left_out_stays_out(source: FlightsInMemory) -> None:
    """The proof is as it was, and then as if the finding had gained half a percent."""
    split = hold_out(source)
    library, loop = closed(source, split.identified, database())
    proof = validate_loop(source, split, library, loop, Accept())
    assert without_gain(loop, proof) == frozenset()
    level = tuple(
        replace(entry, held_out_rms_after=1.5 * (entry.held_out_rms_before or 0.0))
        for entry in proof
    )
    assert without_gain(loop, level) == frozenset()  # the error about each flight's mean falls
    idle = tuple(
        replace(
            entry,
            held_out_rms_after=0.995 * (entry.held_out_rms_before or 0.0),
            held_out_shape_after=0.995 * (entry.held_out_shape_before or 0.0),
        )
        for entry in proof
    )
    assert without_gain(loop, idle) == {"pitch_damping@Cm"}
    again = run_loop(
        source, split.identified, database(), library, Accept(), without_gain(loop, idle)
    )
    assert again.added == ()
    assert again.candidate is again.baseline
    (finding,) = [f for f in again.findings if f.hypothesis == "pitch_damping@Cm"]
    assert finding.verdict == "suspected"
    assert "by less than 1 %" in finding.because
    assert any("Not added although found: pitch_damping@Cm" in text for text in again.remarks)
    for stays, verdict in ((frozenset({"pitch_damping@Cm"}), "suspected"), ((), "confirmed")):
        (alone,) = only_with_gain(loop.added, (), stays)
        assert alone.verdict == verdict
        assert alone.because.endswith("alone it makes its axis worse") == (verdict == "suspected")


def test_a_finding_beside_more_that_has_no_name_is_not_believed(source: FlightsInMemory) -> None:
    """The proof is as it was; beside it stands an unexplained residual a little smaller, or larger,
    than what the finding removed, on its own axis or another one."""
    split = hold_out(source)
    library, loop = closed(source, split.identified, database())
    proof = validate_loop(source, split, library, loop, Accept())
    assert [finding.hypothesis for finding in loop.added] == ["pitch_damping@Cm"]
    removed = {
        entry.axis: (entry.held_out_rms_before or 0.0) ** 2 - (entry.held_out_rms_after or 0.0) ** 2
        for entry in proof
    }

    def unnamed(axis: str, power: float, found: bool = True) -> tuple[UnexplainedResidual, ...]:
        skills = (0.4, 0.6)
        return (
            UnexplainedResidual(axis, found, 0.5, 0.01, (), skills, "", (2.0 * power, 2.0 * power)),
        )

    larger, smaller = 1.1 * removed["Cm"], 0.9 * removed["Cm"]
    assert beside_larger_unnamed(loop, proof, unnamed("Cm", larger)) == {"pitch_damping@Cm"}
    assert not beside_larger_unnamed(loop, proof, unnamed("Cm", smaller))
    assert not beside_larger_unnamed(loop, proof, unnamed("Cm", larger, found=False))
    assert not beside_larger_unnamed(loop, proof, unnamed("CZ", larger))


def test_what_is_unexplained_but_hardly_lowers_the_error_is_not_reported() -> None:
    """Without it, the rms error would fall by 1.4 % or by .6 %; a flight's constant does not count,
    however large."""
    rng, n = np.random.default_rng(4), 4000
    errors = [level + rng.standard_normal(n) for level in (30.0, -20.0, 10.0)]
    usable = {"CX": np.ones(n, dtype=bool)}
    residuals = [
        FlightResidual(Evidence(f"f{k}", 0.04, {"CX": error}, usable, {}), {})
        for k, error in enumerate(errors)
    ]
    for part, told in ((0.028, True), (0.012, False)):
        skills, power = (0.5, 0.5, 0.5), (2.0 * part, 2.0 * part, 2.0 * part)
        found = UnexplainedResidual("CX", True, 0.5, 0.01, ("u",), skills, "found", power)
        (judged,) = material((found,), residuals)
        assert (judged.found, bool(judged.variables)) == (told, told)
        assert ("too little to matter" in judged.because) == (not told)


def test_a_name_that_the_library_does_not_have_is_refused(source: FlightsInMemory) -> None:
    split = hold_out(source)
    library = freeze_library(source, split.identified, database())
    with pytest.raises(InputError, match="no effect 'pitch_dampng' is known"):
        run_loop(source, split.identified, database(), library, Accept(suspected=("pitch_dampng",)))
    with pytest.raises(InputError, match="it changed since it was fixed"):
        freeze_library(source, split.identified, database(), expected="0" * 64)


def test_an_aileron_that_loses_with_dynamic_pressure_differs_between_flights() -> None:
    """It averages out of the flights, so that the loop adds nothing; the comparison of flights says
    it, in the database's own terms."""
    rng, flown = np.random.default_rng(5), {}
    for flight in varied_flights.flown()[:8]:
        made = total_coefficients(flight, varied_flights.vehicle(), angular_acceleration="logged")
        loss = 8e-5 * flight["delta_aileron"] * (flight["qbar"] - 2400.0)
        values = {
            axis: given + FLOOR[axis] * coloured(rng, len(loss), step=flight.step)
            for axis, given in made.values.items()
        }
        values["Cl"] = values["Cl"] + loss
        flown[flight.id] = (flight, replace(made, values=values))
    source = FlightsInMemory(varied_flights.vehicle(), flown)
    library, loop = closed(source, tuple(flown), varied_flights.database())
    found = dependences_between_flights(source, tuple(flown), library, loop)
    assert [claim.hypothesis.id for claim in found] == ["control_effectiveness@Cl:aileron"]
    (claim,) = found
    assert "qbar" in (claim.condition, *claim.also)
    assert claim.relative is not None
    said = claim.document()
    assert said["ci95"][0] < said["slope"] < said["ci95"][1]
    assert len(said["votes"]) == 8
    if claim.condition == "qbar":
        assert claim.ci95[0] < 8e-5 < claim.ci95[1]
        assert claim.relative == pytest.approx(8e-5 / -0.16, rel=0.2)
    assert "falls by" in claim.because
    assert "with the same sensors" in claim.settled_by
    assert not [f for f in loop.added if f.axis == ("Cl",)]
    few = tuple(flown)[:4]
    assert dependences_between_flights(source, few, library, loop) == ()


def test_what_a_sensor_explains_as_well_enters_only_on_request(source: FlightsInMemory) -> None:
    """A constant of Cm is left by a zero of the elevator that is off by a quarter of a degree as
    well: it is added where the user asks for it, with its verdict."""
    split, text = hold_out(source), effect_flights.HEADER_ONLY + effect_flights._MOMENTS
    text = (text + effect_flights._BODY).replace("q_hat = -14.0", f"q_hat = {-14.0 + DAMPING}")
    assert text.count('"1" = -0.02\n') == 1
    wrong = read_native(text.replace('"1" = -0.02\n', '"1" = -0.016\n'))
    library = freeze_library(source, split.identified, wrong)
    plain = run_loop(source, split.identified, wrong, library, Accept())
    (finding,) = (f for f in plain.findings if f.hypothesis == "zero_offset@Cm")
    assert finding.verdict == "ambiguous_sensor"
    assert "surface_bias@all:elevator" in finding.explanation_set
    assert plain.candidate is wrong
    accept = Accept(ambiguous=("zero_offset@Cm",))
    asked = run_loop(source, split.identified, wrong, library, accept)
    (added,) = asked.added
    assert (added.hypothesis, added.verdict) == ("zero_offset@Cm", "ambiguous_sensor")
    assert accept.asks_for(added)
    assert not Accept(suspected=("zero_offset@Cm",)).asks_for(added)
    (increment,) = asked.candidate.increments
    # what the sensors are believed to leave at most likely is taken off
    assert float(increment.estimates[0]) == pytest.approx(-0.004, rel=0.15)
    assert "ambiguous sensor" in increment.full_note


def test_of_a_surface_that_stands_still_nothing_is_claimed(source: FlightsInMemory) -> None:
    """The noise of its pick-off, .001 deg, is in CX as well: no effect of 300 per radian."""
    split, rng, flown = hold_out(source), np.random.default_rng(4), {}
    for id, (flight, made) in source.flown.items():
        noise = 2e-5 * rng.standard_normal(len(flight.time))
        values = {**made.values, "CX": made.values["CX"] + 300.0 * noise}
        flown[id] = (flight.with_channels({"delta_strake": noise}), replace(made, values=values))
    quiet = FlightsInMemory(source.vehicle, flown)
    _, loop = closed(quiet, split.identified, database(-14.0 + DAMPING))
    assert not [f.hypothesis for f in loop.findings if "strake" in f.hypothesis]
    idle = {each.hypothesis: each.verdict for each in loop.traced.not_found}
    assert idle["control_effectiveness@CX:strake"] == "not_excited"
    assert any("excite delta_strake" in sentence for sentence in loop.traced.next_flight)


def test_flights_that_lack_an_axis_take_part_in_the_others(source: FlightsInMemory) -> None:
    """Two of five flights have no CX and no Cn, as without their thrust; what Cm lacks is found,
    proved and given its band all the same."""
    split = hold_out(source)
    lacking = dict(source.flown)
    for id in split.identified[1:3]:
        flight, made = lacking[id]
        kept = {axis: values for axis, values in made.values.items() if axis not in ("CX", "Cn")}
        sigma = {axis: made.sigma[axis] for axis in kept}
        lacking[id] = flight, replace(made, values=kept, sigma=sigma)
    fewer = replace(source, flown=lacking)
    library, loop = closed(fewer, split.identified, database())
    assert [finding.hypothesis for finding in loop.added] == ["pitch_damping@Cm"]
    axes = {entry.axis: entry for entry in validate_loop(fewer, split, library, loop, Accept())}
    assert axes["Cm"].outcome in ("improved", "at noise floor")
    # What is wrong on CX shows on the three flights that have it, and on one it shows nothing.
    (increment,) = loop.candidate.increments
    wrong = replace(loop.candidate, increments=(increment, replace(increment, axis="CX")))
    for flights, shape in ((split.identified, (2, 2)), (split.identified[1:4], (1, 1))):
        banded = with_model_error(fewer, flights, replace(loop, candidate=wrong), library)
        assert banded.increments[1].covariance.shape == shape
