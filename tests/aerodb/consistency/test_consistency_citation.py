"""Tests on a long flight without sideslip vane and heading: it is corrected in windows, and
channels that were not measured are not invented."""

import numpy as np
import pytest

from aerodb.conditioning.segmentation import flag_on_ground
from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.records import records_from_flight
from aerodb.consistency.sensors.parameters import parameter
from aerodb.vehicle import parse_vehicle
from tests.support.consistency_records import ATTAS_BIASES
from tests.support.measured_flights import CITATION, as_flight

#: Nominal: mass and inertia do not enter kinematics.
VEHICLE = """
name = "citation"
[reference]
area = 30.0
chord = 2.0569
span = 15.911
[points]
moment_reference = "cg"
[mass]
mass = 5500.0
cg = [0.0, 0.0, 0.0]
Ixx = 13000.0
Iyy = 24000.0
Izz = 35000.0
Ixz = 1000.0
"""
STATES = ("u", "v", "w", "phi", "theta", "psi", "north", "east", "altitude")
FREE = (*ATTAS_BIASES, "alpha_bias", "wind_north", "wind_east")

pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def records(measured):
    flight = flag_on_ground(as_flight(measured(CITATION)))
    return records_from_flight(flight, parse_vehicle(VEHICLE))


@pytest.fixture(scope="module")
def result(records):
    """The climb: six windows of a minute, in two winds (of its lower and its upper half)."""
    sizes = {f"initial_{name}": 10 * parameter(f"initial_{name}").size for name in STATES}
    return reconstruct(records[2:8], FREE, initial=STATES, priors=sizes)


def test_the_whole_flight_in_the_air_is_taken_in_windows(records):
    assert len(records) == pytest.approx(70, abs=3)
    assert all(np.nanmin(record.outputs["V"]) > 30.0 for record in records[1:-1])
    assert sum(len(record.inputs) for record in records) * 0.1 == pytest.approx(4608 - 466, abs=30)
    assert not any({"beta", "psi"} & set(record.outputs) for record in records)


def test_windows_agree_with_air_data_attitude_and_position(result):
    """V within the limit of 2 % on qbar, alpha .5 deg, attitude .3 deg, position 10 m: all of them
    at once."""
    squares = {}
    for path in result.paths:
        for name, values in path.residuals.items():
            squares.setdefault(name, []).append(values**2)
    rms = {
        name: float(np.sqrt(np.nanmean(np.concatenate(parts)))) for name, parts in squares.items()
    }
    speed = np.mean([path.V.mean() for path in result.paths])
    assert rms["V"] < 0.01 * speed
    assert np.rad2deg(rms["alpha"]) < 0.3
    assert np.rad2deg(max(rms["phi"], rms["theta"])) < 0.3
    assert max(rms["north"], rms["east"]) < 3.0


def test_the_wind_is_a_wind(result):
    """The heading, which no channel shows, starts from the track: from half a turn off, the winds
    came out at 140 m/s."""
    winds = [entry for entry in result.estimates if entry.parameter.kind == "wind"]
    assert len(winds) == 4
    assert all(abs(entry.value) < 40.0 for entry in winds)
    upper = [entry for entry in winds if entry.parameter.scope.endswith("#2")]
    assert np.hypot(*(entry.value for entry in upper)) == pytest.approx(23.0, abs=3.0)
    assert max(entry.standard_error for entry in upper) < 0.6


def test_first_heading_comes_from_the_track(records):
    """Within 20 deg of the heading that flies from the first position to that of ten seconds later
    (the rest is drift)."""
    for record in records[2:8]:
        east, north = (
            record.outputs[name][100] - record.outputs[name][0] for name in ("east", "north")
        )
        error = np.angle(np.exp(1j * (first_states(record)[5] - np.arctan2(east, north))))
        assert abs(np.rad2deg(error)) < 20.0


def test_no_sideslip_is_invented(result):
    """It is an integral of accelerations and what airspeed and wind say of it: no window knows it
    better than a poor vane, some not at all. Its mean is not asserted: in steady wind shear counts
    as sideslip, which the standard error cannot know (one window of the climb comes out at 4.4 of
    them). So no flight is given it: see test_consistency_flow.
    """
    sigma = np.array([np.rad2deg(path.air_sigma[2].mean()) for path in result.paths])
    assert "beta" not in result.noise
    assert sigma.min() > 0.15
    assert np.median(sigma) > 0.3
    assert sigma.max() > 2.0
