"""Surfaces that change during a flight are told with the right one and its time; right flights raise
nothing (`python -m tests.campaigns.failing --surfaces` prints the table)."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.suspicions import against_vehicle
from aerodb.suspicions.changing import changing_suspicions
from aerodb.suspicions.equation_error import equation_errors
from aerodb.suspicions.surfaces import by_role
from tests.campaigns.corrupted import simulated
from tests.campaigns.corruptions import Pair
from tests.campaigns.failing import changed

KINDS = ("rudder reversed", "rudder x .4", "rudder held")


@pytest.fixture(scope="module")
def flight() -> Pair:
    """The example's first flight, with its roll to standstill."""
    return next(simulated(flights=1))


@pytest.mark.parametrize("kind", KINDS)
def test_a_surface_that_changes_is_told_with_its_time(flight: Pair, kind: str) -> None:
    with np.errstate(all="ignore"):
        made = changed(flight, kind)
    assert made is not None
    differs = made.flight["delta_rudder"] != flight.flight["delta_rudder"]
    begin = float(flight.flight.time[np.argmax(differs)])
    (said,) = (
        each
        for each in against_vehicle(made.flight, made.vehicle)
        if each.channel == "delta_rudder"
    )
    assert said.kind == ("stuck" if kind == "rudder held" else "changed")
    assert said.evidence["from"] == pytest.approx(begin, abs=0.25 * flight.flight.duration)
    if kind == "rudder reversed":
        assert said.evidence["ratio"] == pytest.approx(-1.0, abs=0.3)
    elif kind == "rudder x .4":  # less deflection is logged: each radian does more
        assert said.evidence["ratio"] == pytest.approx(2.5, abs=0.6)


def test_a_right_flight_raises_nothing(flight: Pair) -> None:
    assert against_vehicle(flight.flight, flight.vehicle) == ()


def test_a_flight_with_an_inertia_that_is_no_number_raises_no_error(flight: Pair) -> None:
    """What is not finite is another check's to say: nothing is concluded of the surfaces."""
    controls = by_role(flight.flight, flight.vehicle, ())
    with np.errstate(all="ignore"):
        axes = equation_errors(flight.flight, flight.vehicle, controls)
        broken = {
            role: replace(axis, moment=np.full_like(axis.moment, np.nan))
            for role, axis in axes.items()
        }
        assert changing_suspicions(flight.flight, broken, controls) == []
