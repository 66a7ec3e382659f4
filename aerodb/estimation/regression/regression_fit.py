"""Least squares of a linear equation, with priors, bounds, fixed and tied parameters."""

from dataclasses import dataclass

import numpy as np

from aerodb.estimation.bounded import within_bounds
from aerodb.estimation.fit import Fit, Standing
from aerodb.estimation.parameters import bounds_of, priors_of
from aerodb.estimation.regression.equation_error import (
    Directions,
    Reduced,
    Standings,
    answer,
    combination,
    directions,
    reduced,
    whitened,
)
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.support import Array, Mask, half_interval

#: Share of a prior's standard error above which the data have added nothing.
_NOTHING_ADDED = 0.95
#: Part of an undetermined direction above which a parameter takes part in it.
_TAKES_PART = 1e-4


def regression(equation: LinearEquation) -> Fit:
    """Ordinary least squares with standard errors for coloured residuals.

    Fixed parameters are taken off the response, tied ones are added to the columns of what they
    are tied to. Priors are added to the information of the records (mixed estimation). Bounds are a
    quadratic programme, solved where the estimates violate them; the standard error of an estimate
    at a bound is that without the bound.

    References
    ----------
    "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
    Engineering Simulation", eqs. 29 to 33. Theil & Goldberger, International Economic Review 2(1),
    1961. Morelli & Klein, Journal of Guidance, Control, and Dynamics 20(1), 1997. Quadratic
    programme: Lawson & Hanson, Solving Least Squares Problems, 1974, with scipy's `lsq_linear`.

    Raises InputError where nothing is free, nothing moves, or samples are too few.
    """
    problem = reduced(equation)
    found = directions(problem)
    determined = found.left.T @ problem.response / found.singular
    estimates = np.zeros(len(problem.unknown))
    estimates[found.excited] = found.right @ determined / found.scale
    rank = len(found.singular)
    noise = problem.noise(estimates)
    spread = whitened(problem, found.left, noise, rank) / np.outer(found.singular, found.singular)
    solution = _with_priors(problem, found, determined, spread)
    low, high = bounds_of(problem.unknown)
    values, at_bound = within_bounds(solution.estimates, solution.information, low, high)
    lost = [
        k
        for k, name in enumerate(problem.names)
        if solution.standings.get(name, ("",))[0] in ("not excited", "not identifiable")
    ]
    at_bound[lost] = False  # a bound is no value of what the records do not tell
    standings = {**solution.standings, **_at_bound(problem, solution, at_bound)}
    if not np.array_equal(values, estimates):
        noise = problem.noise(values)
    variance = float(np.square(problem.response - problem.columns @ values).sum())
    variance /= len(problem.response) - rank
    inverse = np.full(len(values), np.nan)
    inverse[found.excited] = (
        np.sqrt(np.square(found.right / found.singular).sum(axis=1) * variance) / found.scale
    )
    return answer(
        "regression",
        problem,
        values,
        solution.covariance,
        noise,
        rank,
        standings=standings,
        white=inverse,
        assumes=(
            "Regressors are free of error; errors in them bias the estimates towards zero.",
            "Residuals are independent of the regressors: no controller feeds them back.",
        ),
        notes=tuple(f"The records do not determine {text}." for text in solution.undetermined),
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    """Estimates (f,), covariance (f, f), the information (f, f) that bounds weigh changes with, and
    the combinations that are not determined, in words."""

    estimates: Array
    covariance: Array
    information: Array
    standings: Standings
    undetermined: tuple[str, ...]


def _with_priors(
    problem: Reduced, found: Directions, determined: Array, spread: Array
) -> _Solution:
    """The estimates of the records, `determined` (r,) with covariance `spread` (r, r) along
    ``found.right``, together with the priors."""
    f = len(problem.unknown)
    mean, error = priors_of(problem.unknown)
    told = np.isfinite(error)
    # Rows that turn unknown parameters into coordinates along the determined directions.
    rows = np.zeros((len(determined), f))
    rows[:, found.excited] = (found.right * found.scale[:, None]).T
    size = np.ones(f)
    size[found.excited] = found.scale
    if not told.any():
        back = np.zeros((f, len(determined)))
        back[found.excited] = found.right / found.scale[:, None]
        estimates, covariance = back @ determined, back @ spread @ back.T
        information = problem.columns.T @ problem.columns
        hidden = _hidden(rows / size, told)
    else:
        weight = np.linalg.pinv(spread, rcond=1e-13, hermitian=True)
        information = rows.T @ weight @ rows + np.diag(np.where(told, error**-2.0, 0.0))
        right = rows.T @ weight @ determined
        right[told] += mean[told] / error[told] ** 2
        hidden = _hidden(rows / size, told)
        scaled = information / np.outer(size, size)
        shown = _complement(hidden, f)
        inner = shown.T @ scaled @ shown
        covariance = shown @ np.linalg.inv(inner) @ shown.T / np.outer(size, size)
        estimates = covariance @ right
    standings: dict[str, tuple[Standing, str]] = {}
    names = problem.names
    for k, name in enumerate(names):
        if np.abs(hidden[k]).max(initial=0.0) > _TAKES_PART:
            standings[name] = _lost(problem, found.excited, hidden, k)
        elif told[k] and np.sqrt(covariance[k, k]) > _NOTHING_ADDED * error[k]:
            standings[name] = ("prior", "the records add nothing to its prior")
    mixed = tuple(
        combination(names, column / size / np.linalg.norm(column / size))
        for column in hidden.T
        if np.sum(np.abs(column) > _TAKES_PART) > 1
    )
    return _Solution(estimates, covariance, information, standings, mixed)


def _hidden(rows: Array, told: Mask) -> Array:
    """Directions (f, h) of scaled parameters that neither records nor priors determine, with as few
    parameters in each as possible."""
    stacked = np.vstack([rows, np.eye(len(told))[told]])
    _, singular, right = np.linalg.svd(stacked, full_matrices=True)
    hidden = right[int(np.sum(singular > 1e-9)) :].copy()
    for k in range(len(hidden)):  # the echelon form: each direction has a parameter to itself
        row, column = divmod(int(np.argmax(np.abs(hidden[k:]))), hidden.shape[1])
        hidden[[k, k + row]] = hidden[[k + row, k]]
        hidden[k] /= hidden[k, column]
        others = np.arange(len(hidden)) != k
        hidden[others] -= np.outer(hidden[others, column], hidden[k])
    return np.asarray((hidden / np.maximum(np.linalg.norm(hidden, axis=1), 1e-300)[:, None]).T)


def _complement(hidden: Array, f: int) -> Array:
    """Orthonormal directions (f, f - h) that are determined."""
    if not hidden.shape[1]:
        return np.eye(f)
    left, _, _ = np.linalg.svd(hidden, full_matrices=True)
    return np.asarray(left[:, hidden.shape[1] :])


def _lost(problem: Reduced, excited: Mask, hidden: Array, k: int) -> tuple[Standing, str]:
    if not excited[k]:
        moved = bool(np.abs(problem.columns[:, k]).max() > 0.0)
        return "not excited", (
            "its regressor stands still, and the constant takes its place"
            if moved
            else "its regressor is zero throughout"
        ) + "; fly a manoeuvre that moves it, or fix it"
    shared = np.abs(hidden[:, np.abs(hidden[k]) > _TAKES_PART]).max(axis=1) > _TAKES_PART
    others = [name for j, name in enumerate(problem.names) if j != k and shared[j]]
    return (
        "not identifiable",
        f"these records give it only together with {', '.join(others)}; fix or leave out one, give"
        " it a prior, or fly a manoeuvre that separates them",
    )


def _at_bound(problem: Reduced, solution: _Solution, at_bound: Mask) -> Standings:
    standings: dict[str, tuple[Standing, str]] = {}
    for k in np.flatnonzero(at_bound):
        item, error = problem.unknown[k], np.sqrt(solution.covariance[k, k])
        free = solution.estimates[k]
        beyond = (free < item.lower) or (free > item.upper)
        standings[item.name] = (
            "at bound",
            f"without bounds it would be {free:.4g} +- {half_interval(error):.2g}"
            + ("" if beyond else "; the bound of another pushes it here"),
        )
    return standings
