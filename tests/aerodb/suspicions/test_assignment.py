"""Surfaces held against each other: exchanged fields, surfaces of another time, and fields mapped
twice; measured flights and flights in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.suspicions import against_vehicle, limits_flight
from aerodb.suspicions.assignment import UNRELATED, assignment_suspicions
from aerodb.suspicions.equation_error import EquationError
from aerodb.suspicions.plausibility import suspicions
from aerodb.suspicions.surfaces import Control
from tests.aerodb.suspicions.test_against_vehicle import flown, vehicle
from tests.campaigns.corrupted import measured as measured_pairs
from tests.campaigns.corrupted import noticed
from tests.campaigns.corruptions import Pair

LATERAL = ("delta_aileron", "delta_rudder")


@pytest.fixture(scope="module")
def flight() -> Flight:
    """All three controls move throughout, for 80 s: the flight of 16 s, flown anew each time."""
    parts = [flown(noise=1.0) for _ in range(5)]
    step = parts[0].step
    channels = {n: np.concatenate([part[n] for part in parts]) for n in parts[0].channels}
    time = step * np.arange(len(channels["q"]))
    return replace(parts[0], time=time, channels=channels, flags={})


def exchanged(flight: Flight, one: str, other: str) -> Flight:
    return flight.with_channels({one: flight[other], other: flight[one]})


@pytest.fixture
def records(measured: Callable[[str], Path]) -> list[Pair]:
    folder = measured("README.md").parent
    return [p for p in measured_pairs(folder) if "AilRud" in p.name or "f1_017" in p.name]


@pytest.mark.parametrize("other", LATERAL)
def test_an_elevator_exchanged_in_measured_flights(records: list[Pair], other: str) -> None:
    """Twin Otter and ATTAS: nothing is said of the flight itself."""
    for pair in records:
        assert noticed(pair) == ()
        names = ("delta_elevator", other)
        if "f1_017" not in pair.name or any(name not in pair.flight for name in names):
            continue
        (found,) = noticed(replace(pair, flight=exchanged(pair.flight, *names)))
        assert (found.channel, found.kind) == ("delta_elevator", "swapped")


@pytest.mark.parametrize("other", LATERAL)
def test_an_elevator_exchanged_names_both(flight: Flight, other: str) -> None:
    assert against_vehicle(flight, vehicle()) == ()
    (found,) = against_vehicle(exchanged(flight, "delta_elevator", other), vehicle())
    assert (found.channel, found.kind) == ("delta_elevator", "swapped")
    turns = {"delta_aileron": "rolls it", "delta_rudder": "yaws it"}
    assert f"delta_elevator {turns[other]}" in found.sentence
    assert f"{other} pitches it" in found.sentence


def test_three_fields_exchanged_in_a_ring(flight: Flight) -> None:
    names = ("delta_elevator", *LATERAL)
    turned = dict(zip(names, (flight[n] for n in (names[2], *names[:2])), strict=True))
    (found,) = against_vehicle(flight.with_channels(turned), vehicle())
    assert found.kind == "swapped"
    for told in ("delta_aileron pitches it", "delta_rudder rolls it", "delta_elevator yaws it"):
        assert told in found.sentence


def test_surfaces_of_another_time_explain_nothing(flight: Flight) -> None:
    late = round(3.0 / flight.step)
    moved = {n: np.roll(flight[n], late) for n in ("delta_elevator", *LATERAL)}
    (found,) = against_vehicle(flight.with_channels(moved), vehicle())
    assert found.kind == UNRELATED
    assert limits_flight(found)


def test_a_single_surface_of_another_time_is_no_other_flight(flight: Flight) -> None:
    late = round(3.0 / flight.step)
    moved = {"delta_rudder": np.roll(flight["delta_rudder"], late)}
    said = against_vehicle(flight.with_channels(moved), vehicle())
    assert UNRELATED not in {each.kind for each in said}


@pytest.mark.parametrize(("name", "source"), [("alpha", "theta"), ("beta", "phi"), ("p", "r")])
def test_a_field_mapped_twice_is_named(name: str, source: str) -> None:
    rng = np.random.default_rng(5)
    time = 0.02 * np.arange(2000)
    channels = {
        each: 0.1 * np.sin(rate * time + rate) + 1e-4 * rng.standard_normal(2000)
        for each, rate in (("alpha", 2.0), ("beta", 3.1), ("theta", 1.1), ("phi", 0.9))
    }
    channels |= {each: 0.2 * np.cos(rate * time) for each, rate in (("p", 1.3), ("r", 0.7))}
    channels |= {"q": 0.1 * np.sin(time), "V": np.full(2000, 30.0)}
    flight = Flight("f", "wing", time, channels, {})
    assert "copied" not in {each.kind for each in suspicions(flight)}
    said = suspicions(flight.with_channels({name: channels[source]}))
    assert [each.channel for each in said if each.kind == "copied"] == [name]
    assert source in next(each.sentence for each in said if each.kind == "copied")


def test_a_rest_that_lasts_is_no_exchange() -> None:
    """The elevator explains most of the pitching moment, and leaves slow air; the aileron, which
    moved alike, explains half as much, and leaves the elevator's fast share."""
    rng, n = np.random.default_rng(3), 1500
    step = 0.04
    time = step * np.arange(n)
    elevator, own = rng.standard_normal((2, n))
    aileron = 0.6 * elevator + 0.8 * own
    slow = 0.3 * np.sin(2.0 * np.pi * time / 20.0)
    moments = {"pitch": elevator + slow, "roll": elevator + 0.6 * aileron}
    histories = {"delta_elevator": elevator, "delta_aileron": aileron}
    axes = {
        role: EquationError(role, moment, {}, histories, np.ones(n, dtype=np.bool_), step, 1, {})
        for role, moment in moments.items()
    }
    roles = {"delta_elevator": "pitch", "delta_aileron": "roll"}
    controls = {n: Control(((n, 1.0),), role, role == "roll", True) for n, role in roles.items()}
    assert assignment_suspicions(axes, controls) == []
