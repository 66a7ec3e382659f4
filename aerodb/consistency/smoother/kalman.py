"""Compiled Kalman filter and fixed-interval smoother for sparse linear models with several
right-hand sides.

The modified Bryson-Frazier smoother (Bierman, *Automatica* 9(6), 1973) processes measurements one
by one and needs no inverse, so it tolerates singular noise and large initial covariances. Its
adjoint variables give the exact derivative of the likelihood by every noise variance (Koopman &
Shephard, *Biometrika* 79(4), 1992).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.support import Array


@dataclass(frozen=True)
class Transition:
    """State equation ``x(i+1) = F x(i) + w`` with m states and n steps.

    rows, columns : (e,), positions of the off-diagonal elements of F.
    values : (n-1, e), these elements.
    diagonal : (m,), diagonal of F.
    block : (n-1, b, b), covariance of w for the first b states.
    diagonal_noise : (m,), variances added to the covariance of w.
    first : (m,), variances of x(0).
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array
    diagonal: Array
    block: Array
    diagonal_noise: Array
    first: Array


@dataclass(frozen=True)
class Score:
    """Sums of the adjoint variables, which give derivatives of the log-likelihood.

    noise : (m,), twice the derivative by a state's noise variance, over all steps.
    first : (m,), twice the derivative by a state's initial variance.
    diagonal : (m,), derivative by a state's diagonal element of F, if it moves no other state.
    measurement : (c,), derivative by the logarithm of a common factor on a channel's variances.
    """

    noise: Array
    first: Array
    diagonal: Array
    measurement: Array


@dataclass(frozen=True)
class SmootherPass:
    """Result of one pass of the smoother.

    states : (n, m, k), smoothed. covariance : (p, m, m), of the smoothed states at the p steps, and
        variance : (n, q), of the q states, that it was asked for.
    innovations : (n, c), of the first right-hand side, in units of their standard deviation (nan:
        no measurement).
    log_likelihood : of the first right-hand side. score : its derivatives.
    """

    states: Array
    covariance: Array
    variance: Array
    innovations: Array
    log_likelihood: float
    score: Score


def smooth(
    model: Transition,
    measured: Array,
    variance: Array,
    observation: Array,
    covariances: NDArray[np.int64] | None = None,
    variances: slice = slice(0, 0),
) -> SmootherPass:
    """Smooth k right-hand sides that share their gains.

    Parameters
    ----------
    model : state equation, m states.
    measured : (n, c, k), measurements.
    variance : (n, c), variance of their noise; zero or less where there is no measurement.
    observation : (n, c, m), observation matrix.
    covariances : (p,), steps whose `covariance` is computed; None: none, and the pass is faster.
    variances : the states whose variances alone are computed, which costs little.

    References
    ----------
    Bierman, Automatica 9(6), 1973; Koopman & Shephard, Biometrika 79(4), 1992.
    """
    n, c, k = measured.shape
    m = len(model.first)
    filtered, spread, gain = np.empty((n, m, k)), np.zeros((n, c)), np.zeros((n, c, m))
    known, error = np.empty((n, m, m)), np.zeros((n, c, k))
    total = _forward(
        model.rows, model.columns, model.values, model.diagonal,
        model.block, model.diagonal_noise, model.first,
        measured, variance, observation, filtered, known, gain, spread, error,
    )  # fmt: skip
    steps = np.empty(0, np.int64) if covariances is None else covariances
    states, after, place = np.empty((n, m, k)), np.empty((len(steps), m, m)), np.full(n, -1)
    place[steps] = np.arange(len(steps))
    first, count = variances.start, variances.stop - variances.start
    own = np.empty((n if count else 0, count))
    sums, by_channel = np.zeros((3, m)), np.zeros(c)
    _backward(
        model.rows, model.columns, model.values, model.diagonal,
        variance, observation, filtered, known, gain, spread, error,
        states, after, place, own, first, sums, by_channel,
    )  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        innovations = np.where(spread > 0, error[:, :, 0] / np.sqrt(spread), np.nan)
    return SmootherPass(
        states,
        after,
        own,
        innovations,
        float(total),
        Score(sums[0], sums[1], sums[2], by_channel),
    )


def propagate(model: Transition, states: Array) -> None:
    """Add to each of the states (n, m, k), in place, F times the one before.

    F is (m, m), sparse, as in `Transition`.
    """
    _propagate(model.rows, model.columns, model.values, model.diagonal, states)


@njit(cache=True, nogil=True)
def _propagate(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: Array,
    diagonal: Array,
    states: Array,
) -> None:
    n, m, k = states.shape
    for i in range(1, n):
        for a in range(m):
            for q in range(k):
                states[i, a, q] += diagonal[a] * states[i - 1, a, q]
        for e in range(rows.shape[0]):
            for q in range(k):
                states[i, rows[e], q] += values[i - 1, e] * states[i - 1, columns[e], q]


@njit(cache=True, nogil=True)
def _copy(values: Array, into: Array) -> None:
    """Copy a matrix. An assignment of arrays would also compile its error message, which takes
    several seconds."""
    for a in range(values.shape[0]):
        for b in range(values.shape[1]):
            into[a, b] = values[a, b]


@njit(cache=True, nogil=True)
def _predict_covariance(
    rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, diagonal: Array,
    block: Array, noise: Array, p: Array, half: Array,
) -> None:  # fmt: skip
    """Replace p by F p F' + Q; half (m, m) is working space."""
    m = p.shape[0]
    for a in range(m):
        for b in range(m):
            half[a, b] = diagonal[a] * p[a, b]
    for e in range(rows.shape[0]):
        row, column, value = rows[e], columns[e], values[e]
        for b in range(m):
            half[row, b] += value * p[column, b]
    for a in range(m):
        for b in range(m):
            p[a, b] = half[a, b] * diagonal[b]
    for e in range(rows.shape[0]):
        row, column, value = rows[e], columns[e], values[e]
        for a in range(m):
            p[a, row] += value * half[a, column]
    for a in range(m):
        p[a, a] += noise[a]
    for a in range(block.shape[0]):
        for b in range(block.shape[0]):
            p[a, b] += block[a, b]


@njit(cache=True, nogil=True)
def _forward(
    rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, diagonal: Array,
    block: Array, noise: Array, first: Array, measured: Array, variance: Array, observation: Array,
    filtered: Array, known: Array, gain: Array, spread: Array, error: Array,
) -> float:  # fmt: skip
    """Kalman filter: fills filtered states and covariances, gains, innovations and their variances;
    returns the log-likelihood."""
    n, c, k = measured.shape
    m = first.shape[0]
    x, moved, p, half, ph = (
        np.zeros((m, k)),
        np.empty((m, k)),
        np.zeros((m, m)),
        np.empty((m, m)),
        np.empty(m),
    )
    places = np.empty(m, np.int64)
    for a in range(m):
        p[a, a] = first[a]
    total = 0.0
    for i in range(n):
        if i > 0:
            for a in range(m):
                for q in range(k):
                    moved[a, q] = diagonal[a] * x[a, q]
            for e in range(rows.shape[0]):
                for q in range(k):
                    moved[rows[e], q] += values[i - 1, e] * x[columns[e], q]
            _copy(moved, x)
            _predict_covariance(
                rows, columns, values[i - 1], diagonal, block[i - 1], noise, p, half
            )
        for j in range(c):
            if not variance[i, j] > 0.0:
                continue
            ph[:] = 0.0
            count = 0
            for b in range(m):
                seen = observation[i, j, b]
                if seen != 0.0:
                    places[count] = b
                    count += 1
                    for a in range(m):
                        ph[a] += seen * p[b, a]
            s = variance[i, j]
            for number in range(count):
                a = places[number]
                s += observation[i, j, a] * ph[a]
            spread[i, j] = s
            for q in range(k):
                e_q = measured[i, j, q]
                for number in range(count):
                    a = places[number]
                    e_q -= observation[i, j, a] * x[a, q]
                error[i, j, q] = e_q
            for a in range(m):
                gain[i, j, a] = ph[a] / s
            for a in range(m):
                weight = gain[i, j, a]
                for q in range(k):
                    x[a, q] += weight * error[i, j, q]
                for b in range(m):
                    p[a, b] -= weight * ph[b]
            total -= 0.5 * (np.log(2.0 * np.pi * s) + error[i, j, 0] ** 2 / s)
        _copy(x, filtered[i])
        _copy(p, known[i])
    return total


@njit(cache=True, nogil=True)
def _adjoint_step(
    rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, diagonal: Array,
    pull: Array, load: Array, half: Array, turned: Array, moved: Array,
) -> None:  # fmt: skip
    """Replace pull (m, k) by F' pull and load by F' load F; load (m, m) is stored transposed, half,
    turned (m, m) and moved are working space."""
    m, k = pull.shape
    for a in range(m):
        for q in range(k):
            moved[a, q] = diagonal[a] * pull[a, q]
        for b in range(m):
            turned[a, b] = load[b, a]
    for a in range(m):
        for b in range(m):
            half[a, b] = diagonal[a] * turned[a, b]
    for e in range(rows.shape[0]):
        row, column, value = rows[e], columns[e], values[e]
        for q in range(k):
            moved[column, q] += value * pull[row, q]
        for b in range(m):
            half[column, b] += value * turned[row, b]
    _copy(moved, pull)
    for b in range(m):
        for a in range(m):
            turned[b, a] = half[a, b]
    for b in range(m):
        for a in range(m):
            load[b, a] = turned[b, a] * diagonal[b]
    for e in range(rows.shape[0]):
        row, column, value = rows[e], columns[e], values[e]
        for a in range(m):
            load[column, a] += value * turned[row, a]


@njit(cache=True, nogil=True)
def _adjoint_measurements(
    variance: Array,
    observation: Array,
    gain: Array,
    spread: Array,
    error: Array,
    pull: Array,
    load: Array,
    by_channel: Array,
) -> None:
    """Process the measurements of one step in reverse: observation and gain (c, m), error (c, k);
    load (m, m) is stored transposed; adds to `by_channel`."""
    m, k = pull.shape
    tied = np.empty(m)
    for j in range(observation.shape[0] - 1, -1, -1):
        if not spread[j] > 0.0:
            continue
        tied[:] = 0.0
        for b in range(m):
            weight = gain[j, b]
            for a in range(m):
                tied[a] += load[b, a] * weight
        quadratic = 1.0 / spread[j]
        for a in range(m):
            quadratic += gain[j, a] * tied[a]
        for q in range(k):
            push = error[j, q] / spread[j]
            for a in range(m):
                push -= gain[j, a] * pull[a, q]
            if q == 0:
                by_channel[j] += 0.5 * (push * push - quadratic) * variance[j]
            for a in range(m):
                pull[a, q] += observation[j, a] * push
        for b in range(m):
            seen = observation[j, b]
            weight = quadratic * seen - tied[b]
            for a in range(m):
                load[b, a] += observation[j, a] * weight
            if seen != 0.0:
                for a in range(m):
                    load[b, a] -= tied[a] * seen


@njit(cache=True, nogil=True)
def _backward(
    rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, diagonal: Array,
    variance: Array, observation: Array, filtered: Array, known: Array, gain: Array, spread: Array,
    error: Array, states: Array, after: Array, place: NDArray[np.int64], own: Array, first: int,
    sums: Array, by_channel: Array,
) -> None:  # fmt: skip
    """Backward pass of the smoother: fills states, covariances and the sums of the score.

    place (n,): where in `after` the covariance of a step goes; -1: nowhere.
    """
    n, m, k = filtered.shape
    pull, load, half, turned = (
        np.zeros((m, k)),
        np.zeros((m, m)),
        np.empty((m, m)),
        np.empty((m, m)),
    )
    moved, column = np.empty((m, k)), np.empty(m)
    for i in range(n - 1, -1, -1):
        p = known[i]
        if i < n - 1:
            _adjoint_step(rows, columns, values[i], diagonal, pull, load, half, turned, moved)
        for q in range(k):
            for a in range(m):
                column[a] = filtered[i, a, q]
            for b in range(m):
                weight = pull[b, q]
                for a in range(m):
                    column[a] += p[a, b] * weight
            for a in range(m):
                states[i, a, q] = column[a]
        if place[i] >= 0:
            _posterior(p, load, half, turned, after[place[i]])
        for d in range(own.shape[1] if own.shape[0] > 0 else 0):
            # p - p load p of one state
            own[i, d] = p[first + d, first + d]
            for b in range(m):
                tied = 0.0
                for a in range(m):
                    tied += load[b, a] * p[first + d, a]
                own[i, d] -= tied * p[first + d, b]
        for a in range(m):
            column[a] = pull[a, 0] * states[i, a, 0]
        for b in range(m):
            for a in range(m):
                column[a] -= load[b, a] * p[b, a]
        for a in range(m):
            sums[2, a] += column[a] / diagonal[a]
        _adjoint_measurements(
            variance[i], observation[i], gain[i], spread[i], error[i], pull, load, by_channel
        )
        for a in range(m):
            sums[0 if i > 0 else 1, a] += pull[a, 0] ** 2 - load[a, a]


@njit(cache=True, nogil=True)
def _posterior(p: Array, load: Array, half: Array, turned: Array, out: Array) -> None:
    """Write p - p load p to out; load is stored transposed, half and turned are working space."""
    m = p.shape[0]
    for a in range(m):
        for b in range(m):
            turned[a, b] = load[b, a]
            half[a, b] = 0.0
    for a in range(m):
        for d in range(m):
            weight = p[a, d]
            for b in range(m):
                half[a, b] += weight * turned[d, b]
    for a in range(m):
        for b in range(a, m):
            out[a, b] = p[a, b]
        for d in range(m):
            weight = half[a, d]
            for b in range(a, m):
                out[a, b] -= weight * p[d, b]
    for a in range(m):
        for b in range(a):
            out[a, b] = out[b, a]
