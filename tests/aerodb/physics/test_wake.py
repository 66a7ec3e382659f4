"""A vortex pair against closed forms, and what an aircraft feels of it against 200 strips."""

import numpy as np
import pytest

from aerodb.physics import CORES, Core, VortexPair, air_at_stations, quaternion_from_euler

G, RC, B = 220.0, 1.2, 17.0


def _pair(core: Core, spacing: float = B, heading: float = 0.0) -> VortexPair:
    return VortexPair(G, RC, spacing, (100.0, 50.0, 1000.0), heading, 0.0, core)


@pytest.mark.parametrize("core", CORES)
def test_one_vortex_has_its_published_profile(core: Core) -> None:
    """With the other 1e6 m away: G/(2 pi r)(1 - exp(-1.2544 r^2/rc^2)), or r/(rc^2 + r^2)."""
    pair = _pair(core, spacing=1e6)
    r = np.array([0.2, 0.6, 1.2, 2.4, 12.0])
    points = np.stack([np.full(5, 100.0), 50.0 + 5e5 + r, np.full(5, 1000.0)])
    law = {
        "lamb_oseen": G / (2 * np.pi * r) * (1 - np.exp(-1.2544 * (r / RC) ** 2)),
        "burnham_hallock": G / (2 * np.pi) * r / (RC**2 + r**2),
    }[core]
    north, east, down = pair.velocity(points)
    assert np.abs(north).max() < 1e-12
    assert np.abs(east).max() < 1e-3
    np.testing.assert_allclose(-down, law, rtol=1e-4, atol=1e-4)  # outside it goes up
    fine = np.linspace(0.3, 4.0, 2000)
    swirl = -pair.velocity(np.stack([0 * fine, 50.0 + 5e5 + fine, 0 * fine + 1000.0]))[2]
    assert fine[np.argmax(swirl)] == pytest.approx(RC, rel=0.01)


@pytest.mark.parametrize("core", CORES)
def test_between_them_the_air_sinks_and_round_one_the_circulation_is_that_of_the_pair(
    core: Core,
) -> None:
    pair = _pair(core, heading=0.7)
    middle = pair.velocity(np.array(pair.place)[:, None])[:, 0]
    assert middle[2] == pytest.approx(G / (np.pi * B / 2), rel=0.05)
    # Round the right vortex, seen from behind, the air turns against the clock.
    angle = np.linspace(0, 2 * np.pi, 4001)
    right = np.array([-np.sin(0.7), np.cos(0.7), 0.0])
    ring = 0.5 * B * right[:, None] + 4.0 * (
        right[:, None] * np.cos(angle) + np.array([0, 0, 1.0])[:, None] * np.sin(angle)
    )
    velocity = pair.velocity(np.array(pair.place)[:, None] + ring)
    velocity[2] *= -1.0
    along = np.gradient(ring, axis=1)
    share = 16 / (16 + RC**2) if core == "burnham_hallock" else 1.0
    assert np.sum(velocity * along) == pytest.approx(G * share, rel=0.01)


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("offset", [-8.5, -3.0, 0.0, 6.0, 12.0])
def test_stations_roll_an_aircraft_as_200_strips_do(core: Core, offset: float) -> None:
    """An elliptic wing of 200 strips of 2D lift slope, summed here, in a formation 1 m above the
    pair: mean down velocity and rolling moment over that of a roll rate."""
    pair = _pair(core)
    span = 12.0
    place = np.array([[100.0], [50.0 + offset], [1001.0]])
    level = quaternion_from_euler(*(np.zeros(1) for _ in range(3)))
    felt = air_at_stations(pair, place, level, span)
    y = (np.arange(200) + 0.5) / 200 * span - span / 2
    chord = np.sqrt(1 - (2 * y / span) ** 2)
    w = pair.velocity(np.stack([0 * y + 100.0, 50.0 + offset + y, 0 * y + 1001.0]))[2]
    mean = np.sum(chord * w) / np.sum(chord)
    roll = np.sum(chord * w * y) / np.sum(chord * y * y)
    assert felt["gust_w"][0] == pytest.approx(mean, abs=0.05 * G / (np.pi * B))
    assert felt["gust_p"][0] == pytest.approx(roll, abs=0.05 * G / (np.pi * B) / 3.0)
