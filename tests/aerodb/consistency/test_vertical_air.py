"""Tests of what rising and sinking air does to the alpha bias of a flight: NASA's Twin Otter first,
then planted air, then still air."""

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.consistency.output_error.estimation import (
    estimate_sensors,
    most_active,
    reconstruct_flight,
)
from aerodb.consistency.output_error.joint_calibration import joint_calibrations
from aerodb.consistency.output_error.vertical_air import Pull, air_information
from aerodb.consistency.plan import make_plan
from aerodb.consistency.records import records_from_flight
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import VerticalAir, parse_vehicle
from tests.support.consistency_records import TWIN_OTTER
from tests.support.consistent_flights import NAME, PLANTED, VEHICLE, table

SPEED, TIME = 60.0, 30.0
STILL = '\n[vertical_air]\nsigma = "0 m/s"\n'


def _vehicle(more: str = ""):
    return parse_vehicle(VEHICLE + more)


def _in_air(seed: int, sigma: float, bias: float, without: tuple[str, ...] = (), seconds=60.0):
    """A flight through air that moves up and down with a standard deviation `sigma` [m/s] and a time
    constant of 30 s: the motion over the earth is as it was, and the vane sees the air."""
    planted = {**PLANTED, "alpha_bias": bias, "alpha_delay": 0.0, "beta_bias": 0.0}
    columns = table(seed, planted=planted, seconds=seconds)
    down = sigma * _moving(seed, columns["time"])
    columns["alpha"] = columns["alpha"] - down * np.cos(columns["phi"]) / columns["V"]
    channels = {
        name: values for name, values in columns.items() if name != "time" and name not in without
    }
    return Flight(f"{seed:064d}", NAME, columns["time"], channels)


def _moving(seed: int, time: np.ndarray) -> np.ndarray:
    """White noise through two equal lags, of unit variance, long after its start."""
    keep = np.exp(-(time[1] - time[0]) / TIME)
    ahead = round(10 * TIME / (time[1] - time[0]))
    drive = np.random.default_rng(1000 + seed).standard_normal(ahead + len(time))
    moved = lfilter([1.0], [1.0, -2.0 * keep, keep**2], drive)[ahead:]
    return np.asarray(moved / np.sqrt((1.0 + keep**2) / (1.0 - keep**2) ** 3))


def _alpha_bias(flight, vehicle):
    records, own, plan = _own(flight, vehicle)
    return reconstruct_flight(records, own, plan, None).sensors.by_name["alpha_bias"]


def _reconstructed(flight, vehicle):
    return _own(flight, vehicle)[1]


def _own(flight, vehicle):
    records = records_from_flight(flight, vehicle, decimation=2)
    plan = make_plan(records, vehicle)
    return records, *estimate_sensors(most_active(records), plan, vehicle.accuracy)


def test_the_intervals_of_the_twin_otter_records_cover_their_scatter(measured):
    """f1_017 and demo are records of one vane and one week: -.6 and -.2 deg of alpha bias, with .8 and
    .7 deg (.25 and .03 deg in still air): their residuals say that the air moved by 1 m/s. 9752ed20
    is of another flight and configuration of the sensors."""
    found = {}
    for more in ({}, {"vertical_air": VerticalAir(sigma=0.0)}):
        vehicle = TWIN_OTTER.model_copy(update=more)
        for name in ("f1_017", "demo"):
            path = measured(f"twin_otter/totter_{name}_data.mat")
            flight = map_recording(
                read_log(path), load_mapping("sidpac_fdata"), vehicle, flight_id=name
            )
            found[name, bool(more)] = np.rad2deg(_alpha_bias(flight, vehicle))
    for name in ("f1_017", "demo"):
        assert found[name, False][1] > np.rad2deg(0.5 / 73.0) * 0.9
    assert found["demo", True][1] < 0.04
    apart = found["f1_017", False][0] - found["demo", False][0]
    both = np.hypot(found["f1_017", False][1], found["demo", False][1])
    assert abs(apart) < 1.5 * both


@pytest.mark.campaign
@pytest.mark.parametrize("bias", [0.0, 0.012])
def test_flights_in_rising_air_are_within_their_intervals(bias):
    """Sixteen flights of a minute with a standard deviation of .5 m/s, with a vane's bias and
    without. A minute shows the air's deviation with about three degrees of freedom, so that errors
    follow Student's distribution. In still air's errors most are beyond three."""
    vehicle, still = _vehicle(), _vehicle(STILL)
    apart, blind = [], []
    for seed in range(16):
        flight = _in_air(seed, 0.5, bias)
        for kept, how in ((apart, vehicle), (blind, still)):
            value, error = _alpha_bias(flight, how)
            kept.append(abs(value - bias) / error)
    assert np.sqrt(np.mean(np.square(apart))) < 1.5
    assert np.sum(np.array(apart) < 1.1) >= 8
    assert np.median(blind) > 3.0


def test_flights_of_one_installation_separate_the_vane_from_the_air():
    """The air of each flight is its own and the vane's bias is not: four flights halve the error,
    and the calibration holds the bias within it."""
    vehicle, bias = _vehicle(), 0.012
    flights = [_in_air(seed, 0.5, bias) for seed in range(4)]
    value, error = joint_calibrations(flights, vehicle)[-1].by_name["alpha_bias"]
    alone = np.mean([_alpha_bias(flight, vehicle)[1] for flight in flights])
    assert 0.3 * alone < error < 0.7 * alone
    assert abs(value - bias) < 2.5 * error


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_minute_of_still_air_says_that_it_was_still(seed):
    """The vane follows the motion for a minute: air that moved would have shown. The estimate is
    that of still air, and its error a fraction of what the prior would leave."""
    flight = _in_air(seed, 0.0, 0.012)
    value, error = _alpha_bias(flight, _vehicle())
    calm_value, calm_error = _alpha_bias(flight, _vehicle(STILL))
    assert abs(calm_value - 0.012) < 3 * calm_error
    assert calm_error < 0.001
    assert value == pytest.approx(calm_value, rel=0.12)
    assert abs(value - 0.012) < 3 * error
    assert calm_error < error < 0.3 * 0.5 / SPEED


def test_a_few_seconds_do_not_say_how_far_the_air_moves():
    """Six seconds in still air: what the vehicle file expects stands."""
    flight = _in_air(1, 0.0, 0.012, seconds=6.0)
    _, error = _alpha_bias(flight, _vehicle())
    assert 0.5 * 0.5 / SPEED < error < 0.5 / SPEED


@pytest.mark.campaign
def test_the_residuals_tell_how_far_the_air_moves():
    """The standard deviation follows the planted one, below and at what is expected: the median of
    eight flights is within a factor of 1.6. Beyond it, the prior holds it back a little. Still air
    is below .15 m/s."""
    vehicle = _vehicle()
    found = {
        sigma: [_reconstructed(_in_air(seed, sigma, 0.0), vehicle).air_sigma for seed in range(8)]
        for sigma in (0.0, 0.1, 0.5, 1.0)
    }
    assert max(found[0.0]) < 0.15
    for sigma in (0.1, 0.5):
        assert sigma / 1.6 < np.median(found[sigma]) < 1.6 * sigma
    assert 0.5 < np.median(found[1.0]) < 1.6


@pytest.mark.parametrize("seed", [1, 2])
def test_without_climb_rate_and_altitude_nothing_widens(seed):
    """The first vertical velocity takes the air up: what a flight tells of its vane then rests on
    other motion."""
    flight = _in_air(seed, 0.0, 0.012, without=("velocity_down",))
    error, calm = (_alpha_bias(flight, _vehicle(more))[1] for more in ("", STILL))
    assert error < 1.25 * calm


def test_the_recursive_sum_is_the_double_sum():
    """Three records with gaps, of one flight, and one of another; the autocovariance written out."""
    random, air, k = np.random.default_rng(0), VerticalAir(sigma=0.7, time=3.0), 4
    pulls, expected, begin = [], np.zeros((k, k)), 0.0
    times, rows = [], []
    for n, gap, index in ((30, 0.0, [0, 1]), (20, 1.3, [1, 2, 3]), (25, 0.2, [0, 3])):
        time = begin + gap + 0.1 * np.arange(n)
        part = random.standard_normal((n, len(index)))
        pulls.append(Pull("one", time[0], time[-1], 0.1, index, part))
        whole = np.zeros((n, k))
        whole[:, index] = part
        times, rows, begin = [*times, time], [*rows, whole], time[-1]
    time, row = np.concatenate(times), np.vstack(rows)
    apart = np.abs(time[:, None] - time) / air.time
    expected += row.T @ (0.49 * (1.0 + apart) * np.exp(-apart)) @ row
    other = random.standard_normal((10, k))
    apart = np.abs(np.subtract.outer(0.1 * np.arange(10), 0.1 * np.arange(10))) / air.time
    expected += other.T @ (0.49 * (1.0 + apart) * np.exp(-apart)) @ other
    pulls.insert(1, Pull("two", 0.0, 0.9, 0.1, range(k), other))
    np.testing.assert_allclose(air_information(pulls, air, k), expected, rtol=1e-10)


def test_the_recursive_sum_holds_for_flights_of_many_hours():
    """Twelve hours are 1,440 time constants: more than an exponential can hold."""
    random, air = np.random.default_rng(4), VerticalAir(sigma=0.7, time=30.0)
    row, step = random.standard_normal((720, 2)), 60.0
    apart = np.abs(np.subtract.outer(np.arange(720), np.arange(720))) * step / air.time
    expected = row.T @ (0.49 * (1.0 + apart) * np.exp(-apart)) @ row
    pulls = [Pull("one", 0.0, 719 * step, step, range(2), row)]
    np.testing.assert_allclose(air_information(pulls, air, 2), expected, rtol=1e-10)
