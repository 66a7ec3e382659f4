"""Compiled loops of state models; a module of their own, so that the compiler is loaded only when a
state is integrated."""

import numba
import numpy as np

from aerodb.support import Array, Integers
from aerodb.tables.instructions import Instructions
from aerodb.tables.machine import execute


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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rates_along(
    program: Instructions, slots: Array, inputs: Integers, series: Array, states: Integers,
    rates: Integers, first: Array, interval: float, parts: int,
) -> Array:  # fmt: skip
    """Integrate states by the classical Runge-Kutta rule, (n, m).

    Parameters
    ----------
    slots : (s, 1), constants given. inputs : (i,) slots of `series` (n, i), linear between samples.
    states, rates : (m,) slots of the states and of their rates [1/s]. first : (m,) at the start.
    interval : between samples [s], in `parts` steps.
    """
    n, m = series.shape[0], len(first)
    cells = np.zeros((program.modes.shape[0], 1), np.int64)
    outside = np.zeros((len(program.first_value), 1), np.bool_)
    found, x, total, rate = np.empty((n, m)), first.copy(), np.empty(m), np.zeros(m)
    step = interval / parts
    for i in range(n):
        found[i] = x
        if i == n - 1:
            break
        for part in range(parts):
            total[:] = 0.0
            for number in range(4):
                ahead = 0.0 if number == 0 else (1.0 if number == 3 else 0.5)
                share = (part + ahead) / parts
                for j in range(len(inputs)):
                    slots[inputs[j], 0] = series[i, j] + share * (series[i + 1, j] - series[i, j])
                for j in range(m):
                    slots[states[j], 0] = x[j] + ahead * step * rate[j]
                execute(program, slots, cells, outside, 1)
                for j in range(m):
                    rate[j] = slots[rates[j], 0]
                    total[j] += step / (6.0 if number == 0 or number == 3 else 3.0) * rate[j]
            for j in range(m):
                x[j] += total[j]
    return found
