"""The likelihood that a Kalman filter gives, as a function of parameters, process noise and
measurement noise."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.filters.filtering import FilterPass, NoiseLevels, follow, run_filter
from aerodb.estimation.filters.linearisation import Linearised, linearised, measured_motion
from aerodb.estimation.linear_models import LinearModel
from aerodb.estimation.parameters import bounds_of, priors_of
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: ``diagonal`` or ``full``: covariance of the measurement noise, without or with correlation
#: between outputs; ``innovations``: the diagonal one of the innovations, which gives the gain.
Covariance = Literal["diagonal", "full", "innovations"]

#: Times that the motion along which a model is linearised is renewed before the search.
_RENEWED = 6
#: Change of the log-likelihood at which the motion stays.
STAYS = 0.01


@dataclass(frozen=True, eq=False)
class Point:
    """Where the likelihood is evaluated.

    Parameters
    ----------
    vector : (f,), the unknown parameters.
    process : (s,), square roots of the intensities of the process noise.
    measurement : (o, o), covariance of the measurement noise.
    """

    vector: Array
    process: Array
    measurement: Array


@dataclass(frozen=True, eq=False)
class Slopes:
    """Innovations of one record in units of their deviations, and their derivatives.

    Parameters
    ----------
    columns : (g,), which unknowns of the search the record depends on.
    innovations : (n, o). mean : (n, o, g), derivative of the innovations over their deviation.
    variance : (n, o, g), derivative of the logarithm of their variances.
    """

    columns: NDArray[np.int64]
    innovations: Array
    mean: Array
    variance: Array


@dataclass(frozen=True, eq=False)
class FilterProblem:
    """Model, records and what of the noise is estimated.

    Parameters
    ----------
    disturbed : (p,), states whose process noise is estimated.
    covariance : see `Covariance`.
    least : (o,), variances that diagonal measurement noise keeps.
    steady : see `run_filter`.
    along : the model linearised along the motion of each record; empty for a linear model, and
        before the search.
    """

    model: DynamicModel
    records: tuple[TimeHistory, ...]
    disturbed: tuple[int, ...]
    covariance: Covariance
    least: Array
    steady: bool
    along: tuple[Linearised, ...] = ()

    @property
    def full(self) -> bool:
        """Whether the measurement noise of different outputs may be correlated."""
        return self.covariance == "full"

    @property
    def noises(self) -> int:
        """Number of unknowns of the measurement noise: o logarithms, or all of a matrix (o, o)."""
        o = len(self.model.outputs)
        return o * (o + 1) // 2 if self.full else o

    def columns(self, record: TimeHistory) -> NDArray[np.int64]:
        """Numbers of the unknowns that a record depends on: parameters of other records do not
        count. Numbers (g,) among the u unknowns of the search."""
        others = tuple(f"[{other.name}]" for other in self.records if other.name != record.name)
        unknown = self.model.parameters.unknown
        own = [j for j, item in enumerate(unknown) if not (others and item.name.endswith(others))]
        more = np.arange(len(unknown), len(unknown) + len(self.disturbed) + self.noises)
        return np.concatenate([np.array(own, dtype=np.int64), more])

    def passed(self, record: TimeHistory, point: Point, moves: Array) -> FilterPass:
        """Run the filter at a point displaced by each of the moves (u, k): of parameters by
        differences, of the noise by differences of logarithms. Units are those of the parameters
        (SI), and logarithms without a unit for the noise. One run per column, k in all:
        `FilterPass` (n, o, k)."""
        f, p = len(point.vector), len(self.disturbed)
        process = np.repeat(point.process[:, None], moves.shape[1], axis=1)
        process[list(self.disturbed)] *= np.exp(moves[f : f + p])
        noise = NoiseLevels(
            process,
            self._measurement(point.measurement, moves[f + p :]),
            self.covariance == "innovations",
        )
        vectors = point.vector[:, None] + moves[:f]
        if isinstance(self.model, LinearModel):
            return run_filter(
                self.model, self.model.parameters.values(vectors), record, noise, self.steady
            )
        return follow(self.along[self.records.index(record)], vectors, noise, self.steady)

    @property
    def unmoved(self) -> Array:
        """A move (u, 1) of nothing: one column of zeros, whatever the unknowns' units."""
        return np.zeros((len(self.model.parameters.unknown) + len(self.disturbed) + self.noises, 1))

    def about(self, point: Point, derivatives: bool = True) -> "FilterProblem":
        """The same, linearised along the motion that the filter sees at a point, or at first along
        the measured one; a linear model is what it is.

        derivatives : by the unknowns; without them, only the point itself can be evaluated.
        """
        if isinstance(self.model, LinearModel):
            return self
        motions = [
            self.passed(record, point, self.unmoved).states[:, :, 0]
            if self.along
            else measured_motion(self.model, record, point.vector)
            for record in self.records
        ]
        along = [
            linearised(self.model, record, point.vector, motion, derivatives)
            for record, motion in zip(self.records, motions, strict=True)
        ]
        return replace(self, along=tuple(along))

    def likelihood_at(self, point: Point) -> float:
        """Log-likelihood with priors at a point, of the filter that is linearised there. A natural
        logarithm without unit; -inf where the filter diverges."""
        problem = self.settled(point, False)
        return float(problem.likelihood(point, problem.unmoved)[0])

    def settled(self, point: Point, derivatives: bool = True) -> "FilterProblem":
        """Linearised along the motion of which the filter at a point makes the same motion."""
        problem, before = self, -np.inf
        for _ in range(0 if isinstance(self.model, LinearModel) else _RENEWED):
            problem = problem.about(point, False)
            now = float(problem.likelihood(point, problem.unmoved)[0])
            if not abs(now - before) > STAYS:
                break
            before = now
        return problem.about(point) if derivatives else problem

    def _measurement(self, centre: Array, moves: Array) -> Array:
        """``G exp(X) G'`` (o, o, k), with the centre ``G G'`` and X made of the moves (r, k)."""
        o = len(centre)
        root = np.linalg.cholesky(centre)
        rows, columns = np.tril_indices(o) if self.full else (np.arange(o), np.arange(o))
        matrix = np.zeros((moves.shape[1], o, o))
        matrix[:, rows, columns] = moves.T
        matrix[:, columns, rows] = moves.T
        values, vectors = np.linalg.eigh(matrix)
        wide = root @ vectors
        whole = (wide * np.exp(values)[:, None, :]) @ np.swapaxes(wide, 1, 2)
        if not self.full:
            whole[:, rows, rows] = np.maximum(whole[:, rows, rows], self.least)
        return np.ascontiguousarray(np.moveaxis(whole, 0, -1))

    def moved(self, point: Point, move: Array) -> Point:
        """Return the point displaced by one move (u,). Parameters in SI units, clipped to their
        bounds; noise as logarithms without a unit."""
        f, p = len(point.vector), len(self.disturbed)
        lower, upper = bounds_of(self.model.parameters.unknown)
        process = point.process.copy()
        process[list(self.disturbed)] *= np.exp(move[f : f + p])
        return Point(
            np.clip(point.vector + move[:f], lower, upper),
            process,
            self._measurement(point.measurement, move[f + p :, None])[:, :, 0],
        )

    def penalty(self, vectors: Array) -> Array:
        """Return what the priors take from the log-likelihood at vectors (f, k), (k,), without
        unit; 0 for a parameter without a prior, whose error is inf."""
        prior, error = priors_of(self.model.parameters.unknown)
        return np.asarray(0.5 * (((vectors - prior[:, None]) / error[:, None]) ** 2).sum(axis=0))

    def likelihood(self, point: Point, moves: Array) -> Array:
        """Log-likelihood with priors (k,) at a point displaced by moves (u, k). A natural logarithm
        without unit; -inf where the filter diverges."""
        total = -self.penalty(point.vector[:, None] + moves[: len(point.vector)])
        for record in self.records:
            total = total + self.passed(record, point, moves).log_likelihood
        return total

    def slopes(self, record: TimeHistory, point: Point, steps: Array) -> tuple[Slopes, FilterPass]:
        """Return innovations (n, o) of a record and their derivatives (n, o, g), by differences of
        steps (u,). Units are one over those of the unknowns."""
        columns = self.columns(record)
        moves = np.zeros((len(steps), len(columns) + 1))
        moves[columns, np.arange(1, len(columns) + 1)] = steps[columns]
        passed = self.passed(record, point, moves)
        deviation = np.sqrt(passed.variances[:, :, :1])
        mean = (passed.innovations[:, :, 1:] - passed.innovations[:, :, :1]) / deviation
        variance = passed.variances[:, :, 1:] / passed.variances[:, :, :1] - 1.0
        made = Slopes(
            columns,
            passed.innovations[:, :, 0] / deviation[:, :, 0],
            mean / steps[columns],
            variance / steps[columns],
        )
        centre = FilterPass(*(values[..., :1].copy() for values in _parts(passed)))
        return made, centre


def _parts(passed: FilterPass) -> tuple[Array, Array, Array, Array]:
    return passed.innovations, passed.variances, passed.predicted, passed.states
