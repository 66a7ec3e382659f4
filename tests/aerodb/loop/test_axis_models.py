"""Where many effects act at once, the increment model of an axis enters as a whole; elsewhere none
does."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.native import read_native
from aerodb.increments.validation import HoldOut
from aerodb.loop import Accept, LoopResult, freeze_library, run_loop, validate_loop
from aerodb.tables.database import AeroDatabase
from tests.support import effect_flights
from tests.support.flights_in_memory import FlightsInMemory, noisy_flights

#: What the flown aircraft has beyond the database on Cm, as the text of its derivatives.
PLANTED = {
    "alpha": ("-0.25", -0.06),
    "q_hat": ("-14.0", -3.0),
    "delta_elevator": ("-1.1", 0.12),
    '"1"': ("-0.02", 0.004),
}
_NAMES = {
    "alpha": "alpha_slope@Cm",
    "q_hat": "pitch_damping@Cm",
    "delta_elevator": "control_effectiveness@Cm:elevator",
    '"1"': "zero_offset@Cm",
}


def database(share: float = 0.0) -> AeroDatabase:
    """That of the flights; share : of the planted differences that it has."""
    text = effect_flights.HEADER_ONLY + effect_flights._MOMENTS + effect_flights._BODY
    head, moment = text.split("[derivatives.Cm]\n")
    for name, (value, more) in PLANTED.items():
        assert moment.count(f"{name} = {value}\n") == 1, name
        moment = moment.replace(
            f"{name} = {value}\n", f"{name} = {float(value) + share * more!r}\n"
        )
    return read_native(f"{head}[derivatives.Cm]\n{moment}")


def flights(seeds: range, noise: float = 1.0) -> FlightsInMemory:
    """Flights of the aircraft with all differences; coloured noise on all coefficients."""
    return noisy_flights(seeds, database(1.0), np.random.default_rng(5), noise)


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 66))


def error(source: FlightsInMemory, flight: str, model: AeroDatabase, axis: str = "Cm") -> float:
    beside = source.comparison(flight, model)
    return float(np.sqrt(np.mean(beside.residual(axis)[beside.usable[axis]] ** 2)))


def closed(source: FlightsInMemory, identified: tuple[str, ...], share: float) -> LoopResult:
    library = freeze_library(source, identified, database(share))
    return run_loop(source, identified, database(share), library, Accept())


def test_many_effects_of_one_axis_enter_together_with_their_sizes(source: FlightsInMemory) -> None:
    *identified, held_out = source.flown
    loop = closed(source, tuple(identified), 0.0)
    (model,) = loop.axis_models
    assert model.axis == "Cm"
    assert set(_NAMES.values()) <= set(model.terms)
    assert set(model.terms) == {finding.hypothesis for finding in loop.added}
    for name, (_, value) in PLANTED.items():
        (finding,) = (f for f in loop.added if f.hypothesis == _NAMES[name])
        assert finding.ci95[0] < value < finding.ci95[1], name
        assert finding.value == pytest.approx(value, rel=0.15), name
    (increment,) = loop.candidate.increments
    assert increment.axis == "Cm"
    # The increment is as uncertain as its findings say.
    deviation = np.sqrt(np.diag(increment.covariance))
    halves = [0.5 * (f.ci95[1] - f.ci95[0]) for f in loop.added]
    assert sorted(1.96 * deviation) == pytest.approx(sorted(halves), rel=0.01)
    before, after, truth = (
        error(source, held_out, each) for each in (database(), loop.candidate, database(1.0))
    )
    assert before > 5.0 * truth
    assert after < 1.1 * truth
    assert model.left_out < 0.5 * model.singles
    assert any("were added together" in remark for remark in loop.remarks)


def test_few_flights_predict_each_other(source: FlightsInMemory) -> None:
    """Which terms is decided on all four; their values come from the other three."""
    few = tuple(source.flown)[:4]
    library = freeze_library(source, few, database())
    loop = run_loop(source, few, database(), library, Accept())
    assert [model.axis for model in loop.axis_models] == ["Cm"]
    split = HoldOut(few, (), "cross-validated")
    axes = {e.axis: e for e in validate_loop(source, split, library, loop, Accept())}
    truth = np.sqrt(np.mean([error(source, flight, database(1.0)) ** 2 for flight in few]))
    assert axes["Cm"].held_out_rms_after is not None
    assert axes["Cm"].held_out_rms_after < 1.3 * truth


def test_a_complete_database_gets_no_increment_model(source: FlightsInMemory) -> None:
    loop = closed(source, tuple(source.flown), 1.0)
    assert loop.axis_models == ()
    assert loop.added == ()


def test_a_wrong_sensor_is_not_modelled_as_many_effects(source: FlightsInMemory) -> None:
    """alpha reads 12 % too high and every axis feels it: the sensor is found, and beside increment
    models of all axes it still is."""
    wrong = {
        id: (flight.with_channels({"alpha": 1.12 * flight["alpha"]}), made)
        for id, (flight, made) in source.flown.items()
    }
    loop = closed(FlightsInMemory(source.vehicle, wrong), tuple(wrong), 1.0)
    assert [f.hypothesis for f in loop.findings if f.verdict == "sensor"] == ["alpha_scale@all"]
    assert loop.axis_models == ()


def test_what_turns_controls_round_is_not_corrected_as_a_whole(source: FlightsInMemory) -> None:
    """Angular acceleration that is nearly lost: Cm as of an aircraft without controls."""
    lost = {
        id: (flight, replace(made, values={**made.values, "Cm": -0.02 * made.values["Cm"]}))
        for id, (flight, made) in source.flown.items()
    }
    loop = closed(FlightsInMemory(source.vehicle, lost), tuple(lost), 1.0)
    assert loop.axis_models == ()
    assert not any("Cm" in increment.axis for increment in loop.candidate.increments)
    (remark,) = (each for each in loop.remarks if each.startswith("Cm: not corrected as a whole"))
    assert "the control acts the other way round" in remark


@pytest.mark.parametrize("seed", [70, 80, 90])
def test_noise_far_above_the_declared_is_no_increment_model(seed: int) -> None:
    """Ten times the noise: every axis is far above its floor, and nothing predicts other flights."""
    noisy = flights(range(seed, seed + 5), noise=10.0)
    loop = closed(noisy, tuple(noisy.flown), 1.0)
    assert loop.axis_models == ()
    assert [f for f in loop.added if f.verdict == "confirmed"] == []


def test_what_lowered_no_error_gets_no_stand_ins(source: FlightsInMemory) -> None:
    identified = tuple(source.flown)
    library = freeze_library(source, identified, database())
    barred = frozenset({"pitch_damping@Cm"})
    loop = run_loop(source, identified, database(), library, Accept(), barred)
    assert loop.axis_models == ()
    assert "pitch_damping@Cm" not in {finding.hypothesis for finding in loop.added}


def test_a_measurement_on_the_command_line_is_a_prior_like_that_of_the_vehicle_file(
    source: FlightsInMemory,
) -> None:
    identified = tuple(source.flown)
    before = {h.id: h for h in freeze_library(source, identified, database()).hypotheses}
    stated = ["q_scale=0.001, rate table", "cg_x = 3 mm, weighed 2026-03-01", "alpha_delay=2 ms"]
    library = freeze_library(source, identified, database(), measured=stated)
    found = {h.id: h for h in library.hypotheses}
    expected = {
        "gyro_scale@all:q": (0.001, "rate table"),
        "cg_offset@all:x": (0.003, "weighed 2026-03-01"),
        "alpha_delay@all": (0.002, "the vehicle file"),
    }
    for id, (sigma, by) in expected.items():
        assert found[id].prior_sigma == pytest.approx(sigma)
        assert found[id].plausible == pytest.approx((-3.0 * sigma, 3.0 * sigma))
        assert found[id].known_by == by
    assert {id for id in found if found[id] != before[id]} == set(expected)
    assert library.sha256 != freeze_library(source, identified, database()).sha256


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("cg_x", "states no measurement"),
        ("cg_x=", "states no measurement"),
        ("cg_y=-3 mm", "greater than 0"),
        ("elevater_scale=.005", "did you mean|known names"),
        ("cg_x=3 kg", "cannot be converted"),
    ],
)
def test_what_states_no_measurement_is_refused(
    source: FlightsInMemory, text: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        freeze_library(source, tuple(source.flown), database(), measured=[text])
