"""Sensors that drift or jump in flight and go on: told with what the rest of the motion says."""

import numpy as np
import pytest

from aerodb.conditioning import failures, flag_unusable
from aerodb.flight import Flight
from tests.aerodb.conditioning.test_failures import straight


def _drifting() -> Flight:
    """Level flight, in which the altitude drifts by 120 m from 50 s on."""
    right = straight()
    return straight(altitude=right["altitude"] + np.interp(right.time, [50.0, 100.0], [0.0, 120.0]))


def test_an_altitude_that_drifts_is_left_out_from_there_on() -> None:
    flight = _drifting()
    (found,) = failures(flight)
    assert (found.channel, found.kind) == ("altitude", "drifted")
    assert found.start == pytest.approx(50.0, abs=5.0)
    assert found.value == pytest.approx(120.0, rel=0.15)
    assert found.reason.startswith("it drifts by 1.2e+02 m: the changes of altitude")
    usable = flight.usable(["altitude"])
    assert usable[flight.time < 45.0].all()
    assert not usable[flight.time > 55.0].any()
    assert flight.usable(["V", "theta", "az"]).all()


def test_without_a_velocity_the_air_may_rise_instead() -> None:
    drifting = _drifting()
    bare = {
        name: values
        for name, values in drifting.channels.items()
        if not name.startswith("velocity")
    }
    assert failures(flag_unusable(Flight("a", "any", drifting.time, bare))) == ()


def test_an_attitude_that_jumps_is_told_beside_the_rates() -> None:
    right = straight()
    jumped = np.where(right.time > 50.0, 0.15, 0.0)  # rad
    (found,) = failures(straight(theta=right["theta"] + jumped))
    assert (found.channel, found.kind) == ("theta", "drifted")
    assert found.start == pytest.approx(50.0, abs=0.1)
    assert found.reason.startswith("it jumps by 8.")


def test_level_flight_raises_nothing() -> None:
    assert failures(straight()) == ()
