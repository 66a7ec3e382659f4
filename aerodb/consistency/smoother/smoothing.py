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

from aerodb.consistency.plan import NO_WEIGHT
from aerodb.consistency.reconstructed import ReconstructedPath, Reconstruction
from aerodb.consistency.sensors import SensorParameter
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
    with_missing_noise,
    worth_a_coarse_search,
)
from aerodb.consistency.smoother.kalman import SmootherPass, Transition, propagate, smooth
from aerodb.consistency.smoother.path_error import (
    COARSE,
    GUST,
    PathError,
    block_size,
    path_error,
    relinearised,
)
from aerodb.consistency.smoother.smoothed_path import SmoothedPath, expanded, interpolated
from aerodb.errors import UnknownNameError, nearest
from aerodb.support import Array

#: First passes over each record; each linearises the sensors again and adapts the gust intensity.
_PASSES = 2

#: Airspeed and dynamic pressure whose residuals have a larger correlation are one measurement.
_ONE_SENSOR = 0.7


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
    for path in own:  # one record at a time: together they need more memory than the flight
        slow, system = _systems(path, values, free, coarse, _unused_channels(result, path))
        smoothed, likelihood = _smoothed(slow, system, by, spread, values, draws, generator)
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
            _, values, _ = _parameters(result, path.record.flight, fixed)
            made.append(path_error(path, values, (), step, _unused_channels(result, path)))
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


def _systems(
    path: ReconstructedPath,
    values: Mapping[str, float],
    free: Sequence[SensorParameter],
    coarse: float,
    unused: Sequence[str],
) -> tuple[PathError, PathError]:
    """The linear systems of a record on a slow grid, of `SEARCH_STEP`, and on that of `coarse` [s].

    The second grid contains the points of the first; short records have one system for both. The
    effect of the unknowns on a longer block is the mean of that on the shorter ones.
    """
    step = path.record.step
    system = path_error(path, values, free, coarse, unused)
    if not worth_a_coarse_search([len(path.record.inputs) * step], coarse):
        return system, system
    many = block_size(system.step, SEARCH_STEP)
    slow = path_error(path, values, (), many * system.step, unused)
    g = len(slow.at)
    shown = system.output_sensitivity
    return replace(
        slow,
        output_sensitivity=shown[: g * many].reshape(g, many, *shown.shape[1:]).mean(axis=1),
        state_sensitivity=system.state_sensitivity[many * np.arange(g) + many // 2],
    ), system


def _smoothed(
    slow: PathError,
    system: PathError,
    flight: Intensities,
    spread: Array,
    values: Mapping[str, float],
    draws: int,
    generator: np.random.Generator,
) -> tuple[SmoothedPath, float]:
    """Smooth one record: passes for linearisation and gust intensity on the grid of `slow`, then on
    that of `system` one that shows which residuals remain coloured, and one with the draws. The
    effect of the unknowns is smooth, and taken on the grid of `slow`. Returns the log-likelihood
    as well."""
    rarer = float(np.sqrt(slow.size / system.size))
    by = with_missing_noise(flight, system).scaled(1.0 / rarer)
    error, observation = np.zeros((len(slow.at), slow.observation.shape[2])), slow.observation
    measured = slow.residual
    for _ in range(_PASSES):
        result = _pass(slow, by, measured, observation)
        error, by = result.states[:, :, 0], adapted_gusts(by, result)
        measured, observation = relinearised(slow, error, observation, by.of(slow.channels))
    slow_observation, by = observation, by.scaled(rarer)
    here = (slow.at - system.at[0]) // system.size
    if slow is not system:
        measured, observation = relinearised(
            system,
            interpolated(error, here, len(system.at)),
            system.observation,
            by.of(system.channels),
        )
        error = _pass(system, by, measured, observation).states[:, :, 0]
    left = residual_after_smoothing(system, measured, observation, error)
    by = replace(
        by,
        noise={name: max(size, slow_noise(system, left, name)) for name, size in by.noise.items()},
    )
    sensitivity = -slow.output_sensitivity @ spread
    moved = _pass(slow, by.scaled(1.0 / rarer), sensitivity, slow_observation)
    common = slow.state_sensitivity @ spread + moved.states
    model, noise = transition(system, by), measurement_variances(system, by)
    drawn, drawn_measured = _drawn(model, noise, observation, draws, generator)
    sides = np.concatenate([measured[:, :, None], drawn_measured], axis=2)
    at = np.unique(np.r_[0, here, len(system.at) - 1])
    result = smooth(model, sides, noise, observation, at)
    # true minus smoothed: for given unknowns, plus the effect of one draw of the unknowns
    pushed = common @ generator.standard_normal((spread.shape[1], draws))
    lack = drawn - result.states[:, :, 1:]
    for number in range(draws):
        lack[:, :, number] += interpolated(pushed[:, :, number], here, len(system.at))
    common = common[np.clip(np.searchsorted(here, at), 0, len(here) - 1)]
    return expanded(system, by, result, at, common, lack, values), result.log_likelihood


def _pass(system: PathError, by: Intensities, measured: Array, observation: Array) -> SmootherPass:
    """A pass over measurements (g, c) or (g, c, k), with the variances of the gusts."""
    sides = measured[:, :, None] if measured.ndim == 2 else measured
    noise = measurement_variances(system, by)
    return smooth(transition(system, by), sides, noise, observation, variances=GUST)


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
