"""Which terms a response has, found from the records themselves: stepwise regression, and
orthogonal functions with the least predicted square error.

Both are displays. Whoever searches among many terms finds some that are not there: each answer
states how often, measured on this record. Surrogates of its residual, with the same spectrum and
random phases (Theiler et al., Physica D 58, 1992), hold no term at all; the share of them in which
the same search finds one is the rate of false alarms.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.coloured_noise import NoiseModel
from aerodb.estimation.fit import Fit, Standing
from aerodb.estimation.parameters import Parameter, Parameters
from aerodb.estimation.regression.equation_error import Reduced, answer, reduced, whitened
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.support import Array, Mask

#: Level of a term that enters.
LEVEL: Final = 0.05
#: Surrogates of the residual that show how often chance finds a term.
_SURROGATES = 200
#: Seed of the surrogates: the same record gives the same answer.
_SEED = 0
#: Part of a column beyond those in the model, below which it brings nothing of its own.
_OWN: Final = 1e-6

#: Index of the candidate that a search takes first for a response (n,), or None.
Search = Callable[[Array], int | None]


def stepwise(equation: LinearEquation, *, level: float = LEVEL) -> Fit:
    """Stepwise regression: terms enter and leave by their p-values for coloured residuals.

    The term with the largest partial correlation enters where its p-value is below `level`; a term
    whose p-value has risen above it leaves. Constants of the records are always in. Draper & Smith,
    Applied Regression Analysis, 1998, section 15.2; Klein, Batterson & Murphy, NASA TP-1916, 1981.

    Raises InputError where nothing is free, and for a level that is none.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"{level:g} is no level", "stepwise", "use one such as 0.05")
    problem = reduced(equation)
    base = _constants(problem)
    chosen, last = base.copy(), -1
    for _ in range(2 * len(base)):
        p = _entering(problem, chosen, problem.response)
        best = int(np.argmin(p)) if p.size else -1
        entered = best >= 0 and p[best] < level and best != last
        if entered:
            chosen[best] = True
        leaving = np.where(chosen & ~base, _leaving(problem, chosen), 0.0)
        last = int(np.argmax(leaving)) if leaving.max() > level else -1
        if last >= 0:
            chosen[last] = False
        if not entered or best == last:
            break
    reasons = _entering(problem, chosen, problem.response)
    said = {
        int(k): f"p {reasons[k]:.2g} beside the others" for k in np.flatnonzero(~chosen).tolist()
    }

    def first(response: Array) -> int | None:
        found = _entering(problem, base, response)
        best = int(np.argmin(found))
        return best if found[best] < level else None

    return _display(
        "stepwise", problem, chosen, base, said, first, (f"Terms enter at p < {level:g}.",)
    )


def orthogonal_functions(equation: LinearEquation, *, order: int = 1) -> Fit:
    """Multivariate orthogonal functions: terms in the order in which they lower the sum of squares,
    as many as give the least predicted square error.

    ``PSE = RSS / n + s^2 k / n`` with s^2 the variance of the response about its mean, k terms, n
    samples (Morelli, Journal of Aircraft 32(2), 1995). It supposes white residuals; with coloured
    ones it finds more than there is, as the stated false alarms tell.

    order : products of up to so many of the moving regressors are terms too, such as
        ``Cm_alpha*Cm_alpha``.

    Raises InputError where nothing is free, and for an order below 1.
    """
    problem = reduced(equation if order == 1 else with_products(equation, order))
    base = _constants(problem)

    def found(response: Array) -> list[int]:
        """The terms with the least predicted square error."""
        left = response - _projected(problem.columns[:, base], response)
        ranked, falls = _ranked(problem, base, left)
        penalty = float(left @ left) / len(left)
        error = np.concatenate([[0.0], np.cumsum(penalty - np.array(falls))])
        return ranked[: int(np.argmin(error))]

    taken = found(problem.response)
    chosen = base.copy()
    chosen[taken] = True
    said = dict.fromkeys(
        np.flatnonzero(~chosen).tolist(), "it would not lower the predicted square error"
    )
    return _display(
        "orthogonal-functions",
        problem,
        chosen,
        base,
        said,
        lambda response: next(iter(found(response)), None),
        (f"Terms enter while the predicted square error falls; {len(taken)} did.",),
    )


def with_products(equation: LinearEquation, order: int) -> LinearEquation:
    """The equation with products of two to `order` of its moving regressors as further terms.
    Regressors (n, k) get further columns in the products of their units. Raises InputError for an
    order below 1."""
    if order < 1:
        raise InputError(f"no products of order {order}", "orthogonal functions", "use 2 or 3")
    matrix, _ = equation.stacked()
    moving = [k for k in range(matrix.shape[1]) if len(np.unique(matrix[:, k])) > 2]
    groups = [g for n in range(2, order + 1) for g in combinations_with_replacement(moving, n)]
    names = equation.parameters.names
    more = tuple(Parameter("*".join(names[k] for k in group), 0.0) for group in groups)
    records = tuple(
        replace(
            record,
            regressors=np.column_stack(
                [record.regressors, *(record.regressors[:, list(g)].prod(axis=1) for g in groups)]
            ),
        )
        for record in equation.records
    )
    return replace(
        equation, parameters=Parameters((*equation.parameters.items, *more)), records=records
    )


def _constants(problem: Reduced) -> Mask:
    """(f,) columns that are constant in every record and not zero."""
    steady = np.abs(problem.columns).max(axis=0) > 0.0
    for block in problem.blocks(problem.columns):
        steady &= np.ptp(block, axis=0) == 0.0
    return np.asarray(steady)


def _projected(columns: Array, values: Array) -> Array:
    """Part of `values` (n, ...) that lies in the span of the columns."""
    if not columns.shape[1]:
        return np.zeros_like(values)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(columns / scale, full_matrices=False)
    base = left[:, singular > 1e-9 * singular[0]]
    return np.asarray(base @ (base.T @ values))


def _solved(problem: Reduced, chosen: Mask, response: Array) -> Array:
    """(f,) least squares with the chosen columns."""
    found = np.zeros(len(chosen))
    if chosen.any():
        columns = problem.columns[:, chosen]
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        found[chosen] = np.linalg.lstsq(columns / scale, response, rcond=1e-10)[0] / scale
    return found


def _noise_of(problem: Reduced, residual: Array) -> NoiseModel:
    moved = replace(problem, response=residual)
    return moved.noise(np.zeros(len(problem.unknown)))


def _entering(problem: Reduced, chosen: Mask, response: Array) -> Array:
    """(f,) p-value of each column that is not chosen, if it alone entered; 1 for the chosen ones
    and those that bring nothing of their own."""
    from scipy.special import stdtr  # slow to import

    base = problem.columns[:, chosen]
    left = response - _projected(base, response)
    noise = _noise_of(problem, left)
    size = np.maximum(np.linalg.norm(problem.columns, axis=0), 1e-300)
    scaled = problem.columns / size
    own = scaled - _projected(base, scaled)
    useful = ~chosen & (np.linalg.norm(own, axis=0) > _OWN)
    p = np.ones(len(chosen))
    if useful.any() and left @ left > 0.0:
        columns = own[:, useful]
        rank = int(chosen.sum())
        variance = np.diag(whitened(problem, columns, noise, rank + 1))
        ratio = np.abs(columns.T @ left) / np.sqrt(np.maximum(variance, 1e-300))
        p[useful] = 2.0 * stdtr(max(noise.independent - rank - 1, 1.0), -ratio)
    return p


def _leaving(problem: Reduced, chosen: Mask) -> Array:
    """(f,) p-value of each chosen column with the other chosen ones in the model; 0 for the
    rest."""
    p = np.zeros(len(chosen))
    for k in np.flatnonzero(chosen):
        without = chosen.copy()
        without[k] = False
        p[k] = _entering(problem, without, problem.response)[k]
    return p


def _ranked(problem: Reduced, base: Mask, left: Array) -> tuple[list[int], list[float]]:
    """Columns in the order in which they lower the sum of squares most, each orthogonalised to the
    base and to those before it, and the falls of it.

    left : response (n,) without its part along the base.
    """
    size = np.maximum(np.linalg.norm(problem.columns, axis=0), 1e-300)
    own = problem.columns / size
    own = own - _projected(problem.columns[:, base], own)
    order: list[int] = []
    falls: list[float] = []
    rest = np.flatnonzero(~base).tolist()
    while rest:
        length = np.linalg.norm(own[:, rest], axis=0)
        if length.max() <= _OWN:
            break
        gain = np.where(length > _OWN, (own[:, rest].T @ left) / np.maximum(length, _OWN), 0.0)
        best = int(np.argmax(np.abs(gain)))
        falls.append(float(gain[best]) ** 2)
        direction = own[:, rest[best]] / length[best]
        order.append(rest.pop(best))
        left = left - direction * (direction @ left)
        own = own - np.outer(direction, direction @ own)
    return order, falls


@dataclass(frozen=True)
class _Alarms:
    """Share of surrogates in which a search finds any term, and terms that it could find."""

    rate: float
    terms: int


def _alarms(problem: Reduced, base: Mask, residual: Array, search: Search) -> _Alarms:
    rng = np.random.default_rng(_SEED)
    found = 0
    for _ in range(_SURROGATES):
        pieces = []
        for block in problem.blocks(residual):
            spectrum = np.fft.rfft(block)
            turned = np.abs(spectrum) * np.exp(2j * np.pi * rng.random(len(spectrum)))
            turned[0] = spectrum[0]
            pieces.append(np.fft.irfft(turned, len(block)))
        found += search(np.concatenate(pieces)) is not None
    return _Alarms(found / _SURROGATES, int((~base).sum()))


def _display(
    method: str,
    problem: Reduced,
    chosen: Mask,
    base: Mask,
    said: dict[int, str],
    search: Search,
    notes: tuple[str, ...],
) -> Fit:
    values = _solved(problem, chosen, problem.response)
    noise = problem.noise(values)
    covariance = np.zeros((len(chosen),) * 2)
    if chosen.any():
        columns = problem.columns[:, chosen]
        scale = np.linalg.norm(columns, axis=0)
        inverse = np.linalg.pinv((columns / scale).T @ (columns / scale))
        middle = whitened(problem, columns / scale, noise, int(chosen.sum()))
        covariance[np.ix_(chosen, chosen)] = inverse @ middle @ inverse / np.outer(scale, scale)
    alarms = _alarms(problem, base, problem.response - problem.columns @ values, search)
    standings: dict[str, tuple[Standing, str]] = {
        problem.names[k]: ("left out", reason) for k, reason in said.items()
    }
    for k in np.flatnonzero(~chosen & (np.ptp(problem.columns, axis=0) == 0.0)):
        standings[problem.names[k]] = ("not excited", "its regressor stands still")
    return answer(
        method,
        problem,
        values,
        covariance,
        noise,
        max(int(chosen.sum()), 1),
        standings=standings,
        assumes=(
            "A display of which terms are worth declaring. Standard errors are those of the terms"
            " found, as if they had been declared beforehand, and are too small.",
        ),
        notes=(
            *notes,
            f"False alarms: in {alarms.rate:.0%} of {_SURROGATES} surrogates of the residual, which"
            f" hold none of the {alarms.terms} terms, the same search finds at least one.",
        ),
    )
