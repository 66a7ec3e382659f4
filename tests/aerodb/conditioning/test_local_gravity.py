"""Gravity where a flight took place: published values, free air, and logs that do not say where."""

import numpy as np
import pytest

from aerodb.conditioning.channel_rates import airspeed_rate, alpha_rate
from aerodb.conditioning.local_gravity import local_gravity


@pytest.mark.parametrize(
    ("latitude", "published"), [(0.0, 9.7803253359), (45.0, 9.8061977694), (90.0, 9.8321849378)]
)
def test_gravity_on_the_ellipsoid_is_that_of_wgs_84(latitude: float, published: float) -> None:
    """NIMA TR8350.2 (2000), tables 3.3 and 3.4, and Somigliana's formula at 45 deg."""
    place = {"latitude": np.full(9, np.deg2rad(latitude)), "longitude": np.full(9, 0.3)}
    assert local_gravity(place) == pytest.approx(published, abs=2e-9)
    assert local_gravity({**place, "latitude": -place["latitude"]}) == local_gravity(place)


def test_it_falls_with_height_by_the_free_air_gradient() -> None:
    """0.3086 mGal/m at 45 deg (Heiskanen & Moritz, Physical Geodesy, 1967, section 3-4), in
    either kind of altitude; lost samples do not count."""
    place = {"latitude": np.full(5, np.pi / 4), "longitude": np.ones(5)}
    height = np.array([900.0, 1000.0, np.nan, 1100.0, 1000.0])
    for name in ("altitude", "pressure_altitude"):
        fall = local_gravity(place) - local_gravity({**place, name: height})
        assert fall == pytest.approx(0.3086e-5 * 1000.0, rel=2e-3)


@pytest.mark.parametrize(
    "channels",
    [
        {},
        {"altitude": np.full(3, 5000.0)},
        {"latitude": np.full(3, np.nan), "longitude": np.zeros(3)},
        {"latitude": np.zeros(3), "longitude": np.zeros(3)},
        {"latitude": np.full(3, 51.0), "longitude": np.full(3, 0.2)},
    ],
)
def test_without_a_latitude_it_is_standard_gravity(channels: dict[str, np.ndarray]) -> None:
    """Not logged, lost, no fix, degrees."""
    assert local_gravity(channels) == 9.80665


def test_a_flight_along_the_equator_has_a_latitude() -> None:
    along = {"latitude": np.zeros(3), "longitude": np.array([0.0, 1e-5, 2e-5])}
    assert local_gravity(along) == pytest.approx(9.7803253359, abs=1e-9)


def test_kinematics_use_it() -> None:
    """Level flight in steady air: no rate where az holds the weight of the place."""
    level = {name: np.zeros(3) for name in ("alpha", "theta", "phi", "q", "ax")}
    level |= {"V": np.full(3, 50.0), "az": np.full(3, -9.7803253359)}
    place = {"latitude": np.full(3, 1e-9), "longitude": np.ones(3)}
    assert alpha_rate({**level, **place}) == pytest.approx(np.zeros(3), abs=1e-9)
    assert alpha_rate(level) == pytest.approx(np.full(3, 0.0263246641 / 50.0), abs=1e-9)
    climbing = {**level, **place, "theta": np.full(3, 0.1), "ax": 9.7803253359 * np.sin([0.1] * 3)}
    climbing["az"] = -9.7803253359 * np.cos(climbing["theta"])
    assert airspeed_rate(climbing) == pytest.approx(np.zeros(3), abs=1e-9)
