"""A smoothed record at its own rate, from the error states on the smoother's grid."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error import inertial_noise
from aerodb.consistency.reconstructed import ReconstructedPath
from aerodb.consistency.sensors import earth_to_body
from aerodb.consistency.smoother.gusts import Intensities, variance_within_step
from aerodb.consistency.smoother.kalman import SmootherPass
from aerodb.consistency.smoother.path_error import (
    FORCE,
    GUST,
    GYRO,
    POSITION,
    VELOCITY,
    PathError,
    apply_error,
    delay_of_channel,
    flow_rows,
    predicted_outputs,
)
from aerodb.support import Array

#: Channels for which the smoother gives a standard error.
CHANNELS = (*STATES, "V", "alpha", "beta", "wind_north", "wind_east", "wind_down", *INPUTS)


@dataclass(frozen=True)
class SmoothedPath:
    """One smoothed record: n samples, g grid points, d draws.

    path : `ReconstructedPath` in moving air. steady : the reconstructed one that it started from.
    wind : (3, n), including gusts, north, east, down [m/s].
    sigma : channel of `CHANNELS` -> (n,), standard errors, SI.
    grid : (g,), sample indices of the smoother's grid.
    innovations : channel -> (g,), in units of their standard deviation (nan: none).
    draws : channel of `CHANNELS` -> (d, g), random draws of the error (true minus smoothed) with
        its correlation in time and across channels.
    within : channel of `CHANNELS` -> one sigma of the gusts between grid points, which the draws do
        not include, SI.
    intensities : of this record.
    """

    path: ReconstructedPath
    steady: ReconstructedPath
    wind: Array
    sigma: Mapping[str, Array]
    grid: np.ndarray
    innovations: Mapping[str, Array]
    draws: Mapping[str, Array]
    within: Mapping[str, float]
    intensities: Intensities


def expanded(
    system: PathError,
    by: Intensities,
    result: SmootherPass,
    here: np.ndarray,
    common: Array,
    lack: Array,
    values: Mapping[str, float],
) -> SmoothedPath:
    """The smoothed path at the record's own rate, from error states on the grid.

    here : (p,), grid points of the covariance and of `common` (p, m, k), the effect of the
    unknowns. lack : (g, m, d), draws of the error."""
    record, grid, n = system.path.record, system.at, len(system.path.record.inputs)
    error = result.states[:, :, 0]
    fine = interpolated(error, grid, n)
    mean_wind = np.array([values.get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down")])
    states, wind = apply_error(system.path.states, fine), fine[:, GUST].T + mean_wind[:, None]
    air = states[:3] - np.einsum("ijn,jn->in", earth_to_body(states), wind)

    def rows_at(at: np.ndarray) -> Array:
        return _channel_rows(states[:, at], air[:, at], wind[:, at], error.shape[1])

    rows = rows_at(grid[here])
    inside = rows[:, :, GUST] ** 2 @ (
        variance_within_step(by.gusts, system.step) if len(grid) < n else np.zeros(3)
    )
    variance = (
        np.sum((rows @ result.covariance) * rows, axis=2)
        + np.sum((rows @ common) ** 2, axis=2)
        + inside
    )
    variance[:, len(CHANNELS) - 6 :] += inertial_noise(record) ** 2
    root = interpolated(np.sqrt(np.maximum(variance, 0.0)), grid[here], n)
    sigma = dict(zip(CHANNELS, root.T, strict=True))
    state_sigma = np.stack([sigma[name] for name in STATES])
    if error.shape[1] <= POSITION.start:
        state_sigma[6:] = system.path.state_sigma[6:]
        sigma |= dict(zip(STATES[6:], state_sigma[6:], strict=True))
    path = replace(
        system.path,
        states=states,
        air=air,
        inputs=system.path.inputs - np.column_stack([fine[:, FORCE], fine[:, GYRO]]),
        residuals=_residuals(system, error, values),
        state_sigma=state_sigma,
        air_sigma=np.stack([sigma[name] for name in ("V", "alpha", "beta")]),
    )
    scattered = rows_at(grid) @ lack if lack.size else np.zeros((0, len(CHANNELS), 0))
    draws = {name: scattered[:, number].T for number, name in enumerate(CHANNELS)}
    innovations = dict(zip(system.channels, result.innovations.T, strict=True))
    within = dict(zip(CHANNELS, np.sqrt(inside.mean(axis=0)).tolist(), strict=True))
    return SmoothedPath(path, system.path, wind, sigma, grid, innovations, draws, within, by)


def _channel_rows(states: Array, air: Array, wind: Array, m: int) -> Array:
    """(g, CHANNELS, m) derivatives of every channel by the error states."""
    flow = flow_rows(states, air, wind, m)
    rows = np.zeros((len(flow), len(CHANNELS), m))
    rows[:, :3, VELOCITY] = np.moveaxis(earth_to_body(states), 2, 0)
    rows[:, 3:6], rows[:, 9:12] = flow[:, 3:], flow[:, :3]
    if m > POSITION.start:
        rows[:, 6:9, POSITION] = np.diag([1.0, 1.0, -1.0])
    rows[:, 12:15, GUST] = np.eye(3)
    rows[:, 15:18, FORCE], rows[:, 18:, GYRO] = -np.eye(3), -np.eye(3)
    return rows


def interpolated(values: Array, grid: np.ndarray, n: int, shift: float = 0.0) -> Array:
    """Interpolate (g, q) from the grid to samples 0 to n-1, delayed by `shift` samples; end values
    are repeated."""
    if len(grid) == n and shift == 0.0:
        return values
    at = np.arange(n) - shift
    return np.column_stack([np.interp(at, grid, column) for column in values.T])


def _residuals(system: PathError, error: Array, values: Mapping[str, float]) -> dict[str, Array]:
    """Measured minus smoothed outputs, (n,) by channel, at the record's own rate, with delays."""
    change = predicted_outputs(system, error) - system.base
    remaining, n = {}, len(system.path.record.inputs)
    for column, name in enumerate(system.channels):
        turned = (
            np.angle(np.exp(1j * change[:, column]))
            if name in ("phi", "psi")
            else change[:, column]
        )
        late = delay_of_channel(name, values) / system.path.record.step
        remaining[name] = (
            system.path.residuals[name] - interpolated(turned[:, None], system.at, n, late)[:, 0]
        )
    return remaining
