"""Compiled loops of state models; a module of their own, so that the compiler is loaded only when a
state is integrated."""

import numba
import numpy as np

from aerodb.support import Array


@numba.njit(cache=True)
def relaxed(time: Array, target: Array, tau: Array) -> Array:
    """Integrate ``tau dx/dt + x = target`` from steady state.

    Parameters
    ----------
    time : (n,) [s]. target : (n,). tau : (n,) [s].

    Returns
    -------
    x (n,). Exact for a target that is linear between samples and a tau that is constant there, the
    mean of both ends.
    """
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
    """Hysteresis relay: 1 once alpha (n,) exceeds `high`, until it falls below `low`; 0 at first.

    NaN where alpha is NaN, which does not change the state.
    """
    x = np.empty_like(alpha)
    state = 0.0
    for k in range(len(alpha)):
        if alpha[k] > high:
            state = 1.0
        elif alpha[k] < low:
            state = 0.0
        x[k] = np.nan if np.isnan(alpha[k]) else state
    return x
