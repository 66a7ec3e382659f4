"""How a roll slows down, seen without its brakes: JSBSim's roll, and motions in closed form."""

from functools import lru_cache

import numpy as np
import pytest

from aerodb.identification import seen_rolls
from aerodb.physics import GRAVITY
from aerodb.support import Array
from tests.aerodb.identification.test_ground_roll import flight, rolled
from tests.support.three_wheels import MASSES, SPRING, measured, rolled_in_jsbsim

LEVEL = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
BRAKING_FROM = 8.0
#: Campaign: rolls of 3 m of noise, and the intervals of 95 % that may miss.
SEEDS, MISSED = 20, 3


@lru_cache(maxsize=1)
def jsbsim() -> dict[str, Array]:
    return rolled_in_jsbsim(0.22, (0.0, 3.0), LEVEL, braking_from=BRAKING_FROM)


def speed(channels: dict[str, Array], at: float) -> float:
    moving = np.hypot(channels["velocity_north"], channels["velocity_east"])
    return float(np.interp(at, channels["time"], moving))


def test_positions_of_3_m_tell_where_it_stands_and_when_it_brakes() -> None:
    """Each interval is of the phase as found, beside the speeds of the simulation at its ends."""
    pytest.importorskip("jsbsim")
    true = jsbsim()
    distance = float(np.hypot(np.ptp(true["north"]), np.ptp(true["east"])))
    missed = late = 0
    for seed in range(SEEDS):
        log = measured(true, seed)
        (roll,) = seen_rolls(flight({name: log[name] for name in log if name != "brake"}))
        assert roll.stands
        assert roll.distance == pytest.approx(distance, rel=0.003)
        assert roll.time == pytest.approx(true["time"][-1], abs=1.0)
        assert len(roll.phases) <= 2
        late += len(roll.phases) == 2 and abs(roll.phases[0].end - BRAKING_FROM) < 1.0
        for each in roll.phases[:1]:
            known = (speed(true, each.start) - speed(true, each.end)) / (each.end - each.start)
            missed += abs(each.deceleration - known) > 1.96 * each.error
    assert missed <= MISSED
    assert late >= 0.8 * SEEDS


def test_velocities_tell_brakes_that_build_up_within_a_second() -> None:
    log = rolled()
    found = log.with_channels({})
    (roll,) = seen_rolls(found)
    assert roll.phases[0].end == pytest.approx(8.5, abs=1.0)
    assert roll.phases[0].effective < 0.12 < 0.16 < roll.phases[-1].effective
    assert roll.stands


def slowing(
    decelerations: list[tuple[float, float]], noise: float, seed: int = 1, first: float = 50.0
) -> dict[str, Array]:
    """A roll north with decelerations over gravity's, each for some seconds."""
    step = 0.02
    parts = [np.full(round(seconds / step), value) for value, seconds in decelerations]
    rate = np.concatenate(parts) * GRAVITY
    moving = np.maximum(first - np.concatenate([[0.0], np.cumsum(rate)[:-1]]) * step, 0.0)
    n = len(moving)
    rng = np.random.default_rng(seed)
    still = {name: np.zeros(n) for name in ("velocity_east", "height_above_ground", "altitude")}
    return still | {
        "time": np.arange(n) * step,
        "velocity_north": moving + rng.normal(0.0, noise, n),
        "psi": np.zeros(n),
        "steering": np.zeros(n),
    }


def test_a_closed_form_is_found_with_its_phases() -> None:
    (roll,) = seen_rolls(flight(slowing([(0.03, 10.0), (0.2, 15.0), (0.08, 12.0)], 0.1)))
    assert [each.end for each in roll.phases[:2]] == pytest.approx([10.0, 25.0], abs=0.5)
    for each, true in zip(roll.phases, (0.03, 0.2, 0.08), strict=True):
        assert each.effective == pytest.approx(true, abs=max(3.0 * each.effective_error, 0.002))


def test_an_even_roll_has_one_phase_and_stands_where_it_must() -> None:
    for seed in range(20):
        (roll,) = seen_rolls(flight(slowing([(0.06, 50.0)], 0.1, seed, 25.0)))
        assert len(roll.phases) == 1
        assert roll.stands
        assert roll.time == pytest.approx(25.0 / (0.06 * GRAVITY), rel=5e-3)
        assert roll.distance == pytest.approx(25.0**2 / (0.12 * GRAVITY), rel=5e-3)


def test_a_roll_that_gathers_speed_has_no_standstill() -> None:
    (roll,) = seen_rolls(flight(slowing([(0.06, 35.0), (-0.05, 12.0)], 0.1, first=25.0)))
    assert not roll.stands
    assert [each.effective for each in roll.phases] == pytest.approx([0.06, -0.05], abs=2e-3)


def test_a_curve_is_not_measured_along_a_line() -> None:
    log = slowing([(0.06, 50.0)], 0.0, first=25.0)
    way = np.cumsum(log.pop("velocity_north")) * 0.02
    gone = {name: values for name, values in log.items() if not name.startswith("velocity")}
    bent = gone | {"north": 300.0 * np.sin(way / 300.0), "east": 300.0 * (1 - np.cos(way / 300.0))}
    straight = gone | {"north": way, "east": 0.0 * way}
    assert seen_rolls(flight(bent)) == []
    assert len(seen_rolls(flight(straight))) == 1
