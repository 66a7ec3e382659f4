"""Sensors that fail in flight, beside what only looks like it: wind, landings, hover."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.conditioning import failures, flag_unusable, segments
from aerodb.flight import Flight
from aerodb.suspicions import examine
from aerodb.suspicions.failed import failed_suspicions
from tests.campaigns.rolls import LEVEL, TRUE, conditions, standing
from tests.support.kinematic_flights import GRAVITY
from tests.support.three_wheels import measured, rolled_in_jsbsim

STEP = 0.02


def straight(
    seconds: float = 100.0, speed: float = 20.0, wind: float = 0.0, **channels: np.ndarray
) -> Flight:
    """Level flight to the north, with a head wind [m/s]; noise of usual sensors."""
    rng, n = np.random.default_rng(1), round(seconds / STEP)
    time = STEP * np.arange(n)
    made = {
        "V": speed + 0.2 * rng.standard_normal(n),
        "velocity_north": speed - wind + 0.1 * rng.standard_normal(n),
        "velocity_east": 0.1 * rng.standard_normal(n),
        "velocity_down": 0.1 * rng.standard_normal(n),
        "altitude": 200.0 + 0.5 * rng.standard_normal(n),
        "ax": 0.1 * rng.standard_normal(n),
        "az": -GRAVITY + 0.1 * rng.standard_normal(n),
        "theta": 0.002 * rng.standard_normal(n),
        **{rate: 0.01 * rng.standard_normal(n) for rate in "pqr"},
    } | channels
    made["qbar"] = made.get("qbar", 0.6 * made["V"] ** 2)
    return flag_unusable(Flight("a", "any", time, made))


def test_a_record_that_stands_still_is_told_as_such() -> None:
    """Not as the failure of one of its sensors."""
    right = straight()
    held = (right.time >= 40.0) & (right.time < 43.0)
    channels = {
        name: np.where(held, values[np.argmax(held)], values)
        for name, values in right.channels.items()
    }
    made = Flight("a", "any", right.time, channels)
    flight = flag_unusable(made)
    (said,) = failed_suspicions(flight)
    assert said.sentence.startswith("the record failed from 40.0 to 43.0 s: every channel repeats")
    assert not flight.usable(["theta"])[held].any()
    assert failed_suspicions(right) == ()


def kinds(flight: Flight) -> dict[str, list[tuple[float, float]]]:
    found: dict[str, list[tuple[float, float]]] = {}
    for each in segments(flight):
        found.setdefault(each.kind, []).append((round(each.start, 1), round(each.end, 1)))
    return found


def test_a_pitot_that_fails_in_flight_is_no_landing() -> None:
    right = straight()
    shown = np.where(right.time < 40.0, right["V"], 0.3)
    flight = straight(V=shown)
    found = kinds(flight)
    assert "on_ground" not in found
    assert found["airborne"] == [(0.0, 100.0)]
    ((start, end),) = found["failed"]
    assert start == pytest.approx(40.0, abs=0.1)
    assert end == pytest.approx(100.0, abs=0.1)
    (said,) = failed_suspicions(flight)
    assert (said.channel, said.kind) == ("V", "failed")
    assert said.evidence["value"] == pytest.approx(0.3)
    assert said.evidence["beside"] == pytest.approx(20.0, abs=0.1)
    late = flight.time > 40.2
    assert not flight.usable(["V"])[late].any()
    assert not flight.usable(["qbar"])[late].any()
    assert flight.usable(["V"])[flight.time < 39.8].all()
    assert flight.usable(["altitude", "q"])[late].mean() > 0.95


@pytest.mark.parametrize("shown", [0.0, 1.5])
def test_a_tube_that_is_closed_from_the_start_is_no_ground(shown: float) -> None:
    noise = 0.1 * np.random.default_rng(2).standard_normal(round(100.0 / STEP))
    flight = straight(V=shown + noise)
    found = kinds(flight)
    assert found["failed"] == found["airborne"] == [(0.0, 100.0)]
    assert not flight.usable(["qbar"]).any()
    standing = straight(speed=3.0, V=shown + noise)
    assert set(kinds(standing)) == {"on_ground"}
    assert failed_suspicions(standing) == ()


def swinging(seed: int = 1, **channels: np.ndarray) -> Flight:
    """A flight of S-turns and slow climbs, whose angle of attack moves from 20 to 30 s; a factor
    (n,) of a channel is what its sensor loses."""
    rng, n = np.random.default_rng(seed), round(100.0 / STEP)
    t = STEP * np.arange(n)
    psi, climb = 0.4 * np.sin(0.06 * t), 0.05 * np.sin(0.25 * t)
    speed = 25.0 + 1.5 * np.cos(0.25 * t)
    phi = np.arctan(25.0 * np.gradient(psi, t) / GRAVITY)
    alpha = 0.06 + 0.01 * np.sin(0.25 * t) + 0.02 * np.sin(2 * t) * (t > 20) * (t < 30)
    theta = climb + alpha
    level = speed * np.cos(climb)
    right = {
        "V": speed,
        "alpha": alpha,
        "velocity_north": level * np.cos(psi),
        "velocity_east": level * np.sin(psi),
        "velocity_down": -speed * np.sin(climb),
        "altitude": 300.0 + np.cumsum(speed * np.sin(climb)) * STEP,
        **{"p": np.gradient(phi, t), "q": np.gradient(theta, t), "r": np.gradient(psi, t)},
        "ax": np.gradient(speed, t) + GRAVITY * np.sin(climb),
        "az": -GRAVITY * np.cos(climb) / np.cos(phi) - speed * np.gradient(climb, t),
        "beta": 0.01 * np.sin(0.5 * t),
        **{"ay": np.zeros(n), "phi": phi, "theta": theta, "psi": psi},
    }
    noise = {"V": 0.2, "altitude": 0.5, **dict.fromkeys("pqr", 0.01)}
    noise |= {**dict.fromkeys(("phi", "theta", "psi"), 0.002), "alpha": 0.003, "beta": 0.003}
    made = {
        name: (values + noise.get(name, 0.1) * rng.standard_normal(n)) * channels.get(name, 1.0)
        for name, values in right.items()
    }
    made["qbar"] = 0.6 * made["V"] ** 2
    return flag_unusable(Flight("a", "any", t, made))


def test_what_one_receiver_gives_fails_together() -> None:
    lost = np.where(np.arange(round(100.0 / STEP)) * STEP < 48.0, 1.0, 0.0)
    flight = swinging(velocity_north=lost, velocity_east=lost, velocity_down=lost)
    late = flight.time > 49.0
    for name in ("velocity_north", "velocity_east", "velocity_down"):
        assert not flight.usable([name])[late].any(), name
    assert flight.usable(["V", "altitude"])[late].mean() > 0.95
    assert failed_suspicions(swinging()) == ()


@pytest.mark.parametrize("seed", [19, 30, 34])
def test_a_rate_that_is_dead_accuses_no_vane(seed: int) -> None:
    dead = np.where(np.arange(round(100.0 / STEP)) * STEP < 33.0, 1.0, 0.0)
    said = examine(swinging(seed, q=dead)).suspicions
    assert {each.channel for each in said} == {"q"}


def test_without_speed_over_ground_the_accelerometer_tells() -> None:
    right = straight()
    flight = straight(V=np.where(right.time < 40.0, right["V"], 0.3))
    bare = {n: v for n, v in flight.channels.items() if not n.startswith("velocity")}
    flight = flag_unusable(Flight("a", "any", flight.time, bare))
    (found,) = failures(flight)
    assert (found.channel, found.kind) == ("V", "fallen")
    assert found.start == pytest.approx(40.0, abs=1.0)


@pytest.mark.parametrize("wind", [0.0, 15.0, -15.0])
def test_wind_is_no_failure(wind: float) -> None:
    flight = straight(wind=wind)
    assert failures(flight) == ()
    assert "on_ground" not in kinds(flight)


def stopped(flight: Flight, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Part of the speed left (n,), and forward acceleration per speed [1/s], of a stop at 60 s."""
    left = np.clip(1.0 - (flight.time - 60.0) / within, 0.0, 1.0)
    return left, np.gradient(left, STEP)


@pytest.mark.parametrize("within", [0.6, 12.0])
@pytest.mark.parametrize("over_ground", [True, False])
def test_a_landing_is_no_failure(within: float, over_ground: bool) -> None:
    """Into a net within .6 s, and on a runway."""
    right = straight()
    left, slowing = stopped(right, within)
    down = np.interp(right.time, [30.0, 59.0], [200.0, 0.0])
    flight = straight(
        V=right["V"] * left,
        ax=right["ax"] + 20.0 * slowing,
        velocity_north=right["velocity_north"] * left,
        velocity_down=-np.gradient(down, STEP),
        altitude=down,
    )
    if not over_ground:
        bare = {n: v for n, v in flight.channels.items() if not n.startswith("velocity")}
        flight = flag_unusable(Flight("a", "any", flight.time, bare))
    assert failures(flight) == ()
    ((start, end),) = kinds(flight)["on_ground"]
    assert 55.0 < start < 75.0
    assert end == pytest.approx(100.0, abs=0.1)


def test_a_landing_with_the_wind_is_no_failure() -> None:
    """6 m/s from behind: the airspeed is gone while the aircraft still rolls."""
    right = straight(wind=-6.0)
    left, slowing = stopped(right, 12.0)
    over_ground = right["velocity_north"] * left
    height = np.interp(right.time, [30.0, 59.0], [200.0, 0.0])
    flight = straight(
        V=np.maximum(over_ground - 6.0, 0.0),
        ax=right["ax"] + 26.0 * slowing,
        velocity_north=over_ground,
        velocity_down=-np.gradient(height, STEP),
        altitude=height,
    )
    assert failures(flight) == ()
    assert len(kinds(flight)["on_ground"]) == 1


def test_a_sensor_that_falls_silent_is_named_without_nan() -> None:
    right = straight()
    flight = straight(V=np.where(right.time < 40.0, right["V"], np.nan))
    (found,) = failures(flight)
    assert (found.channel, found.kind) == ("V", "silent")
    assert found.start == pytest.approx(40.0, abs=0.1)
    sentences = [each.sentence for each in examine(flight).suspicions]
    assert sentences
    assert not any("nan" in sentence for sentence in sentences)
    assert all(
        np.isfinite(list(each.evidence.values())).any() for each in failed_suspicions(flight)
    )


def test_an_altitude_that_stands_still_in_a_climb() -> None:
    right = straight()
    climb = 3.0 * right.time
    held = np.where(right.time < 50.0, 200.0 + climb, 350.0) + 0.3 * np.sin(right.time)
    flight = straight(altitude=held, velocity_down=right["velocity_down"] - 3.0)
    (found,) = failures(flight)
    assert (found.channel, found.kind) == ("altitude", "still")
    assert found.start == pytest.approx(50.0, abs=10.0)
    assert found.end == pytest.approx(100.0, abs=10.0)


def test_hover_is_a_segment_of_its_own_and_left_out() -> None:
    right = straight()
    rising = np.clip((right.time - 20.0) / 5.0, 0.0, 1.0)
    flight = straight(V=right["V"] * rising, velocity_north=right["velocity_north"] * rising)
    held = flight.time < 25.0
    flight = replace(flight, flags={}).with_flag("flight", "hover", held)
    flight = flag_unusable(flight)
    found = kinds(flight)
    assert found["hover"] == [(0.0, 25.0)]
    assert found["airborne"] == [(25.0, 100.0)]
    assert "on_ground" not in found
    assert not flight.usable()[held].any()
    assert failures(flight) == ()


def test_an_empty_and_a_short_flight_have_none() -> None:
    assert failures(straight(seconds=0.5)) == ()
    time = STEP * np.arange(50)
    assert failures(flag_unusable(Flight("a", "any", time, {"q": 0.0 * time}))) == ()


@pytest.mark.parametrize(("seed", "number"), [(1001, 0), (1001, 1), (1002, 0)])
def test_a_right_roll_on_the_ground_has_none_and_is_on_the_ground(seed: int, number: int) -> None:
    """Noise of the height accused the airspeed of the first by 101 m/s, where 53 m/s were shown."""
    pytest.importorskip("jsbsim")
    drawn = conditions(seed)[number]
    rolled = standing(rolled_in_jsbsim(TRUE["mu_brake"], height=LEVEL, **drawn))
    channels = measured(rolled, 2 * seed + number)
    time = channels.pop("time")
    flight = flag_unusable(Flight("roll", "wheels", time - time[0], channels))
    assert failures(flight) == ()
    assert {each.kind for each in segments(flight)} == {"on_ground"}
