"""What an engineer writes first: a Runge-Kutta loop in plain numpy, finite differences and
Gauss-Newton.

The baseline of `make bench` for flight-path reconstruction; a test asserts that it gives the same
answer.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.sensors.prediction import FlightRecord

_OUTPUTS = ("V", "alpha", "beta", "phi", "theta", "psi", "altitude")


def _derivative(x, u, gravity):
    velocity, (phi, theta, psi), rates = x[:3], x[3:6], u[3:]
    cf, sf, ct, st, cp, sp = (
        np.cos(phi),
        np.sin(phi),
        np.cos(theta),
        np.sin(theta),
        np.cos(psi),
        np.sin(psi),
    )
    to_body = np.array(
        [
            [ct * cp, ct * sp, -st],
            [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
            [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct],
        ]
    )
    euler = np.array([[1.0, sf * st / ct, cf * st / ct], [0.0, cf, -sf], [0.0, sf / ct, cf / ct]])
    over_earth = to_body.T @ velocity
    over_earth[2] = -over_earth[2]
    return np.concatenate(
        [u[:3] + gravity * to_body[:, 2] - np.cross(rates, velocity), euler @ rates, over_earth]
    )


def _shown(record: FlightRecord, start: np.ndarray, bias: np.ndarray) -> np.ndarray:
    inputs, x, step = record.inputs - bias, start.copy(), record.step
    path = [x]
    for now, then in pairwise(inputs):
        middle = 0.5 * (now + then)
        k1 = _derivative(x, now, record.gravity)
        k2 = _derivative(x + 0.5 * step * k1, middle, record.gravity)
        k3 = _derivative(x + 0.5 * step * k2, middle, record.gravity)
        k4 = _derivative(x + step * k3, then, record.gravity)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        path.append(x)
    states = np.array(path)
    u, v, w = (states[:, :3] + np.cross(inputs[:, 3:], record.arm)).T
    speed = np.sqrt(u * u + v * v + w * w)
    return np.column_stack(
        [speed, np.arctan2(w, u), np.arcsin(v / speed), states[:, 3:6], states[:, 8]]
    )


def plain_biases(records: Sequence[FlightRecord], iterations: int = 20) -> np.ndarray:
    """(6,) joint biases of accelerometers and gyros with fixed first states, noise variance
    estimated."""
    starts = [first_states(record) for record in records]
    measured = np.vstack(
        [np.column_stack([record.outputs[name] for name in _OUTPUTS]) for record in records]
    )

    def shown(bias):
        return np.vstack(
            [_shown(record, start, bias) for record, start in zip(records, starts, strict=True)]
        )

    bias = np.zeros(6)
    for _ in range(iterations):
        model = shown(bias)
        slopes = np.stack(
            [(shown(bias + 1e-6 * unit) - model) / 1e-6 for unit in np.eye(6)], axis=2
        )
        residual = measured - model
        weight = 1.0 / np.mean(residual**2, axis=0)
        matrix = np.einsum("njk,j,njl->kl", slopes, weight, slopes)
        step = np.linalg.solve(matrix, np.einsum("njk,j,nj->k", slopes, weight, residual))
        bias = bias + step
        if np.all(np.abs(step) < 1e-3 * np.sqrt(np.diag(np.linalg.inv(matrix)))):
            break
    return bias
