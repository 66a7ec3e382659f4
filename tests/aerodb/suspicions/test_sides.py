"""The two sides of elevons against each other, on a flight in closed form whose sides act alike."""

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.suspicions import against_vehicle, limits_flight
from aerodb.vehicle import Vehicle, add_combinations, parse_vehicle
from tests.aerodb.suspicions.test_against_vehicle import VEHICLE, flown

RIGHT, LEFT = "delta_elevon_right", "delta_elevon_left"
ELEVONS = (
    VEHICLE.replace("surfaces.elevator", "surfaces.elevon_right").replace(
        "surfaces.aileron", "surfaces.elevon_left"
    )
    + """
[combinations.elevator]
kind = "symmetric"
right = "elevon_right"
left = "elevon_left"
[combinations.aileron]
kind = "asymmetric"
right = "elevon_right"
left = "elevon_left"
"""
)


def vehicle() -> Vehicle:
    return parse_vehicle(ELEVONS)


def with_elevons(**changed: np.ndarray) -> Flight:
    """The flight of the other checks, its elevator and aileron moved by two elevons."""
    flight = flown()
    symmetric, apart = flight["delta_elevator"], flight["delta_aileron"]
    sides = {RIGHT: symmetric + apart, LEFT: symmetric - apart}
    channels = {
        n: flight[n] for n in flight.channels if n not in ("delta_elevator", "delta_aileron")
    }
    plain = Flight("light-2", "light", flight.time, {**channels, **sides})
    made = {name: np.asarray(values) for name, values in changed.items()}
    return add_combinations(plain.with_channels(made), vehicle())


def test_right_sides_raise_nothing() -> None:
    assert against_vehicle(with_elevons(), vehicle()) == ()


@pytest.mark.parametrize("side", [RIGHT, LEFT])
def test_a_side_that_was_not_recorded(side: str) -> None:
    time = flown().time
    found = against_vehicle(with_elevons(**{side: np.full_like(time, 0.03)}), vehicle())
    assert (side, "stuck") in {(each.channel, each.kind) for each in found}


@pytest.mark.parametrize("side", [RIGHT, LEFT])
def test_a_side_in_another_unit_or_of_another_surface(side: str) -> None:
    """Converted from degrees twice; and exchanged with the rudder."""
    right = with_elevons()
    exchanged = {side: right["delta_rudder"], "delta_rudder": right[side]}
    for wrong in ({side: np.deg2rad(right[side])}, exchanged):
        found = against_vehicle(with_elevons(**wrong), vehicle())
        mirrored = [each for each in found if "mirror image" in each.sentence]
        assert {each.channel for each in mirrored} <= {RIGHT, LEFT}
        assert len(mirrored) == 1
        assert limits_flight(mirrored[0])


def test_a_field_mapped_twice() -> None:
    right = with_elevons()
    found = against_vehicle(with_elevons(delta_rudder=right[LEFT]), vehicle())
    assert ("delta_rudder", "swapped") in {(each.channel, each.kind) for each in found}


def test_sides_that_move_in_opposite_directions_only_are_not_told_apart() -> None:
    flight = flown()
    apart = flight["delta_aileron"]
    ailerons = VEHICLE.replace("surfaces.aileron", "surfaces.aileron_right") + (
        '[surfaces.aileron_left]\nlimits = ["-25 deg", "25 deg"]\n'
    )
    channels = {n: flight[n] for n in flight.channels if n != "delta_aileron"}
    rng = np.random.default_rng(8)
    sides = {
        "delta_aileron_right": apart + 1e-3 * rng.standard_normal(len(apart)),
        "delta_aileron_left": -0.4 * apart + 1e-3 * rng.standard_normal(len(apart)),
    }
    made = Flight("light-3", "light", flight.time, {**channels, **sides})
    found = against_vehicle(made, parse_vehicle(ailerons))
    assert not [each for each in found if "mirror image" in each.sentence]
