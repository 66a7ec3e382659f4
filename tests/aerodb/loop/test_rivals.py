"""The errors of sensors that a declared update would absorb are its rivals, and only they."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.increments import (
    ModelFile,
    estimate_increments,
    judge_derivatives,
    judge_rivals,
    parse_model_file,
)
from aerodb.loop import SensorRival, freeze_library, sensor_rivals
from aerodb.loop.rivals import _Change, _Seen
from aerodb.report import in_words
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from aerodb.vehicle import Sensor
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory, noisy_flights

MODEL = """\
[[increment]]
axis = "CZ"
terms = ["1", "alpha"]
[[increment]]
axis = "Cm"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
"""


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 66))


def rivals(
    source: FlightsInMemory, baseline: AeroDatabase, text: str = MODEL
) -> tuple[SensorRival, ...]:
    identified = tuple(source.flown)
    model: ModelFile = parse_model_file(text, "model.toml")
    update = estimate_increments(
        [source.flight(id) for id in identified],
        [source.comparison(id, baseline) for id in identified],
        model,
        baseline,
    )
    library = freeze_library(source, identified, baseline)
    return sensor_rivals(source, identified, baseline, update.candidate, library)


def test_a_wrong_vane_is_the_rival_of_the_slopes_that_absorb_it(source: FlightsInMemory) -> None:
    """alpha reads 12 % too high beside a complete database: the increments lower both slopes by 11
    %, which the size of the change alone would let pass."""
    wrong = {
        id: (flight.with_channels({"alpha": 1.12 * flight["alpha"]}), made)
        for id, (flight, made) in source.flown.items()
    }
    found = rivals(FlightsInMemory(source.vehicle, wrong), database(1.0))
    assert [rival.hypothesis for rival in found] == ["alpha_scale@all"]
    assert found[0].value == pytest.approx(0.12 / 1.12, rel=0.15)  # as a part of the reading
    assert found[0].shares["CZ"] == pytest.approx(1.0, abs=0.3)
    documents = [asdict(rival) for rival in found]
    (reason,) = judge_rivals(documents, ()).reasons
    assert "alpha_scale@all explains" in reason
    assert judge_rivals(documents, {"alpha_scale@all"}).passed


def test_the_remedy_is_typed_as_it_is_printed() -> None:
    """Pages write the error in words, and what is to be typed as the gate takes it."""
    check = judge_rivals([{"hypothesis": "inertia_error@all:Ixx", "shares": {"Cl": 1.0}}], ())
    said = in_words(check.reasons[0])
    assert said.startswith("the moment of inertia Ixx explains what changes on Cl")
    assert f"if the log and the vehicle file are right: --accept {check.acceptable[0]}," in said


def test_what_the_aircraft_has_beyond_its_database_has_no_rival(source: FlightsInMemory) -> None:
    assert rivals(source, database(0.0)) == ()


def test_a_wrong_sensor_of_axes_that_do_not_change_is_no_rival(source: FlightsInMemory) -> None:
    """beta reads 15 % too high: roll and yaw feel it, and the declared pitching moment does
    not."""
    wrong = {
        id: (flight.with_channels({"beta": 1.15 * flight["beta"]}), made)
        for id, (flight, made) in source.flown.items()
    }
    text = MODEL[MODEL.index('[[increment]]\naxis = "Cm"') :]
    found = rivals(FlightsInMemory(source.vehicle, wrong), database(0.0), text)
    assert "beta_scale@all" not in {rival.hypothesis for rival in found}


def test_a_surface_is_a_rival_where_an_axis_lacks_its_term() -> None:
    """The rudder reads 30 % too much. Its share in side force and roll is not declared: other terms
    there take what they can of it, and the rudder explains what was measured as well as they do."""
    complete = database(1.0)
    rolling = replace(
        complete, terms=(*complete.terms, Term("more", "Cl", parse("0.2*delta_rudder")))
    )
    source = noisy_flights(range(60, 64), rolling, np.random.default_rng(5), 1.0)
    wrong = {
        id: (flight.with_channels({"delta_rudder": 1.3 * flight["delta_rudder"]}), made)
        for id, (flight, made) in source.flown.items()
    }
    text = """\
[[increment]]
axis = "CY"
terms = ["beta"]
[[increment]]
axis = "Cl"
terms = ["beta", "p_hat", "delta_aileron"]
[[increment]]
axis = "Cn"
terms = ["beta", "r_hat", "delta_rudder"]
"""
    found = rivals(FlightsInMemory(source.vehicle, wrong), rolling, text)
    assert "surface_scale@all:rudder" in {rival.hypothesis for rival in found}


@pytest.mark.parametrize(("truly", "explained"), [(0.0, True), (0.3, False)])
def test_what_noise_makes_of_several_terms_excuses_no_error(truly: float, explained: bool) -> None:
    """Four terms take .15 of the rms of what noise leaves, by least squares. An error without any
    part there is excused by more than that alone."""
    rng, n = np.random.default_rng(3), 2000
    columns = np.cumsum(rng.standard_normal((n, 4)), axis=0)
    basis = np.linalg.qr(columns - columns.mean(axis=0))[0]
    noise = np.convolve(rng.standard_normal(n), np.ones(8), "same")
    noise -= basis @ (basis.T @ noise)
    taken = basis @ rng.standard_normal(4)
    taken *= np.hypot(0.15, truly) * np.std(noise) / np.std(taken)
    seen = _Seen(None, {"Cn": np.arange(n)}, {"Cn": taken}, {"Cn": noise})  # type: ignore[arg-type]
    assert _Change([seen]).is_explained([{}], "Cn", 0.3) is explained


@pytest.mark.parametrize("noise", [0.0, 1.0, 4.0])
def test_an_axis_whose_channels_are_noise_excludes_no_rival(
    source: FlightsInMemory, noise: float
) -> None:
    """The vehicle file has the CG .05 chords too far aft. The noise of beta, in times its motion,
    is in the side force that a moved CG turns to yaw, and in the residual of yaw as well."""
    rng, own = np.random.default_rng(3), source.vehicle
    (x, y, z), off = own.mass.cg, 0.05 * own.reference.chord
    mass = own.mass.model_copy(update={"cg": (x - off, y, z)})
    moved = own.model_copy(update={"mass": mass})
    wrong = {}
    for id, (flight, made) in source.flown.items():
        right, aft = (
            total_coefficients(flight, each, angular_acceleration="logged").values
            for each in (own, moved)
        )
        shifted = {axis: values + aft[axis] - right[axis] for axis, values in made.values.items()}
        beta = flight["beta"]
        seen = beta + noise * beta.std() * rng.standard_normal(len(beta))
        wrong[id] = flight.with_channels({"beta": seen}), replace(made, values=shifted)
    text = MODEL[MODEL.index('[[increment]]\naxis = "Cm"') :]
    (found,) = rivals(FlightsInMemory(moved, wrong), database(1.0), text)
    assert found.hypothesis == "cg_offset@all:x"
    assert found.value == pytest.approx(-off, rel=0.02)


@pytest.mark.parametrize("stated", [False, True])
def test_a_dead_zone_on_one_side_is_a_zero_of_its_surface(
    source: FlightsInMemory, stated: bool
) -> None:
    """The elevator is logged far on one side, and Cm lacks a constant of 1.2 deg of it. Where the
    vehicle file states its zero to .1 deg, no dead zone makes that constant."""
    away, lacking = 0.4, float(np.deg2rad(1.2))
    whole = database(1.0)
    here = {name: np.zeros(1) for name in whole.inputs} | {"V": np.array([60.0])}
    sides = [
        whole.predict(here | {"delta_elevator": np.array([d])}).coefficients for d in (0, away)
    ]
    zeros = (
        Term(f"zero_{axis}", axis, parse(repr(float(sides[0][axis][0] - sides[1][axis][0]))))
        for axis in ("CX", "CZ", "Cm")
    )
    shifted = replace(whole, terms=(*whole.terms, *zeros))
    slope = float(sides[1]["Cm"][0] - sides[0]["Cm"][0]) / away
    baseline = replace(
        shifted, terms=(*shifted.terms, Term("lacks", "Cm", parse(repr(lacking * slope))))
    )
    logged = {
        id: (flight.with_channels({"delta_elevator": flight["delta_elevator"] + away}), made)
        for id, (flight, made) in source.flown.items()
    }
    vehicle = source.vehicle
    if stated:
        known = Sensor(bias_prior=float(np.deg2rad(0.1)))
        vehicle = vehicle.model_copy(
            update={"sensors": {**vehicle.sensors, "delta_elevator": known}}
        )
    text = '[[increment]]\naxis = "Cm"\nterms = ["1"]\n'
    found = {r.hypothesis for r in rivals(FlightsInMemory(vehicle, logged), baseline, text)}
    assert ("surface_dead_zone@all:elevator" in found) == (not stated)
    assert ("surface_bias@all:elevator" in found) == (not stated)


def test_a_change_that_no_flight_tells_from_none_has_no_rival(source: FlightsInMemory) -> None:
    """A right database estimated again: its change is a part of the noise, and any small error
    explains it as well."""
    for text in (
        '[[increment]]\naxis = "Cl"\nterms = ["p_hat", "delta_aileron"]\n',
        '[[increment]]\naxis = "Cn"\nterms = ["beta", "delta_rudder"]\n',
    ):
        assert rivals(source, database(1.0), text) == ()


def test_nothing_to_judge_passes() -> None:
    assert judge_rivals((), ()).passed
    assert judge_derivatives((), 0.5, ()).passed
