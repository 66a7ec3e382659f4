"""The Kalman filter of a dynamic model, for k sets of parameters side by side.

The model is integrated from sample to sample by Runge-Kutta's fourth-order formula and linearised
by central differences of that same step, so that the transition matrix belongs to the integration.
The outputs of a sample are processed one after another, each given those before it, which needs no
inverse, leaves missing ones out, and gives innovations that are independent of each other.
"""

from dataclasses import dataclass

import numpy as np

from aerodb.estimation.delays import DelayedStateSpace
from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.filter_kernels import linear_pass, predict, settled, update
from aerodb.estimation.state_space import StateSpace
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Central differences: step as a share of a state, and the least state it is a share of.
_SHARE, _LEAST = 1e-4, 1e-2


@dataclass(frozen=True, eq=False)
class NoiseLevels:
    """What disturbs the states and the outputs, for k sets of parameters.

    Parameters
    ----------
    process : (s, k), square roots of the intensities of white noise on the rates: the state's unit
        over sqrt(s).
    measurement : (o, o, k), covariance of white noise on the outputs.
    innovations : whether `measurement` is the covariance of the innovations instead.
    """

    process: Array
    measurement: Array
    innovations: bool = False


@dataclass(frozen=True, eq=False)
class FilterPass:
    """What the filter saw of one record.

    Parameters
    ----------
    innovations : (n, o, k), measured minus predicted, each given the outputs before it too; 0
        where nothing was measured.
    variances : (n, o, k), of the innovations; 1 / (2 pi) where nothing was measured.
    predicted : (n, o, k), outputs predicted from the samples before.
    states : (n, s, k), with the measurements up to and including each sample.
    """

    innovations: Array
    variances: Array
    predicted: Array
    states: Array

    @property
    def log_likelihood(self) -> Array:
        """Logarithm of the probability density of the record, (k,); -inf after a divergence."""
        with np.errstate(all="ignore"):
            terms = np.log(2.0 * np.pi * self.variances) + self.innovations**2 / self.variances
            total = -0.5 * terms.sum(axis=(0, 1))
        return np.where(np.isfinite(total), total, -np.inf)


def stepped(
    model: DynamicModel, values: Values, record: TimeHistory, sample: int, state: Array
) -> Array:
    """State one sample later, (s, k), by Runge-Kutta's fourth-order formula."""
    step = record.step
    a = model.rates(values, record, float(sample), state)
    b = model.rates(values, record, sample + 0.5, state + 0.5 * step * a)
    c = model.rates(values, record, sample + 0.5, state + 0.5 * step * b)
    d = model.rates(values, record, sample + 1.0, state + step * c)
    return state + (step / 6.0) * (a + 2.0 * b + 2.0 * c + d)


def around(state: Array) -> tuple[Array, Array]:
    """States (s, (2 s + 1) k): k states (s, k), then each moved up and down in every element; and
    the displacements (s, k)."""
    s = len(state)
    moved = np.repeat(state[:, None, :], 2 * s + 1, axis=1)
    size = _SHARE * np.maximum(np.abs(state), _LEAST)
    for a in range(s):
        moved[a, 1 + a] += size[a]
        moved[a, 1 + s + a] -= size[a]
    return moved.reshape(s, -1), size


def slopes(moved: Array, size: Array) -> tuple[Array, Array]:
    """Value (m, k) and Jacobian (m, s, k) from values (m, (2 s + 1) k) at the states `around`."""
    s = len(size)
    split = moved.reshape(len(moved), 2 * s + 1, size.shape[1])
    jacobian = (split[:, 1 : 1 + s] - split[:, 1 + s :]) / (2.0 * size)
    return split[:, 0], np.ascontiguousarray(jacobian)


def repeated(values: Values, times: int) -> Values:
    """Values of k sets of parameters, for `times` states each."""
    return {
        name: np.tile(value, times) if np.ndim(value) else value for name, value in values.items()
    }


def run_filter(
    model: DynamicModel, values: Values, record: TimeHistory, noise: NoiseLevels, steady: bool
) -> FilterPass:
    """Run the filter over a record.

    Parameters
    ----------
    values : of every parameter, a number or (k,).
    steady : one gain for the whole record, from the steady covariance (Riccati) of the model
        linearised at its first state; False: linearised at every sample (extended Kalman filter).

    The first state is the model's, in the extended form without error: an unknown one is a
    parameter. Without process noise the filter is the simulation.
    """
    if isinstance(model, StateSpace | DelayedStateSpace):
        return _linear_filter(model, values, record, noise, steady)
    k = noise.process.shape[1]
    first = model.initial_state(values, record)
    state = np.array(np.broadcast_to(first, (len(first), k)), dtype=np.float64)
    s, measured = len(state), record.stacked(model.outputs)
    n, o = measured.shape
    wide = repeated(values, 2 * s + 1)
    still = steady or not noise.process.any()
    held, sight = np.zeros((s, s, k)), np.zeros((o, s, k))
    out = FilterPass(
        np.zeros((n, o, k)),
        np.full((n, o, k), 0.5 / np.pi),
        np.empty((n, o, k)),
        np.empty((n, s, k)),
    )
    with np.errstate(all="ignore"):
        if steady and noise.process.any():
            covariance, sight = _steady(model, wide, record, noise, state)
        else:
            covariance = np.zeros((s, s, k))
        for i in range(n):
            if still:
                out.predicted[i] = model.observed(values, record, i, state)
            else:
                moved, size = around(state)
                out.predicted[i], sight = slopes(model.observed(wide, record, i, moved), size)
            held[:] = covariance
            update(
                state, held, sight, measured[i], out.predicted[i], noise.measurement,
                noise.innovations, out.innovations[i], out.variances[i],
            )  # fmt: skip
            out.states[i] = state
            if i == n - 1:
                break
            if still:
                state = np.ascontiguousarray(stepped(model, values, record, i, state))
            else:
                moved, size = around(state)
                after, transition = slopes(stepped(model, wide, record, i, moved), size)
                state = np.ascontiguousarray(after)
                predict(transition, held, noise.process, record.step, covariance)
    return out


def _linear_filter(
    model: StateSpace | DelayedStateSpace,
    values: Values,
    record: TimeHistory,
    noise: NoiseLevels,
    steady: bool,
) -> FilterPass:
    """The same of a linear model, compiled."""
    k = noise.process.shape[1]
    first = model.initial_state(values, record)
    state = np.array(np.broadcast_to(first, (len(first), k)), dtype=np.float64)
    measured = record.stacked(model.outputs)
    with np.errstate(all="ignore"):
        transition, drive, sight, direct = model.discrete(values, record, k)
        covariance = np.zeros((len(state), len(state), k))
        if steady and noise.process.any():
            wide = repeated(values, 2 * len(state) + 1)
            covariance, sight = _steady(model, wide, record, noise, state)
        out = FilterPass(
            np.zeros_like(direct),
            np.full(direct.shape, 0.5 / np.pi),
            direct,
            np.empty((len(direct), *state.shape)),
        )
        linear_pass(
            state, covariance, transition, drive, sight, measured, noise.process,
            noise.measurement, noise.innovations, record.step, steady, out.innovations,
            out.variances, out.predicted, out.states,
        )  # fmt: skip
    return out


def _steady(
    model: DynamicModel, wide: Values, record: TimeHistory, noise: NoiseLevels, state: Array
) -> tuple[Array, Array]:
    """Predicted covariance (s, s, k) that the filter of the model linearised at `state` settles at,
    and the observation matrix (o, s, k).

    Parameters
    ----------
    wide : values for the states `around`.

    The discrete Riccati equation is iterated; an unstable or unobserved mode that does not settle
    shows as a likelihood of zero. For a given covariance of the innovations it is the continuous
    equation, ``A P + P A' - P C' S^-1 C P / dt + F F' = 0``, of the textbooks.
    """
    moved, size = around(state)
    _, sight = slopes(model.observed(wide, record, 0, moved), size)
    if noise.innovations:
        _, rate = slopes(model.rates(wide, record, 0.0, moved), size)
        return _continuous(rate, sight, noise, record.step), sight
    _, transition = slopes(stepped(model, wide, record, 0, moved), size)
    return settled(transition, sight, noise.process, noise.measurement, record.step), sight


def _continuous(rate: Array, sight: Array, noise: NoiseLevels, step: float) -> Array:
    """Steady covariance (s, s, k) by the eigenvectors of the Hamiltonian matrix.

    References
    ----------
    J. E. Potter, SIAM Journal on Applied Mathematics 14(3), 1966.
    """
    s, k = noise.process.shape
    a, c = np.moveaxis(rate, -1, 0), np.moveaxis(sight, -1, 0)
    seen = np.swapaxes(c, 1, 2) @ np.linalg.solve(np.moveaxis(noise.measurement, -1, 0), c)
    matrix = np.zeros((k, 2 * s, 2 * s))
    matrix[:, :s, :s], matrix[:, :s, s:] = -np.swapaxes(a, 1, 2), seen / step
    matrix[:, s:, :s] = np.eye(s) * (noise.process.T**2)[:, None, :]
    matrix[:, s:, s:] = a
    good = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    values, vectors = np.linalg.eig(np.where(good[:, None, None], matrix, np.eye(2 * s)))
    order = np.argsort(-values.real, axis=1)[:, None, :s]
    chosen = np.take_along_axis(vectors, order, axis=2)
    upper = np.swapaxes(chosen[:, :s], 1, 2) + 1e-300 * np.eye(s)
    held = np.linalg.solve(upper, np.swapaxes(chosen[:, s:], 1, 2)).real
    held = np.where(good[:, None, None], 0.5 * (held + np.swapaxes(held, 1, 2)), np.nan)
    return np.ascontiguousarray(np.moveaxis(held, 0, -1))
