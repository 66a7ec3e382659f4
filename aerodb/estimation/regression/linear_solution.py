"""Linear least squares with fixed, tied and bounded parameters and priors, and the standing of each
estimate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.estimation.bounded import within_bounds
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.parameters import Parameters, bounds_of, priors_of
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.estimation.time_history import elapsed
from aerodb.signals import rms, theil
from aerodb.support import Array, Integers

#: Share of its size below which a regressor counts as one that does not move.
_STILL = 1e-9
#: Singular value, relative to the largest, below which regressors are linearly dependent.
_DEPENDENT = 1e-8
#: Component in directions that the data do not determine above which an estimate is none.
_UNDETERMINED = 1e-5


@dataclass(frozen=True, eq=False)
class Unknowns:
    """All k parameters from the f that are estimated: ``theta = offset + matrix @ unknown``.

    matrix : (k, f). offset : (k,).
    """

    parameters: Parameters
    matrix: Array
    offset: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the f parameters that are estimated, in the order of `Parameters.unknown`."""
        return tuple(item.name for item in self.parameters.unknown)


def unknowns_of(parameters: Parameters) -> Unknowns:
    """Return how the p parameters follow from the f that are estimated: by a matrix (p, f) and an
    offset (p,), in SI units."""
    return Unknowns(parameters, parameters.jacobian, parameters.offset)


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Least-squares solution for f unknowns from r equations.

    values : (f,), NaN where the data determine none. gain : (f, r), ``values = gain @ response``.
    standing : what each estimate is worth, and reason : why.
    """

    values: Array
    gain: Array
    standing: tuple[Standing, ...]
    reason: tuple[str, ...]

    @property
    def determined(self) -> Integers:
        """Numbers of the unknowns that have an estimate, a subset (m,) of the f unknowns; the
        others are NaN in `values`."""
        return np.flatnonzero([each == "estimated" for each in self.standing])


def solved(design: Array, response: Array, sizes: Array, names: Sequence[str]) -> LinearSolution:
    """Solve ``response = design @ unknown``, leaving open what the equations do not determine.

    Units are those of the equations; what they do not determine is NaN, so that no matrix is
    refused as singular.

    Parameters
    ----------
    design : (r, f). response : (r,).
    sizes : (f,), norm of each regressor before anything was removed from it; a column that is
        negligible against it does not move.
    """
    f = design.shape[1]
    norm = np.linalg.norm(design, axis=0)
    moves = norm > _STILL * np.maximum(sizes, np.finfo(float).tiny)
    standing: list[Standing] = ["estimated" if each else "not excited" for each in moves]
    reason = ["" if each else "its regressor does not vary in these records" for each in moves]
    values, gain = np.full(f, np.nan), np.zeros((f, len(design)))
    index = np.flatnonzero(moves)
    if len(index):
        left, singular, right = np.linalg.svd(design[:, index] / norm[index], full_matrices=False)
        strong = singular > _DEPENDENT * singular[0]
        left, singular, right = left[:, strong], singular[strong], right[strong]
        gain[index] = (right.T / singular) @ left.T / norm[index, None]
        values[index] = gain[index] @ response
        # What the determined directions leave of a unit vector is what the data do not see.
        hidden = index[1.0 - np.sum(right**2, axis=0) > _UNDETERMINED]
        values[hidden], gain[hidden] = np.nan, 0.0
        for k in hidden:
            others = ", ".join(names[other] for other in hidden if other != k)
            standing[k] = "not identifiable"
            reason[k] = f"these records do not tell it from {others or 'the others'}"
    return LinearSolution(values, gain, tuple(standing), tuple(reason))


def undetermined(count: int, reason: str) -> LinearSolution:
    """Return the solution for `count` unknowns of which the data determine none: values (count,) of
    NaN, and an array of no gains (count, 0)."""
    standing: Standing = "not identifiable"
    return LinearSolution(
        np.full(count, np.nan), np.zeros((count, 0)), (standing,) * count, (reason,) * count
    )


def judged(
    unknowns: Unknowns, solution: LinearSolution, covariance: Array, white: Array
) -> tuple[tuple[ParameterEstimate, ...], tuple[str, ...], Array]:
    """Return estimates of all parameters, with priors and bounds applied (`within_bounds`).

    In SI units; NaN where neither records nor a prior give a value.

    Parameters
    ----------
    covariance, white : (f, f) of the unknowns, corrected for coloured residuals and as if they were
        white. Rows of unknowns without an estimate are not looked at.

    Returns
    -------
    The estimates of all k parameters in order; the names of the unknowns that have one; and their
    covariance.
    """
    items = unknowns.parameters.unknown
    values, spread = solution.values.copy(), np.zeros_like(covariance)
    standing, reason = list(solution.standing), list(solution.reason)
    index = solution.determined
    if len(index):
        sub = np.ix_(index, index)
        values[index], spread[sub], at_bound = _constrained(
            unknowns, index, values, covariance[sub]
        )
        for k in at_bound:
            standing[k], reason[k] = "at bound", "the records ask for a value beyond its bound"
    for k, item in enumerate(items):
        if standing[k] in ("not excited", "not identifiable") and item.prior is not None:
            values[k], spread[k, k] = item.prior, float(item.prior_error or 0.0) ** 2
            reason[k], standing[k] = f"the prior: {reason[k]}", "prior"
    bare = np.full(len(items), np.nan)
    bare[index] = np.sqrt(np.diag(white)[index])
    known = [k for k in range(len(items)) if np.isfinite(values[k])]
    states = {
        item.name: (
            standing[k],
            reason[k],
            float(values[k]),
            float(np.sqrt(spread[k, k])),
            float(bare[k]),
        )
        for k, item in enumerate(items)
    }
    return (
        tuple(_estimate(name, unknowns, states) for name in unknowns.parameters.names),
        tuple(items[k].name for k in known),
        spread[np.ix_(known, known)],
    )


def _estimate(
    name: str,
    unknowns: Unknowns,
    states: Mapping[str, tuple[Standing, str, float, float, float]],
) -> ParameterEstimate:
    item = unknowns.parameters[name]
    if item.tied is not None:
        other, factor = item.tied
        reason = f"{factor:g} times {other}"
        if other not in states:
            value = factor * unknowns.parameters[other].value
            return ParameterEstimate(name, value, 0.0, item.unit, "tied", reason)
        standing, why, value, error, bare = states[other]
        size = abs(factor)
        reason = f"{reason}, which is {standing}: {why}" if why else reason
        return ParameterEstimate(
            name, factor * value, size * error, item.unit, "tied", reason, size * bare
        )
    if not item.free:
        reason = "held at this value by the model"
        return ParameterEstimate(name, item.value, 0.0, item.unit, "fixed", reason)
    standing, why, value, error, bare = states[name]
    error = error if np.isfinite(value) else np.nan
    return ParameterEstimate(name, value, error, item.unit, standing, why, bare)


def _constrained(
    unknowns: Unknowns, index: Integers, values: Array, covariance: Array
) -> tuple[Array, Array, list[int]]:
    """Estimates and covariance of the unknowns `index` with priors and bounds; those at a bound.

    Minimises ``(x - x0)' C^-1 (x - x0)`` and the departures from the priors within the bounds.
    """
    items = [unknowns.parameters.unknown[k] for k in index]
    mean, sigma = priors_of(items)
    low, high = bounds_of(items)
    best = values[index]
    has_prior = np.isfinite(sigma)
    if has_prior.any():
        information = np.linalg.inv(covariance)
        right = information @ best + np.where(has_prior, mean / sigma**2, 0.0)
        covariance = np.linalg.inv(information + np.diag(np.where(has_prior, sigma**-2.0, 0.0)))
        best = covariance @ right
    deviation = np.sqrt(np.diag(covariance))
    scaled = np.linalg.inv(covariance / np.outer(deviation, deviation))
    values, touching = within_bounds(best, scaled / np.outer(deviation, deviation), low, high)
    return values, covariance, [int(index[k]) for k in np.flatnonzero(touching)]


def with_histories(fit: Fit, equation: LinearEquation) -> Fit:
    """The fit with fitted responses and residuals of the equation's records; an unknown without an
    estimate counts as zero there. Series (n,) of each record in the response's unit, against time
    [s]."""
    theta = np.nan_to_num([fit[name].value for name in equation.parameters.names])
    output = equation.response
    fitted = {each.name: each.regressors @ theta for each in equation.records}
    measured = {each.name: each.response for each in equation.records}
    residuals = {name: measured[name] - fitted[name] for name in fitted}
    return replace(
        fit,
        residuals={name: {output: values} for name, values in residuals.items()},
        fitted={name: {output: values} for name, values in fitted.items()},
        times=elapsed(equation.records),
        noise={output: rms(np.concatenate(list(residuals.values())))},
        theil={name: {output: theil(fitted[name], measured[name])} for name in fitted},
    )
