"""Compiled integration of several runs over a series of inputs."""

import numpy as np
from numba import njit

from aerodb.simulation.kernel import evaluate
from aerodb.simulation.layout import CHAN, EXTRA, INPUTS, LAW, WORK, Numbers, X
from aerodb.support import Array, Integers

#: Velocity beyond which a run counts as lost [m/s].
_FASTEST = 1e5


@njit(cache=True, nogil=True, error_model="numpy")
def _between(series: Array, share: float, i: int, lanes: int, h: Array) -> None:
    """Inputs at a share of the way from sample i to the next."""
    last = series.shape[0] - 1
    following = min(i + 1, last)
    for j in range(h.shape[0]):
        for k in range(lanes):
            now = series[i, j, k]
            h[j, k] = now + share * (series[following, j, k] - now)


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(model: Numbers, x: Array, k: int, chan: Array, alive: bool) -> bool:
    """Normalise the quaternion of a run and switch its relays; whether its motion is within bounds.
    A run that has ended stands still, so that its numbers stay finite."""
    length = np.sqrt(x[X.e0, k] ** 2 + x[X.e1, k] ** 2 + x[X.e2, k] ** 2 + x[X.e3, k] ** 2)
    for j in range(X.e0, X.e3 + 1):
        x[j, k] /= length
    for j in range(model.states.shape[0]):
        if model.laws[j, LAW.relaxation] == 0.0:
            apart = model.laws[j, LAW.separated]
            if chan[CHAN.alpha, k] > model.laws[j, LAW.high]:
                x[EXTRA + j, k] = apart
            elif chan[CHAN.alpha, k] < model.laws[j, LAW.low]:
                x[EXTRA + j, k] = 1.0 - apart
    alive = alive and abs(x[X.u, k]) + abs(x[X.v, k]) + abs(x[X.w, k]) < _FASTEST
    for j in range(x.shape[0]):
        alive = alive and np.isfinite(x[j, k])
    if not alive:
        for j in range(x.shape[0]):
            x[j, k] = 1.0 if j in (X.u, X.e0) else 0.0
    return alive


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(
    model: Numbers, series: Array, interval: float, parts: int, method: int, x: Array,
    slots: Array, recorded: Array, kept: Array, ended: Integers, left: Integers,
    rates: Array,
) -> int:  # fmt: skip
    """Fly k runs over n samples; returns at how many samples alphadot was not found.

    Parameters
    ----------
    series : (n, r, k) surroundings, inputs and references at each sample, linear between.
    interval : between samples [s], integrated in `parts` steps.
    method : 4 for the classical Runge-Kutta rule, 2 for Adams and Bashforth's second-order rule,
        which evaluates once per step.
    x : rows `X` and further states (k), initial states; ends as those of the last sample.
    slots : (s, k), constants and parameters given.
    recorded : (n, rows `CHAN`, k), at each sample, written; NaN once a run has ended.
    kept : (n, rows of x and inputs, k), states and inputs as they acted, written.
    ended : (k,) number of samples of each run, written.
    left : (t, k) sample at which a table was first left, written; -1 where it was not.
    rates : as x, time derivatives at the last sample, written.
    """
    samples, rows, lanes = series.shape
    size, inputs = x.shape[0], model.inputs.shape[0]
    step = interval / parts
    h, dh = np.empty((rows, lanes)), np.empty((rows, lanes))
    chan, work = np.zeros((recorded.shape[1], lanes)), np.zeros((len(WORK), lanes))
    for k in range(lanes):
        work[WORK.slope, k], work[WORK.slope_slip, k] = -1.0, -1.0
    cells = np.zeros((model.program.modes.shape[0], lanes), np.int64)
    outside = np.zeros((left.shape[0], lanes), np.bool_)
    total, stage, former = np.empty_like(x), np.empty_like(x), np.zeros_like(x)
    alive = np.ones(lanes, np.bool_)
    for k in range(lanes):
        ended[k] = samples
        for t in range(left.shape[0]):
            left[t, k] = -1
    unresolved, begun = 0, False
    for i in range(samples):
        following = min(i + 1, samples - 1)
        for j in range(rows):
            for k in range(lanes):
                dh[j, k] = (series[following, j, k] - series[i, j, k]) / interval
        for t in range(left.shape[0]):
            for k in range(lanes):
                outside[t, k] = False
        for part in range(parts):
            last = i == samples - 1
            single = last or (method == 2 and begun)
            for j in range(size):
                for k in range(lanes):
                    stage[j, k], total[j, k] = x[j, k], 0.0
            for number in range(1 if single else 4):
                ahead = 0.0 if number == 0 else (1.0 if number == 3 else 0.5)
                if number > 0:
                    for j in range(size):
                        for k in range(lanes):
                            stage[j, k] = x[j, k] + ahead * step * rates[j, k]
                _between(series, (part + ahead) / parts, i, lanes, h)
                lost = evaluate(
                    model, stage, h, dh, lanes, step, slots, cells, outside, chan, work, rates
                )
                if number == 0 and part == 0:
                    unresolved += lost > 0
                    for k in range(lanes):
                        for j in range(chan.shape[0]):
                            recorded[i, j, k] = chan[j, k] if alive[k] else np.nan
                        for j in range(size):
                            kept[i, j, k] = x[j, k] if alive[k] else np.nan
                        for j in range(inputs):
                            kept[i, size + j, k] = h[INPUTS + j, k] if alive[k] else np.nan
                        for t in range(left.shape[0]):
                            if outside[t, k] and left[t, k] < 0 and alive[k]:
                                left[t, k] = i
                if single and not last:
                    for j in range(size):
                        for k in range(lanes):
                            x[j, k] += step * (1.5 * rates[j, k] - 0.5 * former[j, k])
                            former[j, k] = rates[j, k]
                elif not last:
                    weight = step / 6.0 if number == 0 or number == 3 else step / 3.0
                    for j in range(size):
                        for k in range(lanes):
                            total[j, k] += weight * rates[j, k]
                            if number == 0:
                                former[j, k] = rates[j, k]
            if last:
                break
            begun = True
            for k in range(lanes):
                if not single:
                    for j in range(size):
                        x[j, k] += total[j, k]
                alive[k] = _keep(model, x, k, chan, alive[k])
                if not alive[k]:
                    ended[k] = min(ended[k], i + 1)
    return unresolved
