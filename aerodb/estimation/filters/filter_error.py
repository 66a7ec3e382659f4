"""Filter error: maximum likelihood where turbulence drives the states as well as the controls.

Output error takes the motion as deterministic, so that turbulence ends up in its residuals and
biases its estimates. Here a Kalman filter follows the motion, and its innovations are made most
likely: process noise and measurement noise are estimated with the parameters.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.filters.filter_fit import fit_of
from aerodb.estimation.filters.filter_problem import Covariance, FilterProblem, Point
from aerodb.estimation.filters.one_step import around, repeated, slopes, stepped
from aerodb.estimation.filters.process_noise import NOT_NEEDED, ProcessNoiseTest, boundary_p_value
from aerodb.estimation.filters.scoring import SINGULAR, Optimum, maximise
from aerodb.estimation.fit import Fit
from aerodb.estimation.linear_models import LinearModel
from aerodb.estimation.output_error import search
from aerodb.estimation.time_history import TimeHistory

#: ``steady``: one gain from the model linearised at the first state. ``extended``: linearised at
#: every sample.
Gain = Literal["steady", "extended"]
#: Process noise at the start: the variance that it adds in one step, as a share of what the
#: measurements of one step leave.
_FIRST_SHARE = 0.5
#: Measurement noise keeps this share of the variance of the differences between samples: the
#: likelihood of less is flat.
_LEAST_SHARE = 1e-6
#: Measurement noise of so many times the least variance stands for none.
_AT_LEAST = 4.0
#: Steps over which the measurements at the start are counted.
_HORIZON = 20
#: Log-likelihood that a state's process noise must gain to be kept in the search.
_GAINED = 0.05
#: The first search, for the order of magnitude of all noise, takes so many steps.
_ROUGH = 25
#: Steps of a search for the noise alone.
_NOISE_STEPS = 50
#: Log-likelihood that a further step of it must promise.
_ENOUGH = 0.02


def filter_error(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    gain: Gain | None = None,
    covariance: Covariance | None = None,
    process_noise: Sequence[str] | None = None,
    most_iterations: int = 100,
) -> Fit:
    """Estimate a model's parameters with process noise on its states.

    Maximises ``-1/2 sum_i (v_i' S_i^-1 v_i + ln det S_i)`` over the parameters, the intensities of
    white noise on the rates and the covariance R of the measurement noise by Fisher scoring; the
    innovations v and their covariance ``S = C P C' + R`` are those of a Kalman filter with these. R
    stays positive definite by its form. In the textbook's form S is diagonal and estimated instead
    of R: less exact where the noise of the outputs is independent, but it also serves where it is
    not.

    Where the likelihood ratio does not ask for process noise, the estimates are those without;
    unless these are not determined, as of an unstable motion that grows for long without a gain.

    Parameters
    ----------
    records : with the model's outputs; a sample that is NaN is left out.
    covariance : what is estimated of the noise of the outputs; None: ``diagonal`` or, unless the
        gain is to be extended, ``innovations``, which have equally many unknowns, whichever is more
        likely; but not a form by which an output has no noise.
    gain : of the filter; None: steady for a linear model and for ``innovations``, which have no
        other, else extended, which serves a model whose derivatives change during a record.
    process_noise : the states that have process noise; None: all.

    Raises InputError for records of one name, lacking outputs, unknown states, and ``innovations``
    with an extended gain: their covariance is not the same at every sample.

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, chapter 5.
    Maine & Iliff, SIAM Journal on Applied Mathematics 41(3), 1981.
    Self & Liang, Journal of the American Statistical Association 82, 1987: likelihood ratio where a
    parameter is at its bound.
    """
    disturbed = checked_states(model, records, process_noise)
    start, tried = first_noise(model, records, disturbed), list[Optimum]()
    for kind, steady in _forms(model, gain, covariance):
        whole = _problem(model, records, disturbed, kind, steady, start)
        begin = max([start, *map(_with_innovations, tried)], key=whole.likelihood_at)
        tried.append(_without_idle(_searched(whole, begin, most_iterations), most_iterations))
    found = max(tried, key=lambda each: (each.converged, not _exact(each), each.log_likelihood))
    null = _undisturbed(found, most_iterations)
    ratio = 2.0 * (found.log_likelihood - null.log_likelihood)
    p_value = boundary_p_value(ratio if np.isfinite(ratio) else np.inf, len(disturbed))
    followed = _determined(null) or not _determined(found)
    needed = bool(found.problem.disturbed) and (p_value < NOT_NEEDED or not followed)
    test = ProcessNoiseTest(ratio, p_value, needed)
    return fit_of("filter-error", found if test.needed else null, test, disturbed)


def _forms(
    model: DynamicModel, gain: Gain | None, covariance: Covariance | None
) -> list[tuple[Covariance, bool]]:
    """Return what is estimated of the noise, each with whether the gain is steady."""
    if covariance == "innovations" and gain == "extended":
        raise InputError(
            "the covariance of innovations is constant only with a steady gain",
            "filter error",
            'choose gain="steady" or covariance="diagonal"',
        )
    steady = isinstance(model, LinearModel) if gain is None else gain == "steady"
    if covariance is not None:
        return [(covariance, steady or covariance == "innovations")]
    innovations: list[tuple[Covariance, bool]] = (
        [] if gain == "extended" else [("innovations", True)]
    )
    return [("diagonal", steady), *innovations]


def checked_states(
    model: DynamicModel, records: Sequence[TimeHistory], process_noise: Sequence[str] | None
) -> tuple[int, ...]:
    """Numbers of the states with process noise. A tuple (p,). Raises InputError for no record,
    records of one name, a record that lacks an output, and an unknown state."""
    names = [record.name for record in records]
    if not records or len(set(names)) < len(names):
        raise InputError(
            "records must be at least one, with unique names", "filter error", "name them apart"
        )
    for record in records:
        if lacking := [name for name in model.outputs if name not in record.outputs]:
            raise InputError(
                f"it has no {', '.join(lacking)}",
                f"record {record.name}",
                "leave these outputs out of the model, or give NaN where they were not measured",
            )
    wanted = model.states if process_noise is None else tuple(process_noise)
    for name in wanted:
        if name not in model.states:
            raise InputError(f"no state '{name}'", "process noise", nearest(name, model.states))
    return tuple(j for j, name in enumerate(model.states) if name in wanted)


def likely_noise(
    model: DynamicModel, records: Sequence[TimeHistory], disturbed: tuple[int, ...]
) -> Optimum:
    """Process noise (s,) and measurement noise (o, o) that are most likely, with the parameters
    free, in SI units per root second and SI units squared."""
    steady = isinstance(model, LinearModel)
    start = first_noise(model, records, disturbed)
    problem = _problem(model, records, disturbed, "diagonal", steady, start)
    return maximise(problem, start, _NOISE_STEPS, enough=_ENOUGH)


def _problem(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    disturbed: tuple[int, ...],
    kind: Covariance,
    steady: bool,
    start: Point,
) -> FilterProblem:
    least = _LEAST_SHARE * np.diag(start.measurement)
    return FilterProblem(model, tuple(records), disturbed, kind, least, steady)


def first_noise(
    model: DynamicModel, records: Sequence[TimeHistory], disturbed: Sequence[int]
) -> Point:
    """Noise to start from: measurement noise from the differences between samples, and process
    noise for a gain at which the filter follows the measurements, however wrong the parameters.
    Vector (f,), process (s,) and measurement (o, o) in the units of `Point`."""
    measured = [record.stacked(model.outputs) for record in records]
    steps = np.concatenate([np.diff(values, axis=0) for values in measured])
    with np.errstate(invalid="ignore"):
        counted = np.maximum(np.isfinite(steps).sum(axis=0), 1)
        variance = np.nansum(steps**2, axis=0) / counted / 2.0
        level = np.nanmax(
            np.abs(np.concatenate([*measured, np.zeros((1, steps.shape[1]))])), axis=0
        )
    variance = np.maximum(variance, (1e-6 * np.maximum(level, 1e-12)) ** 2)
    vector = model.parameters.start()
    values = model.parameters.values(vector)
    record = records[0]
    state = np.array(np.broadcast_to(model.initial_state(values, record), (len(model.states), 1)))
    with np.errstate(all="ignore"):
        displaced, size = around(state)
        wide = repeated(values, 1)
        _, H = slopes(model.observed(wide, record, 0, displaced), size)
        _, transition = slopes(stepped(model, wide, record, 0, displaced), size)
        sensed, power = np.zeros(len(state)), np.eye(len(state))
        for _ in range(_HORIZON):
            sensed += (((H[:, :, 0] @ power) ** 2) / variance[:, None]).sum(axis=0) / _HORIZON
            power = transition[:, :, 0] @ power
    process = np.zeros(len(state))
    for j in disturbed:
        process[j] = np.sqrt(_FIRST_SHARE / (sensed[j] * record.step)) if sensed[j] > 0.0 else 0.0
    return Point(vector, process, np.diag(variance))


def _determined(found: Optimum) -> bool:
    """Return whether the information tells all parameters that act from each other."""
    f = len(found.point.vector)
    information = found.information[:f, :f]
    live = np.diag(information) > 0.0
    size = np.sqrt(np.diag(information)[live])
    if not np.isfinite(information).all() or not len(size):
        return False
    values = np.linalg.eigvalsh(information[np.ix_(live, live)] / np.outer(size, size))
    return bool(values[0] > SINGULAR * values[-1])


def _searched(problem: FilterProblem, start: Point, most_iterations: int) -> Optimum:
    """The optimum; correlation between outputs is searched for after the size of all noise."""
    if not problem.full:
        return maximise(problem, start, most_iterations)
    rough = maximise(replace(problem, covariance="diagonal"), start, _ROUGH, enough=1.0)
    return maximise(problem, rough.point, most_iterations)


def _exact(found: Optimum) -> bool:
    """Return whether an output has no noise but the least that keeps the filter regular.

    That is the spike of a likelihood, not a measurement: an attitude that a smoother made from the
    rates fits any filter exactly, and says nothing of the aerodynamics.
    """
    noise = np.diag(found.point.measurement)
    return bool(np.any(noise <= _AT_LEAST * found.problem.least))


def _with_innovations(found: Optimum) -> Point:
    """An optimum with the variances of its innovations in place of the measurement noise."""
    pairs = zip(found.problem.records, found.passes, strict=True)
    outputs = found.problem.model.outputs
    missed = [record.stacked(outputs) - passed.predicted[:, :, 0] for record, passed in pairs]
    return replace(
        found.point, measurement=np.diag(np.nanmean(np.concatenate(missed) ** 2, axis=0))
    )


def _undisturbed(found: Optimum, most_iterations: int) -> Optimum:
    """The optimum without process noise, which is that of output error."""
    problem, point = replace(found.problem, disturbed=()), found.point
    start = Point(point.vector, np.zeros_like(point.process), np.diag(np.diag(point.measurement)))
    if not isinstance(problem.model, LinearModel):
        plain = search(problem.model, problem.records)
        if plain.converged:
            start = replace(start, vector=plain.vector, measurement=plain.noise.covariance)
            problem = replace(problem, along=())
    return _searched(problem, start, most_iterations)


def _without_idle(found: Optimum, most_iterations: int) -> Optimum:
    """The optimum with no process noise on the states whose noise gains no likelihood."""
    problem, point = found.problem, found.point
    before = float(problem.likelihood(point, problem.unmoved)[0])
    if not np.isfinite(before):
        return found
    process, idle = point.process.copy(), list[int]()
    for j in problem.disturbed:
        without = process.copy()
        without[j] = 0.0
        trial = Point(point.vector, without, point.measurement)
        if float(problem.likelihood(trial, problem.unmoved)[0]) > before - _GAINED:
            idle.append(j)
            process = without
    if not idle:
        return found
    kept = replace(problem, disturbed=tuple(j for j in problem.disturbed if j not in idle))
    again = maximise(kept, Point(point.vector, process, point.measurement), most_iterations)
    return replace(again, iterations=found.iterations + again.iterations)
