"""Extended Kalman smoother for a reconstructed flight in moving air.

Output error (`output_error.reconstruction`) takes the wind as steady and the inertial sensors as
free of noise: in turbulence its path lacks the gusts, while the raw air data contain them with all
their noise. The smoother starts from that path and its sensor errors, adds gusts, drifts and
inertial noise as random processes, and weighs every sensor by its noise (Jategaonkar 2015, chapter
5; Teixeira et al., J. Aircraft 48(1), 2011). In calm air it returns the path. Where a vane is
missing, the standard error includes the gusts that were not measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error import inertial_noise
from aerodb.consistency.plan import NO_WEIGHT
from aerodb.consistency.reconstructed import ReconstructedPath, Reconstruction
from aerodb.consistency.sensors import SensorParameter, earth_to_body
from aerodb.consistency.smoother.gusts import (
    MOST_RECORDS,
    SEARCH_STEP,
    Intensities,
    adapted_gusts,
    estimate_intensities,
    measurement_variances,
    residual_after_smoothing,
    slow_noise,
    transition,
    variance_within_step,
    with_missing_noise,
    worth_a_coarse_search,
)
from aerodb.consistency.smoother.kalman import SmootherPass, Transition, propagate, smooth
from aerodb.consistency.smoother.path_error import (
    COARSE,
    FORCE,
    GUST,
    GYRO,
    POSITION,
    VELOCITY,
    PathError,
    apply_error,
    delay_of_channel,
    flow_rows,
    path_error,
    predicted_outputs,
    relinearised,
)
from aerodb.errors import UnknownNameError, nearest
from aerodb.support import Array

#: Channels for which the smoother gives a standard error.
CHANNELS = (*STATES, "V", "alpha", "beta", "wind_north", "wind_east", "wind_down", *INPUTS)

#: Passes over each record; each linearises the sensors again and adapts the gust intensity.
_PASSES = 2

#: Airspeed and dynamic pressure whose residuals have a larger correlation are one measurement.
_ONE_SENSOR = 0.7


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


@dataclass(frozen=True)
class SmoothedFlight:
    """A smoothed flight.

    flight : id. paths : one per record. values : parameter name -> value, SI.
    intensities : of gusts, drifts and noise. log_likelihood : of the innovations.
    """

    flight: str
    paths: tuple[SmoothedPath, ...]
    values: Mapping[str, float]
    intensities: Intensities
    log_likelihood: float

    @property
    def drawn(self) -> bool:
        """Whether it has random draws of the error."""
        return next(iter(self.paths[0].draws.values())).size > 0


def smooth_flight(
    result: Reconstruction,
    flight: str,
    *,
    fixed: Mapping[str, float] | None = None,
    noise_floor: Mapping[str, float] | None = None,
    coarse: float = COARSE,
    draws: int = 0,
    seed: int = 0,
    intensities: Intensities | None = None,
) -> SmoothedFlight:
    """Smooth the records of one flight of a reconstruction.

    The reconstruction's sensor errors and mean winds are kept, with their covariance in air without
    vertical motion (a mean wind that was not estimated is zero); initial states, gusts and drifts
    are estimated again. Standard errors are those of the posterior under this model, ``Cov(x) =
    Cov(x | p) + (dx/dp) Cov(p) (dx/dp)'`` for the reconstruction's parameters p. Sensors with
    coloured residuals are weighted by their low-frequency noise. Airspeed and qbar with a common
    error count once. Time and memory grow linearly with the length of the flight.

    Parameters
    ----------
    result : the reconstruction.
    flight : the flight's name in it (`FlightRecord.flight`).
    fixed : the values that were fixed in `reconstruct`, name -> value, SI.
    noise_floor : channel -> smallest credible noise (one sigma of a sample), SI.
    coarse : step of the grid for errors and gusts [s]; faster gusts are not followed, but included
        in the standard errors.
    draws : number of random draws of the error.
    seed : of the draws.
    intensities : from `intensities_of`; None: those of this flight.

    Raises
    ------
    UnknownNameError : when the reconstruction has no such flight.
    InputError : when states were taken from measurement.
    """
    own = _paths(result, flight)
    free, values, index = _parameters(result, flight, fixed)
    spread = _root(result.still[np.ix_(index, index)])
    by = intensities
    if by is None:
        by = intensities_of(result, (flight,), fixed=fixed, noise_floor=noise_floor, coarse=coarse)
    generator = np.random.default_rng(seed)
    paths, total = [], 0.0
    for path in own:  # one system at a time: together they need more memory than the flight
        system = path_error(path, values, free, coarse, _unused_channels(result, path))
        smoothed, likelihood = _smoothed(system, by, spread, values, draws, generator)
        paths.append(smoothed)
        total += likelihood
    return SmoothedFlight(flight, tuple(paths), values, by, total)


def intensities_of(
    result: Reconstruction,
    flights: Sequence[str],
    *,
    fixed: Mapping[str, float] | None = None,
    noise_floor: Mapping[str, float] | None = None,
    coarse: float = COARSE,
) -> Intensities:
    """Common intensities of gusts, drifts and noise for several flights of a reconstruction (also
    for the wind stretches of one flight).

    They are estimated from a few records spread over all of them: searched on a grid of
    `SEARCH_STEP`, with the last steps on that of `coarse`. Other parameters and errors as
    `smooth_flight`.

    coarse : step of the grid [s]. noise_floor : channel -> one sigma, SI. Source:
    `docs/method/consistency.md`, section "Smoother".
    """
    own = [path for flight in flights for path in _paths(result, flight)]
    chosen = np.unique(np.linspace(0, len(own) - 1, MOST_RECORDS).round().astype(int))
    paths = [own[number] for number in chosen]

    def systems(step: float) -> list[PathError]:
        made = []
        for path in paths:
            free, values, _ = _parameters(result, path.record.flight, fixed)
            made.append(path_error(path, values, free, step, _unused_channels(result, path)))
        return made

    durations = [len(path.record.inputs) * path.record.step for path in paths]
    coarser = systems(SEARCH_STEP) if worth_a_coarse_search(durations, coarse) else ()
    return estimate_intensities(systems(coarse), noise_floor, coarser)


def _paths(result: Reconstruction, flight: str) -> list[ReconstructedPath]:
    own = [path for path in result.paths if path.record.flight == flight]
    if not own:
        known = {path.record.flight for path in result.paths}
        raise UnknownNameError(
            f"no flight '{flight}' in this reconstruction", "smoother", nearest(flight, known)
        )
    return own


def _parameters(
    result: Reconstruction, flight: str, fixed: Mapping[str, float] | None
) -> tuple[list[SensorParameter], dict[str, float], list[int]]:
    """Estimated sensor errors and winds of a flight; values of these and of the fixed ones; their
    indices in the reconstruction's estimates."""
    chosen = {
        number: entry
        for number, entry in enumerate(result.estimates)
        if entry.parameter.kind != "initial" and entry.parameter.scope in ("", flight)
    }
    values = {**(fixed or {}), **{entry.parameter.name: entry.value for entry in chosen.values()}}
    return [entry.parameter for entry in chosen.values()], values, list(chosen)


def _unused_channels(result: Reconstruction, path: ReconstructedPath) -> tuple[str, ...]:
    """Channels to leave out: those that have left the estimate, and the dynamic pressure if its
    residual repeats that of the airspeed."""
    gone = tuple(name for name in path.residuals if result.noise.get(name, 0.0) >= NO_WEIGHT)
    if not {"V", "qbar"} <= set(path.residuals):
        return gone
    both = np.stack([path.residuals["V"], path.residuals["qbar"]])
    both = both[:, np.isfinite(both).all(axis=0)]
    alike = both.shape[1] >= 8 and abs(float(np.asarray(np.corrcoef(both))[0, 1])) > _ONE_SENSOR
    return (*gone, "qbar") if alike else gone


def _root(covariance: Array) -> Array:
    """(k, k) square root of a covariance, which may be singular."""
    if len(covariance) == 0:
        return covariance
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _smoothed(
    system: PathError,
    flight: Intensities,
    spread: Array,
    values: Mapping[str, float],
    draws: int,
    generator: np.random.Generator,
) -> tuple[SmoothedPath, float]:
    """Smooth one record: passes for linearisation and gust intensity, then one with the unknowns
    and the draws. Returns the log-likelihood as well."""
    by = with_missing_noise(flight, system)
    error, observation = np.zeros((len(system.at), system.observation.shape[2])), system.observation
    measured = system.residual
    for _ in range(_PASSES):
        result = smooth(
            transition(system, by),
            measured[:, :, None],
            measurement_variances(system, by),
            observation,
            False,
            GUST,
        )
        error, by = result.states[:, :, 0], adapted_gusts(by, result)
        measured, observation = relinearised(system, error, observation, by.of(system.channels))
    left = residual_after_smoothing(system, measured, observation, error)
    by = replace(
        by,
        noise={name: max(size, slow_noise(system, left, name)) for name, size in by.noise.items()},
    )
    model, noise = transition(system, by), measurement_variances(system, by)
    drawn, drawn_measured = _drawn(model, noise, observation, draws, generator)
    sides = np.concatenate(
        [measured[:, :, None], -system.output_sensitivity @ spread, drawn_measured], axis=2
    )
    result = smooth(model, sides, noise, observation)
    k = spread.shape[1]
    common = system.state_sensitivity @ spread + result.states[:, :, 1 : 1 + k]
    # true minus smoothed: for given unknowns, plus the effect of one draw of the unknowns
    lack = drawn - result.states[:, :, 1 + k :] + common @ generator.standard_normal((k, draws))
    return _expanded(system, by, result, common, lack, values), result.log_likelihood


def _drawn(
    model: Transition, noise: Array, observation: Array, draws: int, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Random states (g, m, d) of the model and the measurements (g, c, d) that they cause."""
    g, c, m = observation.shape
    if not draws:
        return np.zeros((g, m, 0)), np.zeros((g, c, 0))
    size = model.block.shape[1]
    power, direction = np.linalg.eigh(model.block)
    root = direction * np.sqrt(np.maximum(power, 0.0))[:, None, :]
    states = np.empty((g, m, draws))
    states[0] = np.sqrt(model.first)[:, None] * generator.standard_normal((m, draws))
    # what drives each step, then the steps themselves
    states[1:] = np.sqrt(model.diagonal_noise)[:, None] * generator.standard_normal(
        (g - 1, m, draws)
    )
    states[1:, :size] += root @ generator.standard_normal((g - 1, size, draws))
    propagate(model, states)
    return states, observation @ states + np.sqrt(noise)[:, :, None] * generator.standard_normal(
        (g, c, draws)
    )


def _expanded(
    system: PathError,
    by: Intensities,
    result: SmootherPass,
    common: Array,
    lack: Array,
    values: Mapping[str, float],
) -> SmoothedPath:
    """The smoothed path at the record's own rate, from error states on the grid."""
    record, grid, n = system.path.record, system.at, len(system.path.record.inputs)
    error = result.states[:, :, 0]
    fine = _interpolated(error, grid, n)
    mean_wind = np.array([values.get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down")])
    states, wind = apply_error(system.path.states, fine), fine[:, GUST].T + mean_wind[:, None]
    air = states[:3] - np.einsum("ijn,jn->in", earth_to_body(states), wind)
    rows = _channel_rows(states[:, grid], air[:, grid], wind[:, grid], error.shape[1])
    inside = rows[:, :, GUST] ** 2 @ (
        variance_within_step(by.gusts, system.step) if len(grid) < n else np.zeros(3)
    )
    variance = (
        np.sum((rows @ result.covariance) * rows, axis=2)
        + np.sum((rows @ common) ** 2, axis=2)
        + inside
    )
    variance[:, len(CHANNELS) - 6 :] += inertial_noise(record) ** 2
    sigma = dict(
        zip(CHANNELS, _interpolated(np.sqrt(np.maximum(variance, 0.0)), grid, n).T, strict=True)
    )
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
    scattered = rows @ lack
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


def _interpolated(values: Array, grid: np.ndarray, n: int, shift: float = 0.0) -> Array:
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
            system.path.residuals[name] - _interpolated(turned[:, None], system.at, n, late)[:, 0]
        )
    return remaining
