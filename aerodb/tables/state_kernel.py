"""The compiled loops of states with memory. Kept apart so that nothing loads the compiler before a
flight is predicted."""

import numba
import numpy as np

from aerodb.support import Array


@numba.njit(cache=True)
def relaxed(time: Array, target: Array, tau: Array) -> Array:
    """``tau dx/dt + x = target`` from a settled start, all (n,); exact for a target that is linear,
    and a tau that is the mean of both ends, between samples."""
    x = np.empty_like(target)
    x[0] = target[0]
    for k in range(1, len(target)):
        step, mean = time[k] - time[k - 1], 0.5 * (tau[k] + tau[k - 1])
        left = np.exp(-step / mean)
        rise = (target[k] - target[k - 1]) / step * mean
        x[k] = target[k] - rise * (1.0 - left) + (x[k - 1] - target[k - 1]) * left
    return x


@numba.njit(cache=True)
def relay(alpha: Array, low: float, high: float) -> Array:
    """1 once alpha exceeded `high`, until it falls below `low`; 0 at first. NaN where alpha is,
    which changes nothing."""
    x = np.empty_like(alpha)
    state = 0.0
    for k in range(len(alpha)):
        if alpha[k] > high:
            state = 1.0
        elif alpha[k] < low:
            state = 0.0
        x[k] = np.nan if np.isnan(alpha[k]) else state
    return x
