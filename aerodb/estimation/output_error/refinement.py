"""Refinement of a nonlinear model: bounded, from several starts, with a cost of three parts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.fit import Fit
from aerodb.estimation.output_error.gauss_newton import search
from aerodb.estimation.output_error.likelihood import Beside, MeasuredOutputs, lowest, measured
from aerodb.estimation.output_error.output_error import ASSUMES, checked_records, fit_of
from aerodb.estimation.output_error.sensitivities import ModelResponse, first_steps, respond
from aerodb.estimation.parameters import Parameter, Parameters, bounds_of, priors_of
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, in_threads

#: Starts by default: the given values, and others in the region that is searched.
STARTS: Final = 3
#: Half of the region that is searched around a start value, in its size and in standard errors that
#: it would have alone; other starts lie in a third of it.
_OF_VALUE: Final = 2.0
_OF_ERROR: Final = 60.0
#: Lowest frequencies of the deviation that count once more: those of a line and so many cycles in
#: the record.
_CYCLES: Final = 3
#: Tolerance of the distance to the linear model, as a share of the rms of each of its rows.
_LINEAR: Final = 0.1
#: Rounds in which the noise of the outputs is estimated anew, and steps of each.
_ROUNDS: Final = 4
_STEPS: Final = 15
#: The rounds end when no unknown moves by more than this, in units of what the cost notices.
_SETTLED: Final = 0.05
#: Starts end at one place where no parameter differs by more standard errors than this.
_SAME: Final = 0.5


@dataclass(frozen=True, eq=False)
class _Ended:
    """Where one start ended: vector (f,), its cost with the noise of that place, and whether the
    search came to rest there."""

    vector: Array
    cost: float
    settled: bool


def nonlinear_refinement(
    model: DynamicModel, records: Sequence[TimeHistory], *, starts: int = STARTS
) -> Fit:
    """Refine a model's parameters from several starts, within bounds.

    The cost has three parts, all in units of the noise: the deviation of the response; once more
    its lowest frequencies, which an error of a trim or of a slow mode fills; and the distance of
    the model, linearised where the first record starts, to the linearisation at the start values,
    in tenths of each row's rms. The last keeps what the records do not determine.

    Bounds are those of the parameters, where there are none two times the start value or 60
    standard errors to each side. The best end counts; a note says whether all starts end there.
    Standard errors are those of that cost, whose lowest frequencies count twice and scatter so
    (White, Econometrica 50, 1982), with the distance to the linear model as a prior.

    Values are in SI units. Raises InputError for records of one name, without outputs, and where no
    start can be flown.

    References
    ----------
    "Parameter Identification for Application within a Fault-Tolerant Flight Control System",
    section III C (cost of three components, bounded sequential quadratic programming); here as
    nonlinear least squares (Branch, Coleman & Li, SIAM J. Sci. Comput. 21(1), 1999).
    """
    checked_records(model, records, "nonlinear refinement")
    problem = _Problem(model, records)
    ends = [found for start in problem.starts(starts) if (found := problem.refined(start))]
    if not ends:
        raise InputError(
            "no start can be flown to the end of the records",
            "nonlinear refinement",
            "start from other values, or fly shorter records",
        )
    best = min(ends, key=lambda each: each.cost)
    placed: Any = replace(model, parameters=problem.parameters.changed(problem.named(best.vector)))  # type: ignore[type-var]
    held = problem.held(best.vector)
    solution = search(placed, records, most_iterations=0, beside=Beside(_CYCLES, held))
    solution = replace(solution, converged=best.settled, iterations=len(ends))
    fit = fit_of("nonlinear-refinement", placed, records, solution, ASSUMES)
    return replace(fit, notes=(*fit.notes, _told(ends, best, fit, problem, starts)))


def _told(ends: Sequence[_Ended], best: _Ended, fit: Fit, problem: "_Problem", starts: int) -> str:
    """Whether the starts agree, in a sentence."""
    names = [item.name for item in problem.parameters.unknown]
    error = np.array([fit[name].standard_error for name in names])
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = [np.nan_to_num(np.abs(each.vector - best.vector) / error) for each in ends]
    same = [each for each in apart if each.max(initial=0.0) <= _SAME]
    if len(same) == starts:
        return f"All {starts} starts end at the same values."
    farthest = max(apart, key=lambda each: float(each.max(initial=0.0)))
    worst = names[int(np.argmax(farthest))]
    return (
        f"{len(same)} of {starts} starts end at these values; another end differs most in {worst},"
        f" by {farthest.max():.1f} standard errors, and fits worse."
    )


class _Remembered:
    """A function of a point that gives values and derivatives, which are asked for in turn."""

    def __init__(self, function: Callable[[Array], tuple[Array, Array]]) -> None:
        self._function, self._at = function, b""
        self._found: tuple[Array, Array] = np.zeros(0), np.zeros((0, 0))

    def values(self, point: Array) -> Array:
        return self._both(point)[0]

    def derivatives(self, point: Array) -> Array:
        return self._both(point)[1]

    def _both(self, point: Array) -> tuple[Array, Array]:
        if point.tobytes() != self._at:
            self._found, self._at = self._function(point), point.tobytes()
        return self._found


class _Problem:
    """The three parts of the cost as one vector of residuals."""

    def __init__(self, model: DynamicModel, records: Sequence[TimeHistory]) -> None:
        self.model, self.records = model, tuple(records)
        self.measured = [measured(record.stacked(model.outputs)) for record in records]
        vector = model.parameters.start()
        responses = self._responses(model.parameters, vector)
        self.noise = self._noise_of([response.outputs for response in responses])
        self.parameters = self._bounded(model.parameters, responses)
        self.lower, self.upper = bounds_of(self.parameters.unknown)
        self.prior, self.prior_error = priors_of(self.parameters.unknown)
        values = self.parameters.values(vector[:, None])
        self.start = model.initial_state(values, self.records[0])[:, 0]
        self.known = self._linearised(vector)
        row = np.sqrt(np.mean(self.known**2, axis=1))
        self.tolerance = np.where(row > 0.0, _LINEAR * row, np.inf)[:, None]

    def named(self, vector: Array) -> dict[str, float]:
        """Name -> value of the unknowns (f,)."""
        return {i.name: float(v) for i, v in zip(self.parameters.unknown, vector, strict=True)}

    def starts(self, count: int) -> list[Array]:
        """The given values, and others spread over a third of the region that is searched; values
        of single records stay."""
        first = self.parameters.start()
        shared = np.array([not item.name.endswith("]") for item in self.parameters.unknown])
        random, found = np.random.default_rng(0), [first]
        for _ in range(count - 1):
            spread = random.uniform(-1.0, 1.0, len(first)) / 3.0
            reach = np.where(spread > 0.0, self.upper - first, first - self.lower)
            moved = np.where(shared & np.isfinite(reach), spread * np.nan_to_num(reach), 0.0)
            found.append(np.clip(first + moved, self.lower, self.upper))
        return found

    def refined(self, start: Array) -> _Ended | None:
        """Where a start ends; None where it cannot be flown."""
        from scipy.optimize import least_squares  # slow to import

        vector, noise = start, self.noise
        slopes = self._linear_slopes(start)
        for _ in range(_ROUNDS):
            at = _Remembered(partial(self._residuals, noise=noise, linear_slopes=slopes))
            if not np.isfinite(at.values(vector)).all():
                return None
            ended = least_squares(
                at.values,
                self._just_inside(vector),
                at.derivatives,
                (self.lower, self.upper),
                x_scale="jac",
                max_nfev=_STEPS,
                xtol=1e-4,
                ftol=1e-6,
            )
            moved = np.abs(ended.x - vector) * np.linalg.norm(np.asarray(ended.jac), axis=0)
            vector = ended.x
            noise = self._noise_at(vector)
            if moved.max(initial=0.0) < _SETTLED:
                break
        parts, _ = self._residuals(vector, noise, slopes)
        count = np.sum([each.mask.sum(axis=0) for each in self.measured], axis=0)
        cost = float(count @ np.log(noise)) + 0.5 * float(parts @ parts)
        return _Ended(vector, cost, ended.status > 0)

    def _just_inside(self, vector: Array) -> Array:
        """The vector away from bounds, on which the search cannot start."""
        room = 1e-6 * np.where(np.isfinite(self.upper - self.lower), self.upper - self.lower, 1.0)
        return np.clip(vector, self.lower + room, self.upper - room)

    def _responses(self, parameters: Parameters, vector: Array) -> list[ModelResponse]:
        steps = first_steps(vector)
        return list(
            in_threads(
                lambda record: respond(self.model, parameters, vector, record, steps), self.records
            )
        )

    def _noise_at(self, vector: Array) -> Array:
        """As `_noise_of`, at a point."""
        values = self.parameters.values(vector[:, None])
        return self._noise_of(
            in_threads(lambda record: self.model.simulated(values, record)[:, :, 0], self.records)
        )

    def _noise_of(self, outputs: Sequence[Array]) -> Array:
        """Root mean square (o,) of the deviations; 1 where an output cannot be compared."""
        left = [m.residual(each) for m, each in zip(self.measured, outputs, strict=True)]
        count = np.sum([each.mask.sum(axis=0) for each in self.measured], axis=0)
        with np.errstate(invalid="ignore"):
            square = np.sum([np.sum(each**2, axis=0) for each in left], axis=0)
        found = np.sqrt(square / np.maximum(count, 1))
        return np.where(np.isfinite(found) & (found > 0.0), found, 1.0)

    def _bounded(self, parameters: Parameters, responses: Sequence[ModelResponse]) -> Parameters:
        """The parameters, unbounded ones with bounds about their start values."""
        information = np.zeros(len(parameters.unknown))
        for response in responses:
            weighted = response.slopes / self.noise[:, None]
            information[response.columns] += np.nan_to_num(np.sum(weighted**2, axis=(0, 1)))
        alone = dict(zip([i.name for i in parameters.unknown], information, strict=True))

        def one(item: Parameter) -> Parameter:
            known = alone.get(item.name, 0.0)
            if item.name.endswith("]") or not known > 0.0:
                return item
            reach = max(_OF_VALUE * abs(item.value), _OF_ERROR / float(np.sqrt(known)))
            return replace(
                item,
                lower=item.lower if np.isfinite(item.lower) else item.value - reach,
                upper=item.upper if np.isfinite(item.upper) else item.value + reach,
            )

        return Parameters(tuple(one(item) for item in parameters.items))

    def _residuals(self, vector: Array, noise: Array, linear_slopes: Array) -> tuple[Array, Array]:
        """The three parts and the priors, one below the other, and their derivatives (., f)."""
        f = len(vector)
        parts, slopes = list[Array](), list[Array]()
        for one, response in zip(
            self.measured, self._responses(self.parameters, vector), strict=True
        ):
            left, moved = _weighted(one, response, noise, f)
            basis = lowest(len(left), _CYCLES)
            parts += [left.ravel(), (basis.T @ left).ravel()]
            slopes += [moved.reshape(-1, f), np.einsum("nm,nof->mof", basis, moved).reshape(-1, f)]
        parts.append(((self._linearised(vector) - self.known) / self.tolerance).ravel())
        slopes.append(self._in_tolerances(linear_slopes))
        parts.append((vector - self.prior) / self.prior_error)
        slopes.append(np.diag(1.0 / self.prior_error))
        return np.concatenate(parts), np.concatenate(slopes)

    def held(self, vector: Array) -> Array:
        """Information (f, f) of the distance to the linear model, at a point."""
        slopes = self._in_tolerances(self._linear_slopes(vector))
        return slopes.T @ slopes

    def _in_tolerances(self, linear_slopes: Array) -> Array:
        """Derivatives (., f) of the distance to the linear model."""
        return (linear_slopes / self.tolerance[:, :, None]).reshape(-1, linear_slopes.shape[-1])

    def _linearised(self, vector: Array) -> Array:
        """Derivatives (s, s + m) of the rates by the states and by the m inputs that move, where
        the first record starts."""
        record = self.records[0]
        values, state = self.parameters.values(vector), self.start
        step = 1e-4 * np.maximum(np.abs(state), 0.1)
        s = len(state)
        moved = state[:, None] + np.hstack([np.diag(step), -np.diag(step)])
        rates = self.model.rates(values, record, 0, moved)
        columns = [(rates[:, :s] - rates[:, s:]) / (2.0 * step)]
        for name, series in record.inputs.items():
            if np.ptp(series) > 0.0:
                size = 1e-3 * max(float(np.ptp(series)), 1e-6)
                ends = [
                    self.model.rates(values, _shifted(record, name, sign * size), 0, state[:, None])
                    for sign in (1.0, -1.0)
                ]
                columns.append((ends[0] - ends[1]) / (2.0 * size))
        return np.hstack(columns)

    def _linear_slopes(self, vector: Array) -> Array:
        """Derivatives (s, s + m, f) of `_linearised` by the unknowns; those of single records have
        none."""
        base, steps = self._linearised(vector), 1e2 * first_steps(vector)
        found = np.zeros((*base.shape, len(vector)))
        for j, item in enumerate(self.parameters.unknown):
            if not item.name.endswith("]"):
                other = vector.copy()
                other[j] += steps[j]
                found[:, :, j] = (self._linearised(other) - base) / steps[j]
        return found


def _weighted(
    one: MeasuredOutputs, response: ModelResponse, noise: Array, unknowns: int
) -> tuple[Array, Array]:
    """Model minus measured (n, o) in units of the noise, and its derivatives (n, o, f)."""
    left = -one.residual(response.outputs) / noise
    slopes = np.zeros((*left.shape, unknowns))
    slopes[:, :, response.columns] = np.where(
        one.mask[:, :, None], response.slopes / noise[:, None], 0.0
    )
    return left, slopes


def _shifted(record: TimeHistory, name: str, size: float) -> TimeHistory:
    return replace(record, inputs={**record.inputs, name: record.inputs[name] + size})
