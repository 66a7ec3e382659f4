"""Effect of accelerometer and gyro noise on the estimates.

Integrated, this noise is a drift that output error mistakes for sensor errors, and that the
residuals show only in part.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.consistency.kinematics import STATES
from aerodb.consistency.output_error.normal_equations import in_blocks, usable_samples
from aerodb.consistency.sensors import (
    FlightRecord,
    RecordPrediction,
    SensorParameter,
    corrected_inputs,
)
from aerodb.support import Array

#: Smallest number of blocks of a record: the effect of a sample's noise changes slowly along it.
BLOCKS = 150


def inertial_noise(record: FlightRecord) -> Array:
    """(6,) one sigma of the white noise of specific force [m/s2] and rates [rad/s]: as the record
    states, otherwise from second differences (variance 6 s^2)."""
    if record.input_noise is not None:
        return np.array(record.input_noise)
    return np.asarray(np.sqrt(np.mean(np.diff(record.inputs, 2, axis=0) ** 2, axis=0) / 6.0))


def drift_information(
    record: FlightRecord,
    values: Mapping[str, float],
    response: RecordPrediction,
    swing: Sequence[int],
    unknowns: Sequence[SensorParameter],
    slopes: Mapping[str, Array],
    noise: Mapping[str, float],
) -> Array:
    """Covariance of the normal equations' right-hand side caused by the inertial sensors' noise.

    A sample's noise w at time i moves the states by ``B_i w step``, later states by ``S_k S_i^-1``
    times that, with S the derivative of the states by the initial ones. The gradient therefore
    changes by ``sum_i A_i S_i^-1 B_i w_i step`` with ``A_i = sum_(k > i) J_k' W S_k``.

    Parameters
    ----------
    record : n samples.
    values : parameter name -> value, SI.
    response : outputs with their derivatives, among them those by initial states.
    swing : (m,), numbers of the derivatives by the initial values of the states that are
        integrated, in the order of `STATES`.
    unknowns : the estimated parameters of the record.
    slopes : channel -> (n, k), derivatives of the outputs by these or other quantities.
    noise : channel -> variance of its noise, SI.

    Returns
    -------
    (k, k) covariance.
    """
    integrated = [name for name in STATES if name not in record.given]
    n, m = len(record.inputs), len(integrated)
    k = next(iter(slopes.values())).shape[1]
    size = max(1, n // BLOCKS)
    blocks = -(-n // size)
    pull = np.zeros((blocks, k, m))
    for name in response.outputs:
        good = usable_samples(record, name, unknowns, values)[:, None] / noise[name]
        left, right = (
            in_blocks(slopes[name] * good, blocks, size),
            in_blocks(response.slopes[name][:, swing], blocks, size),
        )
        pull += np.swapaxes(left, 1, 2) @ right
    later = np.cumsum(pull[::-1], axis=0)[::-1]
    rows, at = [STATES.index(name) for name in integrated], np.arange(0, n, size)
    moved = np.moveaxis(response.state_slopes[np.ix_(np.array(rows), at, np.array(swing))], 1, 0)
    effect = _input_effect(response.states[:, at], corrected_inputs(record, values)[at])[:, rows]
    sigma = record.step * np.sqrt(size) * inertial_noise(record)
    # the transposed system gives A S^-1 without an inverse
    weight = np.moveaxis(
        np.linalg.solve(np.swapaxes(moved, 1, 2), np.swapaxes(later, 1, 2)), 1, 2
    ) @ (effect * sigma)
    return np.asarray(np.einsum("nki,nli->kl", weight, weight, optimize=True))


def _input_effect(states: Array, inputs: Array) -> Array:
    """(n, 9, 6) derivatives of the states' time derivatives by the inputs."""
    n = len(inputs)
    effect = np.zeros((n, 9, 6))
    effect[:, :3, :3] = np.eye(3)
    u, v, w, phi, theta = states[:5]
    sine, cosine, slant, upright = np.sin(phi), np.cos(phi), np.tan(theta), np.cos(theta)
    effect[:, 0, 4], effect[:, 0, 5] = -w, v
    effect[:, 1, 3], effect[:, 1, 5] = w, -u
    effect[:, 2, 3], effect[:, 2, 4] = -v, u
    effect[:, 3, 3], effect[:, 3, 4], effect[:, 3, 5] = 1.0, sine * slant, cosine * slant
    effect[:, 4, 4], effect[:, 4, 5] = cosine, -sine
    effect[:, 5, 4], effect[:, 5, 5] = sine / upright, cosine / upright
    return effect
