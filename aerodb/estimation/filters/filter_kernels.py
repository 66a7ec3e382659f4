"""Compiled steps of the Kalman filter for k sets of parameters side by side: arrays end with the
sets, which the innermost loops run over."""

import numpy as np
from numba import njit

from aerodb.support import Array

#: Samples in which a steady covariance must settle.
_LONGEST = 5_000
#: Relative change of a variance from sample to sample at which it has settled.
_SETTLED = 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def linear_pass(
    state: Array, covariance: Array, transition: Array, drive: Array, H: Array,
    measured: Array, process: Array, measurement: Array, given: bool, step: float,
    steady: bool,
    innovations: Array, variances: Array, predicted: Array, states: Array,
) -> None:  # fmt: skip
    """Filter a linear model over a whole record, in place; `predicted` comes with what the outputs
    are at a state of zero. Shapes are those of `FilterPass` and `StateSpace.discrete`; covariance
    (s, s, k), in SI units. A divergence gives values that are inf or NaN."""
    n, s, k = states.shape
    o = H.shape[0]
    updated = np.zeros((s, s, k))
    for i in range(n):
        for j in range(o):
            for a in range(s):
                for q in range(k):
                    predicted[i, j, q] += H[j, a, q] * state[a, q]
        for a in range(s):
            for b in range(s):
                for q in range(k):
                    updated[a, b, q] = covariance[a, b, q]
        update(
            state, updated, H, measured[i], predicted[i], measurement, given, innovations[i],
            variances[i],
        )  # fmt: skip
        for a in range(s):
            for q in range(k):
                states[i, a, q] = state[a, q]
        if i == n - 1:
            break
        for a in range(s):
            for q in range(k):
                state[a, q] = drive[i, a, q]
            for b in range(s):
                for q in range(k):
                    state[a, q] += transition[a, b, q] * states[i, b, q]
        if not steady:
            predict(transition, updated, process, step, covariance)


@njit(cache=True, nogil=True, error_model="numpy")
def _blended(parts: Array, change: Array, out: Array) -> None:
    """Values (m, k) at unknowns changed by (g, k), of parts (m, 1 + g): values and derivatives."""
    m, k = out.shape
    for a in range(m):
        for q in range(k):
            out[a, q] = parts[a, 0]
        for j in range(change.shape[0]):
            slope = parts[a, 1 + j]
            if slope != 0.0:
                for q in range(k):
                    out[a, q] += slope * change[j, q]


@njit(cache=True, nogil=True, error_model="numpy")
def trajectory_pass(
    state: Array, covariance: Array, motion: Array, following: Array, transitions: Array,
    outputs: Array, observations: Array, change: Array, steady_H: Array, measured: Array,
    process: Array, measurement: Array, given: bool, step: float, steady: bool,
    innovations: Array, variances: Array, predicted: Array, states: Array,
) -> None:  # fmt: skip
    """Filter a model linearised along a motion over a whole record, in place.

    Units are SI; a divergence gives values that are inf or NaN.

    Parameters
    ----------
    motion : (n, s). following (n, s, 1 + g), transitions (n, s s, 1 + g), outputs (n, o, 1 + g),
        observations (n, o s, 1 + g) : see `Linearised`. change : (g, k), of the unknowns.
    steady_H : (o, s, k), the observation matrix of a steady gain.
    """
    n, s, k = states.shape
    o = steady_H.shape[0]
    updated, deviation = np.zeros((s, s, k)), np.empty((s, k))
    flat_H, flat_transition = np.empty((o * s, k)), np.empty((s * s, k))
    H, transition = flat_H.reshape((o, s, k)), flat_transition.reshape((s, s, k))
    for i in range(n):
        for a in range(s):
            for q in range(k):
                deviation[a, q] = state[a, q] - motion[i, a]
        _blended(observations[i], change, flat_H)
        _blended(outputs[i], change, predicted[i])
        for j in range(o):
            for a in range(s):
                for q in range(k):
                    predicted[i, j, q] += H[j, a, q] * deviation[a, q]
        for a in range(s):
            for b in range(s):
                for q in range(k):
                    updated[a, b, q] = covariance[a, b, q]
        update(
            state, updated, steady_H if steady else H, measured[i], predicted[i], measurement,
            given, innovations[i], variances[i],
        )  # fmt: skip
        for a in range(s):
            for q in range(k):
                states[i, a, q] = state[a, q]
                deviation[a, q] = state[a, q] - motion[i, a]
        if i == n - 1:
            break
        _blended(following[i], change, state)
        _blended(transitions[i], change, flat_transition)
        for a in range(s):
            for b in range(s):
                for q in range(k):
                    state[a, q] += transition[a, b, q] * deviation[b, q]
        if not steady:
            predict(transition, updated, process, step, covariance)


@njit(cache=True, nogil=True, error_model="numpy")
def settled(transition: Array, H: Array, process: Array, measurement: Array, step: float) -> Array:
    """Predicted covariance (s, s, k) at which the discrete Riccati equation settles. transition (s,
    s, k), H (o, s, k), process (s, k), measurement (o, o, k), step [s]. What does not settle in
    `_LONGEST` samples is returned as it is."""
    o, s, k = H.shape
    covariance, updated = np.zeros((s, s, k)), np.zeros((s, s, k))
    state, before, nothing = np.zeros((s, k)), np.zeros((s, k)), np.zeros(o)
    innovations, variances, zero = np.zeros((o, k)), np.zeros((o, k)), np.zeros((o, k))
    for _ in range(_LONGEST):
        update(state, updated, H, nothing, zero, measurement, False, innovations, variances)
        predict(transition, updated, process, step, covariance)
        change = 0.0
        for a in range(s):
            for q in range(k):
                now = covariance[a, a, q]
                if now > 0.0:
                    change = max(change, abs(now - before[a, q]) / now)
                before[a, q] = now
                state[a, q] = 0.0
            for b in range(s):
                for q in range(k):
                    updated[a, b, q] = covariance[a, b, q]
        if not change > _SETTLED:
            break
    return covariance


@njit(cache=True, nogil=True, error_model="numpy")
def update(
    state: Array, covariance: Array, H: Array, measured: Array, predicted: Array,
    noise: Array, given: bool, innovations: Array, variances: Array,
) -> None:  # fmt: skip
    """Take in the measurements (o,) of one sample, in place: state (s, k), covariance (s, s, k),
    innovations and variances (o, k).

    With the observation matrix H, ``S = H P H' + R = L D L'``: the innovations are ``inv(L) v``
    and their variances D; the gain of each is a column of ``P H' inv(L)'``. `given`: the noise is S
    itself.

    Outputs are processed one after another; one that is NaN is left out. Units are SI.
    """
    s, k = state.shape
    o = measured.shape[0]
    gain, lower = np.zeros((o, s, k)), np.zeros((o, o, k))
    for j in range(o):
        if not np.isfinite(measured[j]):
            continue
        for q in range(k):
            innovations[j, q] = measured[j] - predicted[j, q]
        for a in range(s):
            for b in range(s):
                for q in range(k):
                    gain[j, a, q] += covariance[a, b, q] * H[j, b, q]
        for m in range(j + 1):
            if not np.isfinite(measured[m]):
                continue
            for q in range(k):
                entry = noise[j, m, q]
                if not given:
                    for a in range(s):
                        entry += H[m, a, q] * gain[j, a, q]
                for p in range(m):
                    entry -= lower[j, p, q] * lower[m, p, q] * variances[p, q]
                if m < j:
                    lower[j, m, q] = entry / variances[m, q]
                    innovations[j, q] -= lower[j, m, q] * innovations[m, q]
                else:
                    variances[j, q] = entry
    for j in range(o):
        if not np.isfinite(measured[j]):
            continue
        for m in range(j):
            for a in range(s):
                for q in range(k):
                    gain[j, a, q] -= lower[j, m, q] * gain[m, a, q]
    for j in range(o):
        if not np.isfinite(measured[j]):
            continue
        for a in range(s):
            for q in range(k):
                weight = gain[j, a, q] / variances[j, q]
                state[a, q] += weight * innovations[j, q]
                for b in range(s):
                    covariance[a, b, q] -= weight * gain[j, b, q]


@njit(cache=True, nogil=True, error_model="numpy")
def predict(transition: Array, covariance: Array, process: Array, step: float, out: Array) -> None:
    """``out = F P F' + Q`` (s, s, k), with Q of white noise on the rates over one step by Simpson's
    rule; the transition of half a step is the root of F to third order. transition F and covariance
    P : (s, s, k). process : (s, k), the state's unit over sqrt(s). step : [s]."""
    s, k = process.shape
    half, square, cube = np.empty((s, s, k)), np.zeros((s, s, k)), np.zeros((s, s, k))
    full = transition.copy()
    for a in range(s):
        for q in range(k):
            full[a, a, q] -= 1.0
    for a in range(s):
        for c in range(s):
            for b in range(s):
                for q in range(k):
                    square[a, b, q] += full[a, c, q] * full[c, b, q]
    for a in range(s):
        for c in range(s):
            for b in range(s):
                for q in range(k):
                    cube[a, b, q] += square[a, c, q] * full[c, b, q]
    for a in range(s):
        for b in range(s):
            for q in range(k):
                half[a, b, q] = (
                    0.5 * full[a, b, q] - 0.125 * square[a, b, q] + 0.0625 * cube[a, b, q]
                )
                square[a, b, q] = 0.0
                out[a, b, q] = 0.0
        for q in range(k):
            half[a, a, q] += 1.0
    # square is now F P
    for a in range(s):
        for c in range(s):
            for b in range(s):
                for q in range(k):
                    square[a, b, q] += transition[a, c, q] * covariance[c, b, q]
    for c in range(s):
        for a in range(s):
            for b in range(a, s):
                for q in range(k):
                    intensity = process[c, q] ** 2 * step / 6.0
                    out[a, b, q] += square[a, c, q] * transition[b, c, q] + intensity * (
                        transition[a, c, q] * transition[b, c, q]
                        + 4.0 * half[a, c, q] * half[b, c, q]
                    )
    for a in range(s):
        for q in range(k):
            out[a, a, q] += process[a, q] ** 2 * step / 6.0
        for b in range(a):
            for q in range(k):
                out[a, b, q] = out[b, a, q]
