"""Coefficients of hinge moments from a flight: beside an independent computation, compared with a
database, and what is said where the vehicle file states too little."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import Coefficients, compare, total_coefficients
from aerodb.errors import InputError
from aerodb.exchange import read_native
from aerodb.flight import Flight
from aerodb.logs import map_recording, parse_mapping
from aerodb.nomenclature import AXES, in_order
from aerodb.recording import Recording, Topic
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.small_glider import DATABASE, VEHICLE, channels

#: Area [m2] and chord [m] behind the hinge line, and hinge moment over stick force [m].
AREA, CHORD, GEARING = 0.06, 0.05, -0.4
HINGE = f"""
[surfaces.elevator.hinge]
area = "{AREA * 1e4} cm^2"
chord = "{CHORD * 1e2} cm"
"""
GEARED = 'gearing = "-40 cm"\nlog = { topic = "table", field = "stick", unit = "lbf" }\n'
MAPPING = 'name = "own"\nformats = ["tabular"]\n[time]\ntopic = "table"\nfield = "time"\n'
POUND = 4.4482216152605


def _moment(seed: int = 1) -> np.ndarray:
    t = np.arange(300) / 25.0
    return 0.3 * np.sin(1.7 * t) + 0.01 * np.random.default_rng(seed).standard_normal(300)


def _mapped(
    vehicle: Vehicle, fields: dict[str, np.ndarray], units: dict[str, str], *entries: str
) -> Flight:
    table = channels(0)
    time = table.pop("time")
    parts = [
        f'[[channel]]\nname = "{name}"\nsources = [{{topic = "table", field = "{name}"}}]\n'
        for name in (*table, *entries)
    ]
    known = {"V": "m/s", "qbar": "Pa"} | dict.fromkeys("pqr", "rad/s")
    known |= dict.fromkeys(("ax", "ay", "az"), "m/s^2")
    known |= dict.fromkeys(("alpha", "beta", "delta_elevator"), "rad")
    topic = Topic("table", time, {"time": time, **table, **fields}, {"time": "s", **known, **units})
    recording = Recording("table.csv", "tabular", "0" * 64, 1, {"table": topic})
    return map_recording(recording, parse_mapping(MAPPING + "".join(parts)), vehicle)


def _vehicle(hinge: str) -> Vehicle:
    return parse_vehicle(VEHICLE.replace("[thrust]", f"{hinge}[thrust]"))


def _coefficients(hinge: str = HINGE) -> tuple[Flight, Vehicle, Coefficients]:
    vehicle = _vehicle(hinge)
    moment = {"hinge_moment_elevator": _moment()}
    flight = _mapped(vehicle, moment, {"hinge_moment_elevator": "N m"}, *moment)
    return flight, vehicle, total_coefficients(flight, vehicle)


def test_the_coefficient_is_the_moment_over_the_surfaces_own_area_and_chord() -> None:
    flight, _, found = _coefficients()
    expected = _moment() / (flight["qbar"] * AREA * CHORD)
    np.testing.assert_allclose(found.values["Ch_elevator"], expected, rtol=1e-12)
    noise = found.sigma["Ch_elevator"] * flight["qbar"] * AREA * CHORD
    assert np.median(noise) == pytest.approx(0.01, rel=0.2)
    assert any("friction" in note for note in found.notes)
    # the six axes are those of the flight without it, bit for bit
    alone = total_coefficients(
        replace(
            flight,
            channels={n: v for n, v in flight.channels.items() if n != "hinge_moment_elevator"},
        ),
        _vehicle(HINGE),
    )
    assert set(found.values) == {*alone.values, "Ch_elevator"}
    for axis, values in alone.values.items():
        np.testing.assert_array_equal(values, found.values[axis])
        np.testing.assert_array_equal(alone.usable[axis], found.usable[axis])


def test_a_force_on_the_control_is_a_moment_by_its_gearing() -> None:
    """A stick force in pounds, which holds a moment of the opposite sign."""
    force = _moment() / GEARING / POUND
    flight = _mapped(_vehicle(HINGE + GEARED), {"stick": force}, {})
    np.testing.assert_allclose(flight["hinge_moment_elevator"], _moment(), rtol=1e-12)


def test_samples_that_are_flagged_are_not_used() -> None:
    flight, vehicle, _ = _coefficients()
    bad = np.zeros(300, dtype=np.bool_)
    bad[40:60] = True
    flagged = flight.with_flag("hinge_moment_elevator", "wild_point", bad)
    found = total_coefficients(flagged, vehicle)
    np.testing.assert_array_equal(found.usable["Ch_elevator"], ~bad)
    assert found.usable["CZ"].all()


@pytest.mark.parametrize("known", [True, False])
def test_it_is_compared_with_the_database(known: bool) -> None:
    """A database without hinge moments predicts none, as of an axis without terms."""
    terms = '[derivatives.Ch_elevator]\n"1" = 0.1\ndelta_elevator = -0.5\n' if known else ""
    flight, vehicle, coefficients = _coefficients()
    # lengths of the wing do not matter to a hinge moment
    text = (DATABASE + terms).replace("chord = 0.25", "chord = 0.5")
    found = compare(flight, coefficients, read_native(text), vehicle.reference)
    assert in_order(found.usable) == (*AXES, "Ch_elevator")
    measured = _moment() / (flight["qbar"] * AREA * CHORD)
    predicted = (0.1 - 0.5 * flight["delta_elevator"]) * known
    left = (measured - predicted)[found.usable["Ch_elevator"]]
    said = found.summary("Ch_elevator")
    assert said["samples"] == 300
    assert said["mean_residual"] == pytest.approx(left.mean(), rel=1e-9)
    assert said["rms_residual"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-9)
    assert said["of_flown"] == pytest.approx(said["rms_residual"] / measured.std(), rel=1e-9)


def test_without_area_and_chord_it_is_not_used_and_this_is_said() -> None:
    _, _, found = _coefficients("")
    assert "Ch_elevator" not in found.values
    (said,) = (note for note in found.notes if "hinge_moment_elevator" in note)
    assert "state area and chord behind the hinge line in [surfaces.elevator.hinge]" in said


@pytest.mark.parametrize(
    ("hinge", "what"),
    [
        ('[surfaces.elevator.hinge]\narea = "600 cm^2"\n', "chord"),
        ("[surfaces.elevator.hinge]\narea = 0.06\nchord = -0.05\n", "chord"),
        ('[surfaces.elevator.hinge]\narea = "600 cm"\nchord = 0.05\n', "area"),
        (f"{HINGE}gearing = 0.4\n", "gearing needs the place and the unit"),
        (
            f'{HINGE}gearing = 0.4\nlog = {{ topic = "table", field = "stick" }}\n',
            "gearing needs the place and the unit",
        ),
        (
            f'{HINGE}gearing = 0\nlog = {{ topic = "table", field = "stick", unit = "N" }}\n',
            "gearing is 0",
        ),
    ],
)
def test_a_hinge_that_states_too_little_is_refused(hinge: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        _vehicle(hinge)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ('log = { topic = "table", field = "stick" }', "no unit is declared"),
        ('log = { topic = "table", field = "stick", unit = "N" }', "'N' .*'N m'"),
        ('gearing = 0.4\nlog = { topic = "table", field = "stick", unit = "N m" }', "'N m m'"),
    ],
)
def test_a_unit_that_is_missing_or_no_moment_is_refused(line: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        _mapped(_vehicle(f"{HINGE}{line}\n"), {"stick": _moment()}, {})
