"""Estimate the intensities of gusts, sensor drifts and noise by maximum likelihood.

The likelihood is that of the smoother's innovations.

Gusts are first-order Gauss-Markov processes in earth axes, with one intensity and correlation time
for the two horizontal components and one for the vertical, so that one vane informs about gusts
that a missing one would have measured. Drifts of the inertial sensors are such processes too. What
the data do not determine is left to weak log-normal priors, about a factor e wide: light turbulence
after MIL-F-8785C (1980), 3.7, scale lengths of 200 m, and near-isotropic intensities and scales.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from aerodb.consistency.smoother.kalman import Score, SmootherPass, Transition, smooth
from aerodb.consistency.smoother.path_error import (
    ATTITUDE,
    FORCE,
    GUST,
    POSITION,
    VELOCITY,
    PathError,
)
from aerodb.support import Array, Threads

#: Prior median of the intensity of gusts [m/s].
_LIGHT = 0.77
#: Prior median of their scale length [m].
_LENGTH = 200.0
#: Prior medians of the in-run drift of accelerometers [m/s^2] and gyros [rad/s].
_DRIFT = (3e-3, 3e-5)
#: Correlation time of the drift [s].
DRIFT_TIME = 60.0

#: Prior standard deviations (natural logarithm) of horizontal intensity, ratio of vertical to
#: horizontal, horizontal time, ratio of vertical to horizontal, drifts; and the search range around
#: the start for intensities, times, drifts and noise.
_WIDTHS = np.array([1.5, 0.4, 1.0, 0.7, 1.0, 1.0])
_SPAN = np.array([6.0, 6.0, 3.0, 3.0, 3.0, 3.0, 6.0])

#: A channel is coloured if its low-frequency noise exceeds its white noise by this factor, more
#: than chance explains.
_COLOURED = 1.5
#: Upper limit of a residual's autocorrelation between grid points.
_SLOWEST = 0.98

#: Prior of the initial error states, one sigma of attitude (rad), velocity (m/s) and position (m):
#: larger than any path's error.
_UNKNOWN = (0.5, 20.0, 300.0)

#: Number of records, spread over a flight, used to estimate the intensities: more add little.
MOST_RECORDS = 4

#: Smallest noise, SI.
_FAINT = 1e-9

#: Largest number of iterations.
_PASSES = 60
#: Gain of log-likelihood that ends the search.
_ENOUGH = 0.003
#: Gain that ends a first search, which tells the channels that remain coloured.
_FIRST = 1.0
#: Gain that ends a search on the fine grid that follows one on a coarse grid.
_LAST = 0.1

#: Step of the grid on which the intensities are searched, and on which a record is smoothed first,
#: s: it holds frequencies up to 2.5 Hz, while gusts act below 2 Hz and drifts far below; faster
#: noise is known from single samples.
SEARCH_STEP: Final = 0.2

#: Fewest such steps of a record; shorter ones are searched on the smoother's own grid.
_FEWEST_STEPS = 40


def worth_a_coarse_search(durations: Sequence[float], coarse: float) -> bool:
    """Return whether records of these durations [s] are first searched and smoothed on a grid of
    `SEARCH_STEP` instead of `coarse` [s]."""
    return 2.0 * coarse < SEARCH_STEP and min(durations) >= _FEWEST_STEPS * SEARCH_STEP


@dataclass(frozen=True)
class Gusts:
    """Gust intensities, one sigma of each horizontal component and of the vertical one [m/s], and
    their correlation times [s]."""

    horizontal: float
    vertical: float
    horizontal_time: float
    vertical_time: float


@dataclass(frozen=True)
class Intensities:
    """Intensities of the random processes along a flight.

    gusts : intensities and correlation times.
    force_drift, gyro_drift : one sigma of the drift of accelerometers [m/s2] and gyros [rad/s].
    noise : channel -> one sigma of its block means, SI, for the channels that are used.
    """

    gusts: Gusts
    force_drift: float
    gyro_drift: float
    noise: Mapping[str, float]

    def of(self, channels: Sequence[str]) -> Array:
        """Return the noise (c,) of these channels, in SI units, infinite for those that are not
        used; array of `noise`."""
        return np.array([self.noise.get(name, np.inf) for name in channels])

    def scaled(self, factor: float) -> "Intensities":
        """Return the intensities with the noise of block means that are `factor` times as large: of
        blocks of ``1 / factor^2`` times as many samples."""
        return replace(self, noise={name: factor * size for name, size in self.noise.items()})


def transition(system: PathError, by: Intensities) -> Transition:
    """The state equation of a record with these intensities.

    by : gusts [m/s, s], drifts and noise, SI. Gives F, noise (m,) and first variances (m,).
    """
    m = system.observation.shape[2]
    diagonal, noise, first = np.ones(m), np.zeros(m), np.zeros(m)
    for part, sigma in zip((ATTITUDE, VELOCITY, POSITION), _UNKNOWN, strict=True):
        first[part] = sigma**2
    sizes, times = _markov(by)
    drifting = slice(GUST.start, FORCE.stop)
    first[drifting] = sizes**2
    diagonal[drifting] = np.exp(-system.step / times)
    noise[drifting] = sizes**2 * (1.0 - diagonal[drifting] ** 2)
    return Transition(
        system.rows, system.columns, system.values, diagonal, system.block, noise, first
    )


def measurement_variances(system: PathError, by: Intensities) -> Array:
    """Return noise variances (g, c) of the block means, in squared SI units, zero where nothing was
    measured; an array of `PathError.count`."""
    used = system.count > 0
    return np.where(used, by.of(system.channels) ** 2 / np.where(used, system.count, 1.0), 0.0)


def _markov(by: Intensities) -> tuple[Array, Array]:
    """One sigma (9,) and correlation time (9,) of gusts and drifts, in the order of the error
    states."""
    gusts = by.gusts
    sizes = [gusts.horizontal] * 2 + [gusts.vertical] + [by.gyro_drift] * 3 + [by.force_drift] * 3
    times = [gusts.horizontal_time] * 2 + [gusts.vertical_time] + [DRIFT_TIME] * 6
    return np.array(sizes), np.array(times)


def estimate_intensities(
    systems: Sequence[PathError],
    floor: Mapping[str, float] | None = None,
    coarser: Sequence[PathError] = (),
) -> Intensities:
    """Estimate the intensities of one flight from some of its records, with an exact gradient.

    Channels whose residuals remain coloured contain an effect that the model lacks (a scale error,
    a lag). They get the noise of `slow_noise`, and the rest is estimated again, so that no other
    process has to explain them.

    Parameters
    ----------
    systems : linear systems of the records.
    floor : channel -> smallest credible noise (one sigma) of a sample, SI.
    coarser : the same records on a coarser grid: the search is made there, and only its last steps
        on `systems`.
    """
    first = _Search.of(coarser or systems, floor)
    optimum = first.most_likely(_FIRST)
    slow = _slowest(first.systems, _intensities(optimum, first.names), first.names)
    coloured = slow > _COLOURED * np.exp(optimum[6:])
    noise = np.where(coloured, np.log(slow), optimum[6:])
    first = first.bounded(np.r_[optimum[:6], noise], coloured)
    optimum = first.most_likely()
    if coarser:
        shorter = 0.5 * np.log(coarser[0].size / systems[0].size)
        start = np.r_[optimum[:6], optimum[6:] + shorter]
        last = _Search.of(systems, floor).bounded(start, coloured)
        optimum = last.most_likely(_LAST)
    return _intensities(optimum, first.names)


@dataclass(frozen=True)
class _Search:
    """A search for the most likely intensities: records, channels, the start and bounds of the
    logarithms, and the threads that the records are smoothed in."""

    systems: Sequence[PathError]
    names: tuple[str, ...]
    start: Array
    low: Array
    high: Array
    expected: Array
    threads: Threads = field(default_factory=Threads)

    @classmethod
    def of(cls, systems: Sequence[PathError], floor: Mapping[str, float] | None) -> "_Search":
        """The search from what is expected beforehand and from the white noise."""
        names = tuple(dict.fromkeys(name for system in systems for name in _counting(system)))
        speed = float(
            np.mean([np.sqrt(np.sum(system.states[:3] ** 2, axis=0)).mean() for system in systems])
        )
        white = np.array([_white(systems, name) for name in names])
        root = np.sqrt(systems[0].size)
        known = np.array([(floor or {}).get(name, 0.0) / root for name in names])
        noise = np.maximum(white[:, 0], known)
        start = np.log(
            np.r_[_LIGHT, _LIGHT, _LENGTH / speed, _LENGTH / speed, _DRIFT, noise],
        )
        span = np.r_[_SPAN[:6], np.full(len(names), _SPAN[6])]
        low, high = start - span, start + span
        low[6:] = np.log(np.maximum(white[:, 1], known))
        expected = np.r_[np.log([_LIGHT]), 0.0, start[2], 0.0, np.log(_DRIFT)]
        return cls(systems, names, start, low, high, expected)

    def bounded(self, start: Array, coloured: NDArray[np.bool_]) -> "_Search":
        """From another start, and with the noise of coloured channels no smaller than there."""
        low = self.low.copy()
        low[6:] = np.where(coloured, start[6:], low[6:])
        high = np.maximum(self.high, low + 1.0)
        return replace(self, start=np.clip(start, low, high), low=low, high=high)

    def cost(self, vector: Array) -> tuple[float, Array]:
        """Negative logarithm of the posterior density, and its gradient."""
        by = _intensities(vector, self.names)
        value, slope = _expectation(vector, self.expected)

        likelihood = np.zeros(len(self.systems))
        rise = np.zeros((len(self.systems), len(vector)))

        def fill(number: int) -> None:
            system = self.systems[number]
            result = smooth(
                transition(system, by),
                system.residual[:, :, None],
                measurement_variances(system, by),
                system.observation,
            )
            likelihood[number] = result.log_likelihood
            rise[number] = _slope(system, by, result.score, self.names)

        self.threads.each(fill, range(len(self.systems)))
        return value - float(likelihood.sum()), slope - rise.sum(axis=0)

    def most_likely(self, enough: float = _ENOUGH) -> Array:
        """Logarithms of the intensities that maximise the posterior, within bounds.

        enough : gain of log-likelihood that ends the search.
        """
        # in units of about one standard error each, so that a quasi-Newton search needs few steps
        unit = 1.0 / np.sqrt(1.0 + self._expected_information())
        start = self.with_expected_noise().start

        def scaled(vector: Array) -> tuple[float, Array]:
            value, slope = self.cost(start + unit * vector)
            return value, unit * slope

        at_start = scaled(np.zeros(len(unit)))
        gain = enough / max(abs(at_start[0]), 1.0)
        limits = list(
            zip(
                ((self.low - start) / unit).tolist(),
                ((self.high - start) / unit).tolist(),
                strict=True,
            )
        )

        def known_at_start(vector: Array) -> tuple[float, Array]:
            return scaled(vector) if vector.any() else at_start

        optimum = minimize(
            known_at_start,
            np.zeros(len(unit)),
            jac=True,
            method="L-BFGS-B",
            bounds=limits,
            options={"maxiter": _PASSES, "ftol": gain},
        )
        found = np.round(start + unit * optimum.x, 3)
        # finer than the data determine, coarser than rounding errors
        return np.asarray(np.clip(found, self.low, self.high))

    def with_expected_noise(self) -> "_Search":
        """The search from the noise after one expectation-maximisation step, which raises the
        likelihood from wherever it is: n measurements with the variance R then have the variance
        ``R (1 + (d log-likelihood / d log sigma) / n)`` (Koopman & Shephard 1992)."""
        measured = 0.5 * self._expected_information()[6:]
        grown = 1.0 - self.cost(self.start)[1][6:] / measured
        start = self.start.copy()
        start[6:] += 0.5 * np.log(np.maximum(grown, _FAINT))
        return replace(self, start=np.clip(start, self.low, self.high))

    def _expected_information(self) -> Array:
        """About the Fisher information of the logarithms: 2 n for the noise of n measurements, as
        many independent values as correlation times for gusts, one per record for drifts."""
        measured = [
            sum(
                float(np.count_nonzero(system.count[:, system.channels.index(name)]))
                for system in self.systems
                if name in system.channels
            )
            for name in self.names
        ]
        duration = sum(len(system.at) * system.step for system in self.systems)
        gusts = 0.5 * duration / float(np.exp(self.expected[2]))
        drifts = np.full(2, float(len(self.systems)))
        return np.r_[np.full(4, gusts), drifts, 2.0 * np.array(measured)]


def with_missing_noise(by: Intensities, system: PathError) -> Intensities:
    """Return the intensities with the noise (one sigma per sample, SI units) of channels that are
    used in this record but in none of those that the intensities were estimated from."""
    more = {name: _white([system], name)[0] for name in _counting(system) if name not in by.noise}
    return replace(
        by,
        noise={
            name: size for name, size in {**by.noise, **more}.items() if name in _counting(system)
        },
    )


def _counting(system: PathError) -> tuple[str, ...]:
    """Channels with at least one measurement."""
    return tuple(
        name
        for name, used in zip(system.channels, np.any(system.count > 0, axis=0), strict=True)
        if used
    )


def slow_noise(system: PathError, left: Array, name: str) -> float:
    """Return one sigma (a scalar, SI units) of white noise with the same low-frequency power as a
    channel's residual.

    The variance is ``s^2 (1 + r)/(1 - r)`` for a lag-one autocorrelation r. It refers to whole
    blocks and is zero if fewer than eight were measured. left : (g, c) residual after smoothing.
    """
    column = system.channels.index(name)
    count = system.count[:, column]
    values = left[count > 0, column]
    if len(values) < 8:
        return 0.0
    square = float(np.mean(values**2))
    alike = float(np.clip(np.mean(values[1:] * values[:-1]) / max(square, 1e-300), 0.0, _SLOWEST))
    return float(np.sqrt(square * np.mean(count[count > 0]) * (1.0 + alike) / (1.0 - alike)))


def _slowest(systems: Sequence[PathError], by: Intensities, names: Sequence[str]) -> Array:
    """Root mean square over the records of each channel's `slow_noise` after smoothing."""
    squares: list[list[float]] = [[] for _ in names]
    for system in systems:
        result = smooth(
            transition(system, by),
            system.residual[:, :, None],
            measurement_variances(system, by),
            system.observation,
        )
        left = residual_after_smoothing(
            system, system.residual, system.observation, result.states[:, :, 0]
        )
        for name in _counting(system):
            squares[names.index(name)].append(slow_noise(system, left, name) ** 2)
    return np.maximum([np.sqrt(np.mean(each)) for each in squares], _FAINT)


def residual_after_smoothing(
    system: PathError, measured: Array, observation: Array, error: Array
) -> Array:
    """(g, c) residual after smoothing, meaningless where nothing was measured.

    measured : (g, c), SI. observation : (g, c, m). error : (g, m), smoothed error states.
    """
    return measured - np.asarray(np.einsum("gcm,gm->gc", observation, error))


def adapted_gusts(by: Intensities, result: SmootherPass) -> Intensities:
    """The intensities with the gusts of one record: one expectation-maximisation step from those of
    its flight (Shumway & Stoffer, J. Time Series Anal. 3(4), 1982).

    result : a pass with the variances of `GUST`.

    Gusts [m/s].
    """
    square = np.mean(result.states[:, GUST, 0] ** 2 + result.variance, axis=0)
    horizontal, vertical = float(np.sqrt(square[:2].mean())), float(np.sqrt(square[2]))
    return replace(by, gusts=replace(by.gusts, horizontal=horizontal, vertical=vertical))


def variance_within_step(gusts: Gusts, step: float) -> Array:
    """(3,) variance [m2/s2] of the gusts about their mean within a block of length `step` [s]:
    ``s^2 step / (3 tau)``, that of a random walk."""
    horizontal, vertical = (
        gusts.horizontal**2 / gusts.horizontal_time,
        gusts.vertical**2 / gusts.vertical_time,
    )
    return np.array([horizontal, horizontal, vertical]) * step / 3.0


def _white(systems: Sequence[PathError], name: str) -> tuple[float, float]:
    """White part of a channel's block means (one sigma), from second differences of the means and
    from those of single samples.

    The first contains part of the gusts as well. If it is the smaller one, single samples contain
    an oscillation that averages out; the second is then limited to the first.
    """
    coarse, fine = [], []
    for system in systems:
        if name in _counting(system):
            column = system.channels.index(name)
            count, single = system.count[:, column], system.path.residuals[name]
            means = system.residual[count > 0, column]
            coarse.append(np.diff(means, 2) ** 2 * np.mean(count[count > 0]))
            fine.append(np.diff(single[np.isfinite(single)], 2) ** 2 / system.size)
    first, second = (
        max(float(np.sqrt(np.mean(np.concatenate(squares)) / 6.0)), _FAINT)
        for squares in (coarse, fine)
    )
    return first, min(first, second)


def _intensities(vector: Array, names: Sequence[str]) -> Intensities:
    sizes = np.exp(vector)
    return Intensities(
        Gusts(*map(float, sizes[:4])),
        float(sizes[4]),
        float(sizes[5]),
        dict(zip(names, map(float, sizes[6:]), strict=True)),
    )


def _expectation(vector: Array, expected: Array) -> tuple[float, Array]:
    """Negative log prior density, and its gradient."""
    rows = np.zeros((6, len(vector)))
    rows[0, 0], rows[1, :2], rows[2, 2], rows[3, 2:4] = 1.0, (-1.0, 1.0), 1.0, (-1.0, 1.0)
    rows[4, 4], rows[5, 5] = 1.0, 1.0
    off = (rows @ vector - expected) / _WIDTHS
    return 0.5 * float(off @ off), rows.T @ (off / _WIDTHS)


def _slope(system: PathError, by: Intensities, score: Score, names: Sequence[str]) -> Array:
    """Gradient of a record's log-likelihood by the logarithms of all intensities."""
    part = slice(GUST.start, FORCE.stop)
    sizes, times = _markov(by)
    phi = np.exp(-system.step / times)
    by_size = score.noise[part] * sizes**2 * (1.0 - phi**2) + score.first[part] * sizes**2
    by_time = (
        (score.diagonal[part] - score.noise[part] * sizes**2 * phi) * phi * system.step / times
    )
    slope = np.zeros(6 + len(names))
    slope[:6] = (
        by_size[:2].sum(),
        by_size[2],
        by_time[:2].sum(),
        by_time[2],
        by_size[6:].sum(),
        by_size[3:6].sum(),
    )
    for name in _counting(system):
        column = system.channels.index(name)
        slope[6 + names.index(name)] += 2.0 * score.measurement[column]
    return slope
