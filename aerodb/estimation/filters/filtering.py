"""The Kalman filter of a dynamic model, for k sets of parameters side by side.

A linear model is filtered as it is; another one is linearised along a motion (`linearisation`).
The outputs of a sample are processed one after another, each given those before it, which needs no
inverse, leaves missing ones out, and gives innovations that are independent of each other.
"""

from dataclasses import dataclass

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.filters.filter_kernels import linear_pass, settled, trajectory_pass
from aerodb.estimation.filters.linearisation import Linearised
from aerodb.estimation.filters.one_step import around, repeated, slopes, stepped
from aerodb.estimation.linear_models import LinearModel
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array


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
        """Natural logarithm, without unit, of the probability density of the record, (k,); -inf
        after a divergence."""
        with np.errstate(all="ignore"):
            terms = np.log(2.0 * np.pi * self.variances) + self.innovations**2 / self.variances
            total = -0.5 * terms.sum(axis=(0, 1))
        return np.where(np.isfinite(total), total, -np.inf)


def run_filter(
    model: LinearModel, values: Values, record: TimeHistory, noise: NoiseLevels, steady: bool
) -> FilterPass:
    """Run the filter of a linear model over a record.

    Units are SI. A divergence shows as a likelihood of -inf.

    Parameters
    ----------
    values : of every parameter, a number or (k,).
    steady : one gain for the whole record, from the steady covariance (Riccati); False: the gain of
        every sample.

    The first state is the model's, without error: an unknown one is a parameter. Without process
    noise the filter is the simulation.
    """
    k = noise.process.shape[1]
    first = model.initial_state(values, record)
    state = np.array(np.broadcast_to(first, (len(first), k)), dtype=np.float64)
    with np.errstate(all="ignore"):
        transition, drive, H, direct = model.discrete(values, record, k)
        covariance = np.zeros((len(state), len(state), k))
        if steady and noise.process.any():
            covariance, H = _steady(model, values, record, noise, state)
        out = _empty_pass(len(direct), direct.shape[1], len(state), k)
        out.predicted[:] = direct
        linear_pass(
            state, covariance, transition, drive, H, record.stacked(model.outputs),
            noise.process, noise.measurement, noise.innovations, record.step, steady,
            out.innovations, out.variances, out.predicted, out.states,
        )  # fmt: skip
    return out


def follow(along: Linearised, vectors: Array, noise: NoiseLevels, steady: bool) -> FilterPass:
    """Run the filter of a model linearised along a motion over its record.

    Units are SI. A divergence shows as a likelihood of -inf.

    Parameters
    ----------
    vectors : (f, k), the unknowns.
    steady : one gain, from the model linearised at its first state, as in `run_filter`; False: of
        every sample (extended Kalman filter, linearised along the motion).
    """
    model, record, k = along.model, along.record, vectors.shape[1]
    values = model.parameters.values(vectors)
    first = model.initial_state(values, record)
    n, s = along.motion.shape
    state = np.array(np.broadcast_to(first, (s, k)), dtype=np.float64)
    measured = record.stacked(model.outputs)
    out = _empty_pass(n, measured.shape[1], s, k)
    covariance, fixed = np.zeros((s, s, k)), np.zeros((measured.shape[1], s, k))
    with np.errstate(all="ignore"):
        if steady and noise.process.any():
            covariance, fixed = _steady(model, values, record, noise, state)
        change = (vectors - along.vector[:, None])[along.columns]
        trajectory_pass(
            state, covariance, along.motion, along.following,
            along.transition.reshape(n, s * s, -1), along.outputs,
            along.observation.reshape(n, -1, along.observation.shape[-1]), change, fixed, measured,
            noise.process, noise.measurement, noise.innovations, record.step, steady,
            out.innovations, out.variances, out.predicted, out.states,
        )  # fmt: skip
    return out


def _empty_pass(n: int, o: int, s: int, k: int) -> FilterPass:
    return FilterPass(
        np.zeros((n, o, k)),
        np.full((n, o, k), 0.5 / np.pi),
        np.empty((n, o, k)),
        np.empty((n, s, k)),
    )


def _steady(
    model: DynamicModel, values: Values, record: TimeHistory, noise: NoiseLevels, state: Array
) -> tuple[Array, Array]:
    """Predicted covariance (s, s, k) that the filter of the model linearised at `state` settles at,
    and the observation matrix (o, s, k).

    The discrete Riccati equation is iterated; an unstable or unobserved mode that does not settle
    shows as a likelihood of zero. For a given covariance of the innovations it is the continuous
    equation, ``A P + P A' - P H' S^-1 H P / dt + F F' = 0``, of the textbooks.
    """
    (displaced, size), wide = around(state), repeated(values, 2 * len(state) + 1)
    _, H = slopes(model.observed(wide, record, 0, displaced), size)
    if noise.innovations:
        _, rate = slopes(model.rates(wide, record, 0.0, displaced), size)
        return _continuous(rate, H, noise, record.step), H
    _, transition = slopes(stepped(model, wide, record, 0, displaced), size)
    return settled(transition, H, noise.process, noise.measurement, record.step), H


def _continuous(rate: Array, H: Array, noise: NoiseLevels, step: float) -> Array:
    """Steady covariance (s, s, k) by the eigenvectors of the Hamiltonian matrix.

    References
    ----------
    J. E. Potter, SIAM Journal on Applied Mathematics 14(3), 1966.
    """
    s, k = noise.process.shape
    a, c = np.moveaxis(rate, -1, 0), np.moveaxis(H, -1, 0)
    information = np.swapaxes(c, 1, 2) @ np.linalg.solve(np.moveaxis(noise.measurement, -1, 0), c)
    matrix = np.zeros((k, 2 * s, 2 * s))
    matrix[:, :s, :s], matrix[:, :s, s:] = -np.swapaxes(a, 1, 2), information / step
    matrix[:, s:, :s] = np.eye(s) * (noise.process.T**2)[:, None, :]
    matrix[:, s:, s:] = a
    good = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    values, vectors = np.linalg.eig(np.where(good[:, None, None], matrix, np.eye(2 * s)))
    order = np.argsort(-values.real, axis=1)[:, None, :s]
    chosen = np.take_along_axis(vectors, order, axis=2)
    upper = np.swapaxes(chosen[:, :s], 1, 2) + 1e-300 * np.eye(s)
    covariance = np.linalg.solve(upper, np.swapaxes(chosen[:, s:], 1, 2)).real
    covariance = np.where(
        good[:, None, None], 0.5 * (covariance + np.swapaxes(covariance, 1, 2)), np.nan
    )
    return np.ascontiguousarray(np.moveaxis(covariance, 0, -1))
