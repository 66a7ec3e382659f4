"""Clocks and resampling on their own, against signals that are known everywhere."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.signals.clock import clean_clock, is_uniform
from aerodb.signals.resampling import first_order_lag, hold, low_pass, resampler, uniform_grid

FAST, SLOW = np.arange(0.0, 20.0, 0.004), np.arange(0.0, 20.0, 0.02)


def test_low_pass_keeps_straight_lines_to_their_ends() -> None:
    line = 3.0 + 2.0 * FAST
    np.testing.assert_allclose(low_pass(line, 0.004, 0.02), line, rtol=1e-9)


def test_going_down_from_jittered_stamps() -> None:
    rng = np.random.default_rng(4)
    time = FAST + rng.uniform(-1e-3, 1e-3, len(FAST))
    values = np.sin(2 * np.pi * time)
    result = resampler(time, SLOW)(values)
    assert np.max(np.abs(result - np.sin(2 * np.pi * SLOW))[25:-25]) < 2e-3


def test_first_order_lag_and_stair() -> None:
    time = np.arange(0.0, 1.0, 0.05)
    response = first_order_lag(np.where(time > 0.0, 1.0, 0.0), 0.05, 0.2)
    np.testing.assert_allclose(response[1:], 1.0 - np.exp(-(time[1:] - 0.05) / 0.2), rtol=1e-12)
    np.testing.assert_array_equal(first_order_lag(time, 0.05, 0.0), time)
    np.testing.assert_array_equal(
        hold(np.array([0.0, 0.1]), np.array([1.0, 2.0]), np.array([-1.0, 0.05, 0.1, 9.0])),
        [1, 1, 2, 2],
    )


def test_odd_stamps_go_not_their_neighbours() -> None:
    clean = clean_clock(np.array([0.0, 1.0, 9.0, *range(3, 60)]))
    assert np.flatnonzero(~clean.keep).tolist() == [2]
    late = np.append(np.arange(100.0), 1e9)
    assert np.flatnonzero(~clean_clock(late).keep).tolist() == [100]


@pytest.mark.parametrize(
    "time",
    [
        SLOW[::-1],
        np.zeros(100),
        np.full(100, np.nan),
        np.tile(np.arange(100.0), 3),
        np.array([0.0]),
    ],
)
def test_a_clock_that_is_none_is_refused(time: np.ndarray) -> None:
    with pytest.raises(InputError, match="time does not increase") as refusal:
        clean_clock(time, "log, topic imu")
    assert refusal.value.where == "log, topic imu"
    assert refusal.value.remedy


def test_uniform() -> None:
    assert is_uniform(np.round(SLOW, 5))
    assert not is_uniform(np.delete(SLOW, 3))
    assert len(uniform_grid(0.0, 1.0, 0.1)) == 11
