"""Maximum likelihood by Gauss-Newton steps with Levenberg-Marquardt damping, bounds, priors and
equality constraints."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.output_error.likelihood import (
    Beside,
    Covariance,
    MeasuredOutputs,
    Noise,
    Normal,
    measured,
    no_equations,
    noise_of,
    normal_equations,
)
from aerodb.estimation.output_error.sensitivities import (
    ModelResponse,
    differentiable,
    first_steps,
    respond,
)
from aerodb.estimation.parameters import Parameters, bounds_of, priors_of
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, Mask, in_threads

#: Directions in which the information, scaled to a unit diagonal, is below this are not moved.
SINGULAR = 1e-10
#: Converged if no step exceeds this share of its standard error.
_SMALL_STEP = 1e-3
#: Differences of the parameters, as a share of the standard error that each would have alone.
_DIFFERENCE = 0.05
#: Damping below which a step counts as undamped.
_LIGHT = 1e-2
#: Damping at which the search gives up.
_HEAVY = 1e8
#: Least curvature of the likelihood that a step counts on, as a share of the information.
_CONVEX = 0.02
#: Steps after which a search has its pace, and how much faster it may yet become: along a ridge,
#: searches that came to an end were four times faster there than after these steps.
_PACED, _FASTER = 8, 10.0
#: Gain of log-likelihood that is expected where no step lowers the cost any more: an optimum.
_NO_GAIN = 1e-3


@dataclass(frozen=True, eq=False)
class OutputErrorSolution:
    """Where a search ended.

    vector : (f,) unknowns. responses, noise, normal : there. information : (f, f) with priors and
    what is held. beside : what the cost holds beside the likelihood. converged : at an optimum.
    iterations : steps taken.
    """

    vector: Array
    records: tuple[MeasuredOutputs, ...]
    responses: tuple[ModelResponse, ...]
    noise: Noise
    normal: Normal
    information: Array
    beside: Beside
    converged: bool
    iterations: int


@dataclass(frozen=True, eq=False)
class _State:
    vector: Array
    responses: tuple[ModelResponse, ...]
    noise: Noise
    cost: float


class _Search:
    """The problem in the form of the steps."""

    def __init__(
        self,
        model: DynamicModel,
        records: Sequence[TimeHistory],
        covariance: Covariance,
        beside: Beside,
    ) -> None:
        self.model, self.histories, self.kind = model, tuple(records), covariance
        self.beside = beside
        self.parameters: Parameters = model.parameters
        self.quick = differentiable(model)  # threads would take longer to start
        self.lower, self.upper = bounds_of(self.parameters.unknown)
        self.prior, self.prior_error = priors_of(self.parameters.unknown)
        self.records = tuple(measured(record.stacked(model.outputs)) for record in records)

    def at(self, vector: Array, steps: Array) -> _State:
        def one(history: TimeHistory) -> ModelResponse:
            return respond(self.model, self.parameters, vector, history, steps)

        return self._state(vector, self._of_each(one))

    def _of_each(self, one: Callable[[TimeHistory], ModelResponse]) -> tuple[ModelResponse, ...]:
        each = map(one, self.histories) if self.quick else in_threads(one, self.histories)
        return tuple(each)

    def worse(self, vector: Array, cost: float) -> bool:
        """Return whether the outputs alone show that a step to `vector` raises the cost:
        derivatives that would be thrown away are not computed."""
        return self.outputs_only(vector).cost > cost + 1e-9 * abs(cost)

    def outputs_only(self, vector: Array) -> _State:
        """The state at `vector` without derivatives."""
        values, none = self.parameters.values(vector), np.zeros(0)

        def one(history: TimeHistory) -> ModelResponse:
            outputs = self.model.simulated(values, history)[:, :, 0]
            return ModelResponse(outputs, none, none.astype(np.int64), none, none)

        return self._state(vector, self._of_each(one))

    def _state(self, vector: Array, responses: tuple[ModelResponse, ...]) -> _State:
        o = len(self.model.outputs)
        if not all(np.isfinite(r.outputs[m.mask]).all() for r, m in self._pairs(responses)):
            return _State(
                vector, responses, Noise(np.eye(o) * np.nan, np.zeros(o), -np.inf), np.inf
            )
        residuals = [record.residual(r.outputs) for r, record in self._pairs(responses)]
        with np.errstate(over="ignore", invalid="ignore"):
            noise = noise_of(self.records, residuals, self.kind)
        away = (vector - self.prior) / self.prior_error
        cost = 0.5 * float(away @ away) - noise.log_likelihood
        return _State(vector, responses, noise, cost if np.isfinite(cost) else np.inf)

    def _pairs(
        self, responses: Sequence[ModelResponse]
    ) -> list[tuple[ModelResponse, MeasuredOutputs]]:
        return list(zip(responses, self.records, strict=True))

    def equations(self, state: _State) -> tuple[Normal, Array, Array]:
        """Normal equations, and information (f, f) and gradient (f,) with priors."""
        normal = normal_equations(
            self.records, state.responses, state.noise, len(state.vector), self.kind, self.beside
        )
        information = normal.information + np.diag(self.prior_error**-2.0)
        if self.beside.held is not None:
            information = information + self.beside.held
        gradient = normal.gradient - (state.vector - self.prior) / self.prior_error**2
        return normal, information, gradient

    def steps(self, vector: Array, information: Array) -> Array:
        """Differences (f,): small against what the noise hides."""
        alone = np.diag(information)
        with np.errstate(divide="ignore"):
            steps = np.where(alone > 0, _DIFFERENCE / np.sqrt(alone), np.inf)
        return np.minimum(steps, 10.0 * first_steps(vector))


def likelihood_of_start(
    model: DynamicModel, records: Sequence[TimeHistory], covariance: Covariance
) -> float:
    """Return the log-likelihood (a scalar) with priors at a model's start values; -inf where it
    diverges. A natural logarithm without unit."""
    return (
        -_Search(model, records, covariance, Beside()).outputs_only(model.parameters.start()).cost
    )


def search(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    covariance: Covariance = "diagonal",
    most_iterations: int = 50,
    beside: Beside | None = None,
    at_least: float = -np.inf,
) -> OutputErrorSolution:
    """Iterate from the start values of the model's parameters.

    Each step solves the normal equations with the noise covariance of the residuals as they are; it
    is damped more when the likelihood falls, and less when it rises. beside : of a cost whose end
    is known already; steps are those of the likelihood alone. at_least : log-likelihood below which
    an end is of no use: a search that does not come there at its pace is ended.

    Vector (f,) in SI units. A search without an end, or from a start that diverges, has not
    converged. Klein & Morelli, Aircraft System Identification, 2016, chapter 6.
    """
    problem = _Search(model, records, covariance, beside or Beside())
    vector = model.parameters.start()
    state = problem.at(vector, first_steps(vector))
    if not np.isfinite(state.cost):
        empty = no_equations(len(vector))
        return _solution(problem, state, empty, empty.information, False, 0)
    normal, information, gradient = problem.equations(state)
    damping, iteration, converged, penalty = 0.0, 0, len(vector) == 0, 0.0
    while not converged and iteration < most_iterations and damping < _HEAVY:
        iteration += 1
        go = ~(
            ((state.vector <= problem.lower) & (gradient < 0))
            | ((state.vector >= problem.upper) & (gradient > 0))
        )
        step, multipliers = _step(information, gradient, normal, go, damping)
        trial = np.clip(state.vector + step, problem.lower, problem.upper)
        step = trial - state.vector
        penalty = max(penalty, 2.0 * float(np.abs(multipliers).max(initial=0.0)))
        error = np.linalg.norm(projected(information, normal, go), axis=1)
        small = bool(np.all(np.abs(step[go]) <= _SMALL_STEP * error[go]))
        converged = small and damping < _LIGHT and not len(normal.gaps)
        if converged:
            break
        before = state.cost + penalty * float(np.abs(normal.gaps).sum())
        after, now = state, np.inf
        unsure = damping > (0.0 if problem.quick else _LIGHT) and not len(normal.gaps)
        if not (unsure and problem.worse(trial, before)):
            after = problem.at(trial, problem.steps(trial, information))
            now = after.cost + penalty * _gap(after.responses)
        if now <= before + 1e-9 * abs(before) or (small and damping < _LIGHT and now < np.inf):
            converged = small and damping < _LIGHT
            pace, state = state.cost - after.cost, after
            normal, information, gradient = problem.equations(state)
            damping = 0.0 if damping < 0.02 else damping / 5.0
            coming = _FASTER * pace * (most_iterations - iteration)
            if iteration >= _PACED and damping > _LIGHT and state.cost + at_least > coming:
                break
        else:
            expected = 0.5 * float(gradient @ step)
            converged = damping > _LIGHT and 0.0 <= expected < _NO_GAIN and not len(normal.gaps)
            damping = max(10.0 * damping, 0.1)
    return _solution(problem, state, normal, information, converged, iteration)


def equations_with(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    solution: OutputErrorSolution,
    covariance: Covariance,
) -> Normal:
    """Return the normal equations (f, f) and (f,) at a solution, in its noise, of records that may
    have other inputs than its own; NaN where they cannot be flown."""
    problem = _Search(model, records, covariance, solution.beside)
    steps = problem.steps(solution.vector, solution.information)
    responses = problem.at(solution.vector, steps).responses
    return normal_equations(
        problem.records,
        responses,
        solution.noise,
        len(solution.vector),
        covariance,
        solution.beside,
    )


def _solution(
    problem: _Search,
    state: _State,
    normal: Normal,
    information: Array,
    converged: bool,
    iterations: int,
) -> OutputErrorSolution:
    return OutputErrorSolution(
        state.vector,
        problem.records,
        state.responses,
        state.noise,
        normal,
        information,
        problem.beside,
        converged,
        iterations,
    )


def _gap(responses: Sequence[ModelResponse]) -> float:
    return float(sum(np.abs(response.gaps).sum() for response in responses))


def _step(
    information: Array, gradient: Array, normal: Normal, go: Mask, damping: float
) -> tuple[Array, Array]:
    """Damped step (f,) of the unknowns that may go, and the constraints' multipliers (c,)."""
    size = np.sqrt(np.diag(information))
    live = go & (size > 0)
    step, gaps = np.zeros(len(gradient)), normal.gaps
    scale = size[live]
    if not len(scale):
        return step, np.zeros(len(gaps))
    square = np.ix_(live, live)
    matrix = information[square] / np.outer(scale, scale)
    surplus = (normal.information - normal.curvature)[square] / np.outer(scale, scale)
    slope = gradient[live] / scale
    if not len(gaps):
        values, vectors = np.linalg.eigh(matrix)
        keep = values > SINGULAR * values[-1]
        unit = vectors[:, keep] / np.sqrt(values[keep])
        bent = np.ones(unit.shape[1])
        if float(np.sum((unit.T @ slope) ** 2)) < 2.0 * len(bent):  # near the optimum
            bent, turned = np.linalg.eigh(np.diag(bent) - unit.T @ surplus @ unit)
            unit = unit @ turned
        weight = 1.0 / (np.maximum(bent, _CONVEX) + damping)
        step[live] = unit @ (weight * (unit.T @ slope)) / scale
        return step, np.zeros(0)
    matrix = (1.0 + damping) * matrix
    bound = normal.gap_slopes[:, live] / scale
    row = np.maximum(np.abs(bound).max(axis=1), 1e-300)
    bound = bound / row[:, None]
    whole = np.block([[matrix, bound.T], [bound, np.zeros((len(gaps), len(gaps)))]])
    right = np.concatenate([slope, -gaps / row])
    solved = np.linalg.lstsq(whole, right, rcond=1e-14)[0]
    step[live] = solved[: len(scale)] / scale
    return step, solved[len(scale) :] / row


def projected(information: Array, normal: Normal, go: Mask) -> Array:
    """Return the directions (f, j) in which the unknowns that may go can move: those that the
    constraints leave, without those that nothing holds, in the unit of each unknown: of unit length
    in standard errors."""
    size = np.sqrt(np.diag(information))
    live = np.flatnonzero(go & (size > 0))
    scale = size[live]
    if not len(live):
        return np.zeros((len(go), 0))
    free = np.eye(len(live))
    if len(normal.gaps):
        bound = normal.gap_slopes[:, live] / scale
        bound = bound / np.maximum(np.abs(bound).max(axis=1), 1e-300)[:, None]
        free = null_space(bound)
    matrix = free.T @ (information[np.ix_(live, live)] / np.outer(scale, scale)) @ free
    values, vectors = np.linalg.eigh(matrix)
    keep = values > SINGULAR * values.max(initial=0.0)
    directions = np.zeros((len(go), int(keep.sum())))
    directions[live] = (free @ vectors[:, keep] / np.sqrt(values[keep])) / scale[:, None]
    return directions
