"""The closed loop of a stall's lift: its angles come back from flights that have one, and are
refused where there is none."""

import numpy as np
import pytest

from aerodb.effects.stall import lift_hysteresis
from aerodb.effects.stall.stall_shape import StallFlight
from aerodb.errors import InputError
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.state_model import Relay

TRUTH, GAIN, ALPHA_0 = Relay(0.09, 0.33), -80.0, -0.04


def flight(number: int, top: float, gain: float = GAIN) -> StallFlight:
    """Up to `top` and back twice; the branch written out sample by sample, not by the product's
    state model."""
    rng, time = np.random.default_rng(number), np.arange(0.0, 60.0, 0.04)
    alpha = 0.05 + (top - 0.05) * np.sin(np.pi * time / 30.0) ** 2
    separated, lost = False, np.zeros(len(time))
    for k, angle in enumerate(alpha):
        separated = angle > TRUTH.high or (separated and angle >= TRUTH.low)
        if separated and angle < TRUTH.high:
            lost[k] = (angle - ALPHA_0) * (angle - TRUTH.low) * (TRUTH.high - angle)
    residual = 0.02 * number + gain * lost + 0.01 * rng.standard_normal(len(time))
    speed, usable = np.full(len(time), 35.0), np.ones(len(time), dtype=np.bool_)
    return StallFlight(
        f"stall-{number}", time, alpha, speed, 1.5, {"C_lift": residual}, {}, usable, ALPHA_0
    )


def test_the_angles_come_back() -> None:
    law = lift_hysteresis.fitted([flight(1, 0.36), flight(2, 0.38)])
    assert law.low == pytest.approx(TRUTH.low, abs=0.01)
    assert law.high == pytest.approx(TRUTH.high, abs=0.01)


def test_no_stall_no_loop() -> None:
    with pytest.raises(InputError, match="no flight"):
        lift_hysteresis.fitted([])
    with pytest.raises(InputError, match="no flight goes into a stall and back out of it"):
        lift_hysteresis.fitted([flight(1, 0.05)])


def test_a_database_has_one_law_of_separation() -> None:
    empty = AeroDatabase("empty", ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)))
    once = lift_hysteresis.with_state(empty, TRUTH)
    assert once.states[0].law == TRUTH
    with pytest.raises(InputError, match="already has a state model of flow_attachment"):
        lift_hysteresis.with_state(once, TRUTH)
