"""Segments of measured flights against what was logged and published about them, shapes made by
hand, and a steady flight."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from aerodb.conditioning.manoeuvres import inputs, rank_correlation
from aerodb.conditioning.segmentation import (
    Segment,
    configurations,
    flag_on_ground,
    ground_and_air,
    manoeuvres,
    segments,
)
from aerodb.flight import Flight
from tests.support.kinematic_flights import GRAVITY
from tests.support.measured_flights import ATTAS, CITATION, HFB320, STALLS, TWIN_OTTER, as_flight

DEGREE = np.pi / 180
STEP = 0.04


@pytest.mark.parametrize("kinds", [2, 5, 1000])
def test_the_rank_correlation_is_that_of_scipy(kinds: int) -> None:
    values = np.random.default_rng(kinds).integers(kinds, size=40).astype(float)
    expected = spearmanr(np.arange(40), values).statistic
    assert rank_correlation(values) == pytest.approx(expected, abs=1e-12)
    assert rank_correlation(np.ones(5)) == 0.0


def steps(*parts: tuple[float, float], rest: float = 6.0) -> np.ndarray:
    """A surface [rad] at trim 0.02, deflected by (degrees, seconds) one after the other, at rest
    before and after."""
    sequence = [(0.0, rest), *parts, (0.0, rest)]
    return 0.02 + np.concatenate(
        [np.full(round(seconds / STEP), size * DEGREE) for size, seconds in sequence]
    )


def quiet(values: np.ndarray, seed: int = 0) -> np.ndarray:
    return values + 2e-4 * np.random.default_rng(seed).standard_normal(len(values))


def steady_flight(seed: int, seconds: float = 120.0) -> Flight:
    """Straight and level with sensor noise; all surfaces at trim."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP)
    noise = {
        "V": 0.1,
        "alpha": 1e-3,
        "beta": 1e-3,
        "theta": 5e-4,
        "phi": 5e-4,
        "az": 0.05,
        "qbar": 10.0,
        "p": 1e-3,
        "q": 1e-3,
    }
    level = {
        "V": 80.0,
        "alpha": 0.06,
        "theta": 0.06,
        "az": -GRAVITY,
        "qbar": 3500.0,
        "altitude": 1500.0,
        "delta_elevator": -0.03,
    }
    noise |= {
        "r": 1e-3,
        "altitude": 0.3,
        "delta_elevator": 2e-4,
        "delta_aileron": 2e-4,
        "delta_rudder": 2e-4,
    }
    channels = {
        name: level.get(name, 0.0) + size * rng.standard_normal(n) for name, size in noise.items()
    }
    return Flight("steady", "synthetic", STEP * np.arange(n), channels)


def of_kind(found: tuple[Segment, ...], kind: str, channel: str = "") -> list[Segment]:
    return [
        segment for segment in found if segment.kind == kind and channel in ("", segment.channel)
    ]


def off(segment: Segment, logged: float) -> float:
    """Seconds from a logged time to the segment; 0 inside."""
    return max(segment.start - logged, logged - segment.end, 0.0)


@pytest.mark.parametrize(
    ("record", "kind", "channel", "start"),
    [
        (ATTAS[0], "3-2-1-1", "delta_elevator", 5.2),
        (ATTAS[1], "1-2-1", "delta_aileron", 55.3),
        (ATTAS[2], "doublet", "delta_rudder", 115.7),
        (HFB320, "3-2-1-1", "delta_elevator", 4.2),
        (TWIN_OTTER[0], "2-1-1", "delta_rudder", 54815.6),
        (TWIN_OTTER[0], "doublet", "delta_aileron", 54821.2),
        (TWIN_OTTER[1], "doublet", "delta_elevator", 3.2),
        (TWIN_OTTER[2], "3-2-1-1", "delta_elevator", 53550.5),
    ],
)
def test_published_manoeuvres_are_recognised(
    measured: Callable[[str], Path], record: str, kind: str, channel: str, start: float
) -> None:
    found = of_kind(manoeuvres(as_flight(measured(record))), kind, channel)
    assert [segment.start for segment in found] == [pytest.approx(start, abs=0.3)]


@pytest.mark.parametrize(
    ("record", "between"), [(STALLS[0], (84.0, 90.0)), (STALLS[1], (60.0, 67.0))]
)
def test_measured_stalls(
    measured: Callable[[str], Path], record: str, between: tuple[float, float]
) -> None:
    found = segments(as_flight(measured(record)))
    (stall,) = of_kind(found, "stall")
    assert between[0] < stall.start < stall.end < between[1]
    assert not of_kind(found, "on_ground")


@pytest.fixture(scope="module")
def citation(measured: Callable[[str], Path]) -> tuple[Segment, ...]:
    return segments(as_flight(measured(CITATION)))


def test_citation_leaves_the_ground_once(citation: tuple[Segment, ...]) -> None:
    down, up = of_kind(citation, "on_ground"), of_kind(citation, "airborne")
    assert (len(down), len(up)) == (2, 1)
    assert up[0].start == pytest.approx(466.0, abs=10.0)
    assert up[0].end == pytest.approx(4608.0, abs=10.0)


@pytest.mark.parametrize(
    ("logged", "kind", "channel"),
    [
        (51 * 60 + 13, "step", "delta_aileron"),  # aperiodic roll
        (52 * 60 + 3, "step", "delta_elevator"),  # short period
        (53 * 60 + 25, "slow_oscillation", ""),  # phugoid
        (56 * 60 + 14, "doublet", "delta_rudder"),  # Dutch roll
        (61 * 60 + 10, "spiral", ""),
        (3884, "low_g", ""),
        (3884, "pull_up", ""),
        (2242, "stall", ""),
    ],
)
def test_citation_events_start_within_20_s_of_what_was_logged_by_hand(
    citation: tuple[Segment, ...], logged: float, kind: str, channel: str
) -> None:
    assert min(abs(segment.start - logged) for segment in of_kind(citation, kind, channel)) < 20.0


def test_citation_extremes_have_the_logged_size(citation: tuple[Segment, ...]) -> None:
    pull_up = min(of_kind(citation, "pull_up"), key=lambda segment: off(segment, 3884))
    assert pull_up.reason == "load factor up to 2.36"
    low = min(of_kind(citation, "low_g"), key=lambda segment: off(segment, 3890))
    assert 3880 < low.start < low.end < 3904
    assert len(of_kind(citation, "stall")) == 1
    # Its steady points, flown for lift and drag between 1450 and 2230 s, are steady; the turbulent
    # approach is not.
    steady = of_kind(citation, "steady")
    assert (
        sum(segment.end - segment.start for segment in steady if 1440 < segment.start < 2240)
        > 400.0
    )
    assert not [segment for segment in steady if segment.start > 4350]


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("pulse", [(2, 1.0)]),
        ("step", [(2, 4.5)]),
        ("doublet", [(2, 1.0), (-2, 1.2)]),
        ("2-1-1", [(2, 2.0), (-2, 1.0), (2, 1.0)]),
        ("1-2-1", [(2, 1.0), (-2, 2.0), (2, 1.0)]),
        ("3-2-1-1", [(-3, 2.1), (3, 1.4), (-3, 0.7), (3, 0.7)]),
        ("multistep", [(2, 0.5), (-2, 2.5), (2, 0.4)]),
    ],
)
def test_shapes_made_by_hand(name: str, parts: list[tuple[float, float]]) -> None:
    (found,) = inputs(quiet(steps(*parts)), STEP)
    assert found.name == name
    assert found.durations == pytest.approx([seconds for _, seconds in parts], abs=2 * STEP)
    assert found.deflection == pytest.approx(parts[0][0] * DEGREE, abs=1e-3)
    assert found.first * STEP == pytest.approx(6.0, abs=0.5)


def test_sweep() -> None:
    time = np.arange(0.0, 30.0, STEP)
    chirp = 2.0 * DEGREE * np.sin(2 * np.pi * (0.15 * time + 0.5 * 0.05 * time**2))
    (found,) = inputs(quiet(np.concatenate([np.zeros(200), chirp, np.zeros(200)])), STEP)
    assert found.name == "sweep"
    assert (found.first * STEP, found.last * STEP) == (
        pytest.approx(8.0, abs=1.0),
        pytest.approx(38.0, abs=1.0),
    )


def test_a_steady_flight_has_no_manoeuvre() -> None:
    for seed in range(10):
        found = segments(steady_flight(seed))
        assert {segment.kind for segment in found} == {"airborne", "steady"}
        (steady,) = of_kind(found, "steady")
        assert steady.end - steady.start > 115.0


def test_a_busy_surface_hides_small_inputs_but_not_large_ones() -> None:
    rng = np.random.default_rng(3)
    busy = (
        1.0
        * DEGREE
        * np.convolve(rng.standard_normal(6000), np.ones(10) / np.sqrt(10), mode="same")
    )
    assert inputs(busy, STEP) == ()


def test_phugoid_of_known_period_and_no_other() -> None:
    flight = steady_flight(4, 200.0)
    period = np.sqrt(2) * np.pi * 80.0 / GRAVITY
    swing = 4.0 * np.exp(-0.003 * flight.time) * np.sin(2 * np.pi * flight.time / period)
    exchange = {"V": flight["V"] + swing, "altitude": flight["altitude"] - 80.0 / GRAVITY * swing}
    (found,) = of_kind(segments(flight.with_channels(exchange)), "slow_oscillation")
    assert "in 3" in found.reason
    # The same swing of speed at constant height is a throttle, not a phugoid.
    assert not of_kind(
        segments(flight.with_channels({"V": flight["V"] + swing})), "slow_oscillation"
    )


def test_configuration_positions_and_moves() -> None:
    flight = steady_flight(5)
    gear = np.interp(flight.time, [30.0, 36.0], [0.0, 1.0])
    flap = DEGREE * np.interp(flight.time, [50.0, 55.0, 80.0, 84.0], [0.0, 15.0, 15.0, 0.0])
    found = configurations(flight.with_channels({"delta_landing_gear": gear, "delta_flap": flap}))
    words = [segment.reason for segment in found if segment.channel == "delta_flap"]
    assert words == ["flap 0.0 deg", "flap moves", "flap 15.0 deg", "flap moves", "flap 0.0 deg"]
    down = next(segment for segment in found if segment.reason == "landing gear 1.00")
    assert (down.start, down.end) == (pytest.approx(36.0, abs=0.7), pytest.approx(flight.time[-1]))


def test_take_off_and_landing_at_different_heights() -> None:
    flight = steady_flight(6)
    time = flight.time
    speed = np.interp(time, [10.0, 25.0, 95.0, 110.0], [0.0, 60.0, 60.0, 5.0])
    altitude = np.interp(time, [25.0, 50.0, 60.0, 95.0], [100.0, 700.0, 700.0, 300.0])
    flight = flight.with_channels({"V": speed, "altitude": altitude})
    found = ground_and_air(flight)
    assert [segment.kind for segment in found] == ["on_ground", "airborne", "on_ground"]
    assert found[1].start == pytest.approx(25.0, abs=1.0)
    assert found[1].end == pytest.approx(95.0, abs=1.0)
    usable = time[flag_on_ground(flight).usable()]
    assert (usable[0], usable[-1]) == (pytest.approx(found[1].start), pytest.approx(found[1].end))
    assert flag_on_ground(steady_flight(6)).flags == {}


@pytest.mark.parametrize("slope", [-0.015, 0.015])
def test_a_runway_that_climbs_is_ground_where_the_height_above_it_is_known(slope: float) -> None:
    """Touch-down at 50 m/s, 1,125 m of roll over 17 m of height. Without a height above ground it
    is told from the altitude alone, as before; a gauge that stands keeps no climb on the ground."""
    flight = steady_flight(6)
    time = flight.time
    speed = np.interp(time, [60.0, 105.0], [50.0, 0.0])
    way = np.cumsum(speed) * STEP
    above = np.interp(time, [0.0, 60.0], [150.0, 0.0])
    down = np.searchsorted(time, 60.0)
    climb = 400.0 + above + slope * (way - way[down])
    rolled = flight.with_channels(
        {"V": speed, "altitude": climb, "height_above_ground": above, "velocity_down": 0.0 * time}
    )
    (air, ground) = ground_and_air(rolled)
    assert (air.kind, ground.kind) == ("airborne", "on_ground")
    assert ground.start == pytest.approx(60.0, abs=2.0)
    hidden = {name: rolled[name] for name in rolled.channels if name != "height_above_ground"}
    assert ground_and_air(replace(rolled, channels=hidden))[1].start > 70.0
    stands = rolled.with_channels({"height_above_ground": 0.0 * time})
    assert ground_and_air(stands)[1].start == pytest.approx(60.0, abs=6.0)


def test_records_that_tell_little_give_little() -> None:
    flight = steady_flight(7)
    bare = replace(flight, channels={"q": flight["q"]})
    assert segments(bare) == ()
    short = Flight(
        "s", "synthetic", np.array([0.0, STEP]), {"V": np.array([50.0, 50.0]), "theta": np.zeros(2)}
    )
    assert [segment.kind for segment in segments(short)] == ["airborne"]


def test_rotors_that_turn_carry_a_hover() -> None:
    """Idle on the ground, 40 s of hover at no airspeed, idle again; without commands it never
    flew."""
    time = np.arange(0.0, 60.0, STEP)
    flying = (time > 10.0) & (time < 50.0)
    command = np.where(flying, 0.6, 0.1) + 0.02 * np.sin(time)
    still = {"V": 0.2 + 0.1 * np.sin(time), "p": 0.01 * np.cos(time)}
    plain = Flight("hover", "quad", time, still)
    assert {segment.kind for segment in ground_and_air(plain)} == {"on_ground"}
    commands = {f"command_{k}": command for k in range(1, 5)}
    found = ground_and_air(replace(plain, channels={**still, **commands}))
    assert [segment.kind for segment in found] == ["on_ground", "airborne", "on_ground"]
    assert (found[1].start, found[1].end) == pytest.approx((10.0, 50.0), abs=2 * STEP)
    idle = dict.fromkeys(commands, np.zeros(len(time)))
    assert {s.kind for s in ground_and_air(replace(plain, channels={**still, **idle}))} == {
        "on_ground"
    }


@pytest.mark.parametrize("ends", [11.0, 8.0, 1.0])
def test_a_roll_whose_log_ends_before_it_was_slow_for_long_is_ground(ends: float) -> None:
    """From 60 m/s with 5 m/s2, cut at a speed: it is slower than 30 % of it for less than 5 s. An
    airspeed that fails for as long at the end of a level flight is no roll."""
    time = np.arange(0.0, (60.0 - ends) / 5.0, STEP)
    noise = np.random.default_rng(4).normal(0.0, 0.3, len(time))
    flat = np.full(len(time), 0.5)
    for speed, kind in (
        (60.0 - 5.0 * time, "on_ground"),
        (np.where(60.0 - 5.0 * time < 18.0, 0.0, 60.0), "airborne"),
    ):
        channels = {"V": speed + noise, "altitude": flat, "height_above_ground": flat}
        found = ground_and_air(Flight("f", "v", time, channels))
        assert {each.kind for each in found} == {kind}
