"""The answer that belongs to an optimum of the filter's likelihood."""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.estimation.filters.filter_problem import FilterProblem
from aerodb.estimation.filters.noisy_inputs import without_input_noise
from aerodb.estimation.filters.process_noise import NOT_NEEDED, ProcessNoiseTest
from aerodb.estimation.filters.scoring import SINGULAR, Optimum
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.parameters import priors_of
from aerodb.estimation.standing import standings
from aerodb.estimation.time_history import elapsed
from aerodb.estimation.whiteness import coloured_innovations, ljung_box
from aerodb.signals import theil
from aerodb.support import Array

#: Samples for each unknown, below which a record is too short for its standard errors.
_PER_UNKNOWN = 5.0

_ASSUMES = (
    "Turbulence acts as white noise on the rates of the states, of the same intensity in every"
    " record.",
    "The measurement noise is white, without mean, and the same in every record.",
)


def fit_of(
    method: str,
    optimum: Optimum,
    test: ProcessNoiseTest,
    disturbed: Sequence[int],
) -> Fit:
    """Collect estimates (SI units), standings, residuals (n,) and notes; what noise of deflections
    does on average is taken off.

    Parameters
    ----------
    disturbed : states that could have process noise.
    """
    problem, model = optimum.problem, optimum.problem.model
    unknown = model.parameters.unknown
    f = len(unknown)
    why, taken_off = _divergence(optimum), tuple[str, ...]()
    if not why:
        optimum, taken_off = without_input_noise(optimum)
        problem = optimum.problem
    white, coloured = covariances(problem, optimum)
    judged: Mapping[str, tuple[Standing, str]] = {item.name: ("diverged", why) for item in unknown}
    if not why:
        judged = standings(
            unknown, optimum.point.vector, optimum.information[:f, :f], white[:f, :f], SINGULAR
        )
    residuals, fitted, agreement, tests = {}, {}, {}, {"process noise": test.p_value}
    for record, passed in zip(problem.records, optimum.passes, strict=True):
        measured, predicted = record.stacked(model.outputs), passed.predicted[:, :, 0]
        residuals[record.name] = dict(zip(model.outputs, (measured - predicted).T, strict=True))
        fitted[record.name] = dict(zip(model.outputs, predicted.T, strict=True))
        agreement[record.name] = {
            name: theil(predicted[seen, j], measured[seen, j])
            for j, (name, seen) in enumerate(
                zip(model.outputs, np.isfinite(measured).T, strict=True)
            )
            if seen.any() and np.isfinite(predicted[seen, j]).all()
        }
    notes = [f"The search diverged: {why}."] if why else [_turbulence(test), *taken_off]
    for name in model.outputs:
        tests[f"white innovations of {name}"], _ = ljung_box(
            [values[name] for values in residuals.values()] if not why else []
        )
    coloured_ones = {} if why else coloured_innovations(residuals)
    rows = [f"{name} ({correlation:.2f})" for name, correlation in coloured_ones.items()]
    if rows:
        notes.append(
            f"The innovations of {', '.join(rows)} are correlated from sample to sample:"
            " disturbance or noise is not white as assumed. Standard errors count it, the estimates"
            " may be biased."
        )
    samples = sum(int(np.isfinite(r.stacked(model.outputs)).sum()) for r in problem.records)
    if samples < _PER_UNKNOWN * max(len(optimum.information), 1):
        notes.append(
            f"The records are too short: {samples} values for {len(optimum.information)} unknowns;"
            " the standard errors are too small."
        )
    return Fit(
        method=method,
        estimates=(
            *_estimates(problem, optimum, white, coloured, judged),
            *_intensities(problem, optimum, white, test, disturbed, why),
        ),
        names=tuple(item.name for item in unknown),
        covariance=coloured[:f, :f],
        residuals=residuals,
        fitted=fitted,
        times=elapsed(problem.records),
        noise=dict(
            zip(model.outputs, np.sqrt(np.diag(optimum.point.measurement)).tolist(), strict=True)
        ),
        theil=agreement,
        converged=optimum.converged and not why,
        iterations=optimum.iterations,
        log_likelihood=optimum.log_likelihood,
        tests=tests,
        assumes=_ASSUMES,
        notes=tuple(notes),
    )


def _turbulence(test: ProcessNoiseTest) -> str:
    size = f"likelihood ratio {test.ratio:.4g}, p = {test.p_value:.2g}"
    if test.needed and test.p_value >= NOT_NEEDED:
        return (
            "Without process noise the parameters are not determined: the motion is unstable, and"
            " only a filter follows it for so long."
        )
    if test.needed:
        return (
            f"The states are disturbed ({size}): output error is biased by it, this fit is not if"
            " turbulence is what disturbs them."
        )
    return f"Process noise is not needed ({size}): the estimates are those of output error."


def _divergence(optimum: Optimum) -> str:
    """Return why there is no estimate; empty where there is one."""
    if not np.isfinite(optimum.log_likelihood):
        return "the filter loses the motion at the start values: start closer"
    if not optimum.converged:
        return (
            f"the search did not end within {optimum.iterations} steps: start closer, or fix some"
        )
    return ""


def covariances(problem: FilterProblem, optimum: Optimum) -> tuple[Array, Array]:
    """Covariances (u, u), in products of the unknowns' units, as if the innovations were white, and
    corrected for coloured ones (`autoregressive_noise`); nan after a divergence."""
    information, u = optimum.information, len(optimum.information)
    if not np.isfinite(information).all():
        return np.full((u, u), np.nan), np.full((u, u), np.nan)
    f = len(optimum.point.vector)
    size = np.sqrt(np.diag(information))
    live = np.flatnonzero(size > 0.0)  # with what a bound holds: it might be off it
    scale = size[live]
    values, vectors = np.linalg.eigh(information[np.ix_(live, live)] / np.outer(scale, scale))
    keep = values > SINGULAR * values.max(initial=0.0)
    white = np.zeros((u, u))
    inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T
    white[np.ix_(live, live)] = inverse / np.outer(scale, scale)
    samples = sum(
        float(np.isfinite(record.stacked(problem.model.outputs)).sum())
        for record in problem.records
    )
    # innovations are smaller than expected by what the parameters take up
    larger = samples / max(samples - float(keep.sum()), 1.0)
    error = priors_of(problem.model.parameters.unknown)[1]
    middle = np.diag(np.concatenate([error**-2.0, np.zeros(u - f)]))
    for part in optimum.slopes:
        variance = part.variance.reshape(-1, part.variance.shape[-1])
        middle[np.ix_(part.columns, part.columns)] += 0.5 * variance.T @ variance
    for output in range(len(problem.model.outputs)):
        noise = autoregressive_noise([part.innovations[:, output] for part in optimum.slopes])
        for part in optimum.slopes:
            at = np.ix_(part.columns, part.columns)
            middle[at] += noise.summed(part.mean[:, output])
    return larger * white, larger * white @ middle @ white


def _estimates(
    problem: FilterProblem,
    optimum: Optimum,
    white: Array,
    coloured: Array,
    judged: Mapping[str, tuple[Standing, str]],
) -> list[ParameterEstimate]:
    parameters = problem.model.parameters
    number = {item.name: j for j, item in enumerate(parameters.unknown)}
    values = parameters.values(optimum.point.vector)
    made = []
    for item in parameters.items:
        source, factor = item.tied or (item.name, 1.0)
        standing, reason = judged.get(source, ("estimated", ""))
        value, error, bound = float(values[item.name]), np.nan, np.nan
        if source in number and standing not in ("diverged", "at bound"):
            j = number[source]
            error = abs(factor) * float(np.sqrt(coloured[j, j]))
            bound = abs(factor) * float(np.sqrt(white[j, j]))
        if standing in ("not excited", "not identifiable", "diverged"):
            value = error = bound = np.nan
        if source not in number:
            standing, reason = "fixed", "not estimated"
        elif item.tied is not None and standing == "estimated":
            standing, reason = "tied", f"{factor:g} times {source}"
        made.append(ParameterEstimate(item.name, value, error, item.unit, standing, reason, bound))
    return made


def _intensities(
    problem: FilterProblem,
    optimum: Optimum,
    white: Array,
    test: ProcessNoiseTest,
    disturbed: Sequence[int],
    why: str,
) -> list[ParameterEstimate]:
    """Square roots of the intensities of the process noise, one per state that could have it."""
    f, made = len(optimum.point.vector), []
    for state in disturbed:
        name = f"process_noise_{problem.model.states[state]}"
        value = float(optimum.point.process[state])
        if why:
            made.append(ParameterEstimate(name, np.nan, np.nan, _UNIT, "diverged", why))
        elif state in problem.disturbed:
            j = f + problem.disturbed.index(state)
            error = value * float(np.sqrt(white[j, j]))
            made.append(ParameterEstimate(name, value, error, _UNIT, cramer_rao=error))
        else:
            reason = "more of it makes the record less likely"
            if not test.needed:
                reason = f"not needed: p = {test.p_value:.2g} without any"
            made.append(ParameterEstimate(name, 0.0, np.nan, _UNIT, "at bound", reason))
    return made


#: Of the square root of an intensity, beside the unit of its state.
_UNIT = "1/sqrt(s)"
