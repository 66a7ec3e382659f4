"""Airspeed against speed over ground: flights in turns, with winds that change as winds do."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.physics import standard_atmosphere
from aerodb.suspicions.over_ground import over_ground_suspicions
from aerodb.suspicions.plausibility import suspicions

TIME = np.arange(0.0, 400.0, 0.1)


def racetrack(time: np.ndarray) -> np.ndarray:
    """Heading [rad]: legs of 40 s, and turns of half a circle in 20 s."""
    within = time % 60.0
    return np.pi * (time // 60.0 + np.clip((within - 40.0) / 20.0, 0.0, 1.0))


def flown(
    heading: np.ndarray,
    seed: int = 0,
    speed: float = 18.0,
    wind: tuple[float, float] = (6.0, -3.0),
    gusts: float = 1.0,
    climb: float = 0.0,
    shear: float = 0.0,
    veer: float = 0.0,
    shown: Callable[[np.ndarray], np.ndarray] = lambda true: true,
) -> Flight:
    """A flight with a wind (north, east) [m/s], gusts of 5 s [m/s rms], a climb [m/s], a shear [1/s]
    of wind with height, and a wind that veers [rad] over it. shown : airspeed that is logged."""
    rng = np.random.default_rng(seed)
    n = len(TIME)
    decay = np.exp(-0.1 / 5.0)
    noise = rng.normal(size=(3, n)) * gusts * np.sqrt(1.0 - decay**2)
    air = np.zeros((3, n))
    for k in range(1, n):
        air[:, k] = decay * air[:, k - 1] + noise[:, k]
    height = 100.0 + climb * TIME
    true = speed + 2.0 * np.sin(TIME / 7.0) + air[0]
    turned = veer * TIME / TIME[-1]
    strength = 1.0 + shear * (height - 100.0) / np.hypot(*wind)
    north = strength * (wind[0] * np.cos(turned) - wind[1] * np.sin(turned))
    east = strength * (wind[0] * np.sin(turned) + wind[1] * np.cos(turned))
    flat = np.sqrt(true**2 - climb**2)
    channels = {
        "V": shown(true) + 0.3 * rng.normal(size=n),
        "velocity_north": flat * np.cos(heading) + north + air[1] + 0.2 * rng.normal(size=n),
        "velocity_east": flat * np.sin(heading) + east + air[2] + 0.2 * rng.normal(size=n),
        "velocity_down": np.full(n, -climb),
        "altitude": height,
    }
    return Flight("turns", "glider", TIME, channels)


RIGHT = {
    "circles": {},
    "strong wind": {"wind": (12.0, 5.0)},
    "gusts": {"gusts": 2.5},
    "a tube that is 8 % off": {"shown": lambda true: 0.92 * true},
    "climb through shear": {"climb": 1.5, "shear": 0.01},
    "a wind that veers": {"veer": 0.7},
    "no wind": {"wind": (0.01, 0.0)},
}
TRACKS = {"circles": 0.15 * TIME, "racetrack": racetrack(TIME)}


@pytest.mark.parametrize("track", TRACKS)
@pytest.mark.parametrize("kind", RIGHT)
def test_right_airspeeds_raise_nothing(kind: str, track: str) -> None:
    for seed in range(5):
        assert over_ground_suspicions(flown(TRACKS[track], seed, **RIGHT[kind])) == ()


@pytest.mark.parametrize("track", TRACKS)
@pytest.mark.parametrize("kind", ["circles", "strong wind", "gusts", "climb through shear"])
@pytest.mark.parametrize("factor", [0.6, 1.7])
def test_a_wrong_scale_is_told(kind: str, track: str, factor: float) -> None:
    heading = TRACKS[track]
    for seed in range(3):
        flight = flown(heading, seed, **{**RIGHT[kind], "shown": lambda true: factor * true})
        (found,) = over_ground_suspicions(flight)
        assert found.channel == "V"
        assert found.evidence["ratio"] == pytest.approx(factor, rel=0.1)
        assert "the scale of its sensor, or its tube, is wrong" in found.sentence
        assert found in suspicions(flight)


def test_units_and_calibrated_airspeed_are_named() -> None:
    (knots,) = over_ground_suspicions(flown(TRACKS["circles"], shown=lambda true: true / 0.514444))
    assert knots.sentence.endswith("it may be in kt")
    flight = flown(TRACKS["circles"], speed=70.0, shown=lambda true: 0.7 * true)
    rho = float(standard_atmosphere(6700.0).density)
    (low,) = over_ground_suspicions(flight.with_channels({"rho": np.full(len(TIME), rho)}))
    assert low.sentence.endswith("it may be calibrated airspeed, not true airspeed")


def test_a_scale_that_goes_is_told_with_its_time() -> None:
    time = np.arange(0.0, 1200.0, 0.1)
    parts = [flown(TRACKS["circles"], seed) for seed in range(3)]
    channels = {
        name: np.concatenate([part[name] for part in parts]) for name in ("velocity_north",
        "velocity_east", "velocity_down", "altitude", "V")
    }  # fmt: skip
    channels["V"] = channels["V"] * np.where(time > 650.0, 0.6, 1.0)
    flight = Flight("turns", "glider", time, channels)
    (found,) = over_ground_suspicions(flight)
    assert "with a steady wind, from 903 to 1199 s: the scale" in found.sentence


def test_a_straight_flight_says_nothing() -> None:
    straight = np.full(len(TIME), 0.4) + 0.2 * np.sin(TIME / 20.0)
    assert over_ground_suspicions(flown(straight, shown=lambda true: 0.6 * true)) == ()
    there_and_back = np.where(TIME < 200.0, 0.4, 0.4 + np.pi)
    assert over_ground_suspicions(flown(there_and_back, shown=lambda true: 0.6 * true)) == ()
