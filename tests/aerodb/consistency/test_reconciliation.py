"""Tests that a channel which cannot be reconciled leaves the estimate, and only that one."""

import numpy as np
import pytest

from aerodb.consistency.whole_flight import make_consistent
from aerodb.flight import Flight
from aerodb.vehicle import parse_vehicle
from tests.support.consistent_flights import NAME, PLANTED, VEHICLE, exact, table

OVER_EARTH = ("velocity_north", "velocity_east", "velocity_down")


def _consistent(columns):
    channels = {name: values for name, values in columns.items() if name != "time"}
    return make_consistent(
        Flight("0" * 64, NAME, columns["time"], channels), parse_vehicle(VEHICLE)
    )


def _lie(time, size):
    """A drift with a swing [rad]: no noise averages to this."""
    return np.deg2rad(size) * (time / time[-1] + 0.5 * np.sin(0.4 * time))


def _estimates(found):
    return {
        entry["parameter"]: (entry["value"], entry["standard_error"])
        for entry in found.document["estimates"]
    }


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("without", [(), OVER_EARTH])
@pytest.mark.parametrize(("channel", "size"), [("psi", 12.0), ("theta", 4.0), ("beta", 6.0)])
def test_a_channel_that_lies_leaves_the_estimate(channel, size, without, seed):
    """A heading, a pitch attitude or a vane that drifts and swings: named with the size of its
    disagreement, and every bias of what is left within its interval."""
    columns = table(seed, without=without)
    columns[channel] = columns[channel] + _lie(columns["time"], size)
    found = _consistent(columns)
    assert list(found.document["left_out"]) == [channel]
    assert found.verdict.word == "limited"
    (reason,) = found.verdict.reasons
    assert reason.startswith(f"{channel} has left the estimate: it disagrees with the motion")
    assert "deg (rms; limit" in reason
    estimates = _estimates(found)
    assert not [name for name in estimates if name.startswith(f"{channel}_")]
    for name, (value, error) in estimates.items():
        assert abs(value - PLANTED.get(name, 0.0)) < 3.5 * error, name


def test_its_values_come_from_the_motion_where_that_determines_them():
    """With velocity over the earth the motion knows the heading better than a compass that swings
    by 12 deg."""
    columns = table()
    columns["psi"] = columns["psi"] + _lie(columns["time"], 12.0)
    found = _consistent(columns)
    assert found.document["used"]["psi"] == "smoothed: motion without its sensor"
    error = found.flight["psi"] - exact(columns)["psi"]
    assert np.sqrt(np.mean(error**2)) < 3 * np.sqrt(np.mean(found.sigma["psi"] ** 2))
    assert np.sqrt(np.mean(error**2)) < np.deg2rad(1.0)


@pytest.mark.parametrize("seed", range(1, 7))
@pytest.mark.parametrize("without", [(), OVER_EARTH])
def test_channels_that_agree_stay(seed, without):
    found = _consistent(table(seed, without=without))
    assert found.document["left_out"] == {}
    assert found.verdict.word == "good", found.verdict.reasons


def test_a_rate_that_is_wrong_is_not_blamed_on_the_attitude():
    """A yaw gyro that shows half the rate puts two attitude angles off: nothing leaves."""
    columns = table(planted={})
    columns["r"] = 0.5 * columns["r"]
    columns["q"] = 0.5 * columns["q"]
    found = _consistent(columns)
    assert found.document["left_out"] == {}
    assert found.verdict.word == "rejected"
