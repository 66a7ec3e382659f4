"""Minimise the cost of a reconstruction by Gauss-Newton with bounds and Levenberg damping."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.output_error.normal_equations import ChannelNormalEquations, accumulate
from aerodb.consistency.sensors import MAX_DELAY, FlightRecord, SensorParameter, thinned, unknowns
from aerodb.errors import InputError
from aerodb.support import Array

#: Largest number of iterations.
MOST_ITERATIONS = 100

#: Converged if no step exceeds this fraction of its standard error.
SMALL_STEP = 1e-3
#: Converged if the log-likelihood gains less than this.
SMALL_GAIN = 1e-4

#: This many successive steps that gain less than `NO_GAIN` also end the search.
_IDLE = 4
#: Gain of log-likelihood that counts for nothing: a likelihood ratio of 1 % is no evidence.
NO_GAIN = 1e-2

#: Damping (fraction of the diagonal) below which a step counts as undamped.
_LIGHT = 1e-2

#: Interval of the samples that the first steps of a search use [s]: the motion is integrated at the
#: full rate, but the sensors are compared at few points.
THIN_STEP = 0.2
#: Fewest such samples of a record.
_FEWEST = 50

#: Gain of log-likelihood with which a search over thinned samples ends: it is only a start.
ROUGH_GAIN = 1.0

#: Expected gain of log-likelihood below which a step is the last one, and is taken without summing
#: once more: half the square of its length in standard errors, all unknowns together, and what
#: remains after it is of second order.
SETTLED = 1e-2

#: Default bound of scales: a sensor with a larger scale error measures something else.
LARGEST_SCALE = 0.5


@dataclass(frozen=True)
class ReconstructionProblem:
    """What is to be solved, with k unknowns.

    records : stretches of flight. starts : their initial states, (9,) each.
    items : the unknowns. fixed : other parameters, name -> value, SI.
    prior : (k,), standard deviations about zero (inf: no prior). lower, upper : (k,), bounds.
    noise_floor : channel -> smallest credible noise (one sigma), SI.
    drivers : the records at full rate, where `records` are thinned.
    """

    records: tuple[FlightRecord, ...]
    starts: tuple[Array, ...]
    items: tuple[SensorParameter, ...]
    fixed: Mapping[str, float]
    prior: Array
    lower: Array
    upper: Array
    noise_floor: Mapping[str, float]
    drivers: tuple[FlightRecord, ...] | None = None

    def sums(self, vector: Array) -> ChannelNormalEquations:
        """The sums of the normal equations (k, k) at the unknowns `vector` (k,), SI; see
        `accumulate`."""
        return accumulate(self.records, self.starts, self.items, vector, self.fixed, self.drivers)

    def thinned(self) -> "ReconstructionProblem | None":
        """Return the problem with samples `THIN_STEP` [s] apart, for the first steps of a search;
        None where that would lose a channel, or where there is little to save."""
        every = int(THIN_STEP / self.records[0].step + 1e-9)
        if every < 2 or any(
            record.given or len(record.inputs) < every * _FEWEST for record in self.records
        ):
            return None
        records = tuple(thinned(record, every) for record in self.records)
        for record, whole in zip(records, self.records, strict=True):
            for name, values in record.outputs.items():
                left = np.count_nonzero(np.isfinite(values))
                if 2 * every * left < np.count_nonzero(np.isfinite(whole.outputs[name])):
                    return None
        return replace(self, records=records, drivers=self.records)

    def cost(self, vector: Array, sums: ChannelNormalEquations) -> float:
        """Negative log of the posterior density at `vector` (k,), SI, without constants.

        sums : at that vector. It is `ChannelNormalEquations.cost` plus half the squares of `vector`
        over its priors.
        """
        return sums.cost(self.noise_floor) + 0.5 * float(np.sum((vector / self.prior) ** 2))


@dataclass(frozen=True)
class ReconstructionSolution:
    """Result of the search: the unknowns `vector` (k,), the normal equations there or one last
    insignificant step before, whether the
    search converged, and the number of iterations."""

    vector: Array
    equations: ChannelNormalEquations
    converged: bool
    iterations: int


def make_problem(
    records: Sequence[FlightRecord],
    free: Sequence[str],
    initial: Sequence[str],
    fixed: Mapping[str, float] | None,
    priors: Mapping[str, float] | None,
    bounds: Mapping[str, tuple[float, float]] | None,
    noise_floor: Mapping[str, float] | None,
    starts: Sequence[Array] | None,
) -> ReconstructionProblem:
    """The problem of `reconstruction.reconstruct`, whose arguments these are.

    Gives k unknowns with priors (k,) and bounds (k,), SI. Raises InputError without records, or
    with two of one name.
    """
    names = [record.name for record in records]
    if not records or len(set(names)) < len(names):
        raise InputError(
            "records must have unique names, and be at least one",
            "reconstruction",
            "name them apart",
        )
    measured = {name for record in records for name in record.outputs}
    wanted = [
        *free,
        *(
            f"initial_{state}"
            for state in initial
            if not any(state in record.given for record in records)
        ),
    ]
    items = unknowns(wanted, [record.flight for record in records], names)
    limit = bounds or {}
    usual = {"delay": (-MAX_DELAY, MAX_DELAY), "scale": (-LARGEST_SCALE, LARGEST_SCALE)}
    span = np.array(
        [limit.get(item.name, usual.get(item.kind, (-np.inf, np.inf))) for item in items]
    ).reshape(-1, 2)
    sigma = np.array([(priors or {}).get(item.name, np.inf) for item in items])
    first = (
        tuple(starts)
        if starts is not None
        else tuple(first_states(record, fixed) for record in records)
    )
    noise_floor = {name: value for name, value in (noise_floor or {}).items() if name in measured}
    return ReconstructionProblem(
        tuple(records), first, items, dict(fixed or {}), sigma, span[:, 0], span[:, 1], noise_floor
    )


def information(
    problem: ReconstructionProblem,
    sums: ChannelNormalEquations,
    noise: Mapping[str, float] | None = None,
) -> Array:
    """(k, k) information matrix of the unknowns: measurements and priors.

    Inverse squares of SI units; each channel is divided by its variance `noise` (channel ->
    variance, SI; None: that of its residual), priors add to the diagonal.
    """
    noise = sums.variance(problem.noise_floor) if noise is None else noise
    total = np.diag(problem.prior**-2.0)
    for name, part in sums.information.items():
        total = total + part / noise[name]
    return total


def search(
    problem: ReconstructionProblem,
    vector: Array,
    least_gain: float = SMALL_GAIN,
    close: bool = False,
    noise: Mapping[str, float] | None = None,
) -> ReconstructionSolution:
    """Iterate from `vector` (k,) to convergence, first over thinned samples.

    least_gain : gain of log-likelihood below which a step ends the search.
    close : the start is within a few standard errors of the optimum; thinned samples, which are
        fewer, would not lead closer.
    noise : channel -> one sigma (SI) that the same sensors had elsewhere, for the first step from a
        start that is not close; None: that of the residuals there.
    """
    brief = None if close else problem.thinned()
    if brief is not None:
        with suppress(InputError):  # no usable sample of a channel is left
            rough = max(ROUGH_GAIN, least_gain)
            vector = gauss_newton(brief, vector, brief.sums(vector), rough, noise).vector
    return gauss_newton(problem, vector, problem.sums(vector), least_gain)


def gauss_newton(
    problem: ReconstructionProblem,
    vector: Array,
    sums: ChannelNormalEquations,
    least_gain: float = SMALL_GAIN,
    known: Mapping[str, float] | None = None,
) -> ReconstructionSolution:
    """Iterate from `vector` (k,) to convergence; damping grows when the likelihood does not improve
    and fades when it does. A step that is expected to gain less than `SETTLED` is the last; the
    sums are those before it.

    least_gain : gain of log-likelihood below which a step ends the search.
    known : channel -> one sigma (SI) that weighs the first step. A start that is far off makes all
        residuals large, and their ratios say nothing of the sensors.
    """
    damping, cost, idle = 0.0, problem.cost(vector, sums), 0
    size = np.array([item.size for item in problem.items])
    for iteration in range(1, MOST_ITERATIONS + 1):
        noise = sums.variance(problem.noise_floor)
        if iteration == 1 and known is not None:
            noise |= {name: known[name] ** 2 for name in noise if name in known}
        matrix = information(problem, sums, noise)
        slope = (
            sum((sums.gradient[name] / noise[name] for name in noise), np.zeros(len(vector)))
            - vector / problem.prior**2
        )
        stuck = ((vector <= problem.lower) & (slope < 0)) | (
            (vector >= problem.upper) & (slope > 0)
        )
        go = np.flatnonzero(~stuck)
        step, error = _step(matrix[np.ix_(go, go)], slope[go], size[go], damping)
        trial = vector.copy()
        trial[go] = np.clip(vector[go] + step, problem.lower[go], problem.upper[go])
        if damping < _LIGHT and 0.5 * float(slope[go] @ step) < SETTLED:
            return ReconstructionSolution(trial, sums, True, iteration)
        try:
            after = problem.sums(trial)
            better = problem.cost(trial, after)
        except InputError:
            better = np.inf
        if better <= cost + 1e-9 * abs(cost):
            small = len(go) == 0 or bool(
                np.max(np.abs(trial[go] - vector[go]) / error) < SMALL_STEP
            )
            small = small or cost - better < least_gain
            idle = idle + 1 if cost - better < max(NO_GAIN, least_gain) else 0
            vector, sums, cost = trial, after, better
            if (small and damping < _LIGHT) or idle == _IDLE:
                return ReconstructionSolution(vector, sums, True, iteration)
            damping = 0.0 if damping < 1e-6 else damping / 3
        else:
            _, sure = _step(matrix[np.ix_(go, go)], slope[go], size[go], 0.0)
            if np.max(np.abs(trial[go] - vector[go]) / sure) < SMALL_STEP:
                # no step of a size that matters lowers the cost: a minimum, if a sharp one
                return ReconstructionSolution(vector, sums, True, iteration)
            damping = max(4 * damping, 1e-4)
    return ReconstructionSolution(vector, sums, False, iteration)


def _step(matrix: Array, slope: Array, size: Array, damping: float) -> tuple[Array, Array]:
    """Damped Newton step (k,) and standard errors (k,), solved in natural sizes."""
    scaled = matrix * np.outer(size, size)
    ridge = damping * np.diag(np.diag(scaled)) + 1e-12 * np.trace(scaled) / max(
        len(size), 1
    ) * np.eye(len(size))
    inverse = np.linalg.inv(scaled + ridge)
    return size * (inverse @ (size * slope)), size * np.sqrt(np.diag(inverse))
