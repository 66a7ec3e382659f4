"""Events of mass: point masses by hand, and flights that they do not belong to."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import mass_channels, parse_vehicle
from tests.support.three_wheels import VEHICLE

EVENT = """
[[mass.event]]
flight = "abcdef"
time = "2 s"
mass = "-198 kg"
position = [2.0, 0.5, -1.0]
"""


def points(masses: list[float], places: np.ndarray) -> dict[str, float]:
    """Mass, CG and inertia of point masses."""
    total = sum(masses)
    centre = np.average(places, axis=0, weights=masses)
    x, y, z = (places - centre).T
    m = np.array(masses)
    return {
        "mass": total, "cg_x": centre[0], "cg_y": centre[1], "cg_z": centre[2],
        "Ixx": m @ (y**2 + z**2), "Iyy": m @ (x**2 + z**2), "Izz": m @ (x**2 + y**2),
        "Ixz": m @ (x * z),
    }  # fmt: skip


def flown(name: str = "abcdef0123") -> Flight:
    return Flight(name, "wheels", np.arange(0.0, 4.0, 0.5), {})


def test_what_is_left_of_point_masses() -> None:
    rng = np.random.default_rng(38)
    places = rng.uniform(-2.0, 2.0, (6, 3))
    places[0] = (2.0, 0.5, -1.0)
    masses = [198.0, *rng.uniform(100.0, 300.0, 5)]
    whole, left = points(masses, places), points(masses[1:], places[1:])
    text = VEHICLE[: VEHICLE.index("mass = 1198.0")]
    text += "".join(f"{n} = {whole[n]:.17g}\n" for n in ("mass", "Ixx", "Iyy", "Izz", "Ixz"))
    text += f"cg = {[float(whole[f'cg_{axis}']) for axis in 'xyz']}\n{EVENT}"
    found = mass_channels(flown(), parse_vehicle(text))
    for name in whole:
        np.testing.assert_allclose(found[name], [whole[name]] * 4 + [left[name]] * 4, rtol=1e-12)


def test_what_comes_back_leaves_nothing_changed() -> None:
    back = EVENT.replace("2 s", "3 s").replace("-198 kg", "198 kg")
    vehicle = parse_vehicle(VEHICLE + EVENT + back)
    found, without = mass_channels(flown(), vehicle), mass_channels(flown(), parse_vehicle(VEHICLE))
    for name, values in without.items():
        np.testing.assert_allclose(found[name][6:], values[6:], atol=1e-9)
        assert name in ("mass", "Ixx", "Iyy", "Izz", "Ixz", "cg_x", "cg_y", "cg_z")
        assert found[name][5] != values[5]


def test_another_flight_has_no_event() -> None:
    found = mass_channels(flown("0123abcdef"), parse_vehicle(VEHICLE + EVENT))
    assert set(found["mass"]) == {1198.0}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"abcdef"', '"abc"', "flight"),
        ("-198 kg", "-198 m", "mass"),
        ("-198 kg", "-1300 kg", "more than"),
        ('source = "constant"', 'source = "channels"', "logged masses"),
    ],
)
def test_a_mistake_is_said(old: str, new: str, said: str) -> None:
    text = VEHICLE + EVENT
    assert old in text
    with pytest.raises(InputError, match=said):
        mass_channels(flown(), parse_vehicle(text.replace(old, new)))
