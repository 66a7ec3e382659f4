"""Principal-component regression: least squares along the directions that the records determine,
with the rank chosen by a stated criterion.

Along the other directions the parameters keep their prior or start values: ``y_s = y - A p0``,
``A_s = U S V'``, ``p = p0 + V_r S_r^-1 U_r' y_s`` ("Aerodynamic Model Update Using Parameter
Identification Supporting a Cessna Grand Caravan Engineering Simulation", eqs. 29 to 33).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from aerodb.estimation.coloured_noise import NoiseModel
from aerodb.estimation.fit import Fit, Standing
from aerodb.estimation.regression.equation_error import (
    Reduced,
    Standings,
    answer,
    combination,
    reduced,
    whitened,
)
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.support import Array, Mask, half_interval

#: How the rank is chosen: predicted square error, leaving records (or parts of one) out, or the
#: ratio of singular values to the largest.
Criterion = Literal["prediction", "cross-validation", "ratio"]

#: Condition index of harmful collinearity (Belsley, Kuh & Welsch, Regression Diagnostics, 1980).
CONDITION_INDEX: Final = 30.0
#: Part of a parameter in directions that are left out, above which it is biased.
_BIASED = 0.01
#: The same, above which it is unknown.
_UNKNOWN = 0.99
#: Parts of a single record for cross-validation.
_PARTS: Final = 5
#: Singular values below this share of the largest are zero.
_ZERO: Final = 1e-10


def principal_components(
    equation: LinearEquation,
    *,
    criterion: Criterion = "prediction",
    condition_index: float = CONDITION_INDEX,
) -> Fit:
    """Principal-component regression of a linear equation.

    Columns that are constant within each record are no part of the components: they are always
    estimated, and the components are those of the other columns about them, scaled to unit length.

    Parameters
    ----------
    criterion : ``prediction``: the rank with the least predicted square error, ``RSS + 2 sum
        u_i' R u_i`` over the components u_i, with R the covariance of the coloured residuals
        (Mallows, Technometrics 15(4), 1973, for correlated errors); ``cross-validation``: the least
        rank that predicts left-out records, or fifths of a single record, as well as the best one
        within a standard error; ``ratio``: components with singular values of at least
        1/`condition_index` of the largest.

    The answer says which combinations are left at their start values. A parameter with a part in
    them is ``biased``, and its reason gives what least squares would. Bounds are not used.

    Raises InputError where nothing is free, or samples are too few.
    """
    problem = reduced(equation)
    start = np.array([u.value if u.prior is None else u.prior for u in problem.unknown])
    response = problem.response - problem.columns @ start
    parts = _split(problem)
    components = _components(problem.columns, response, parts)
    full = len(components.singular)
    whole = _estimates(components, full, parts)
    noise = problem.noise(start + whole)
    if criterion == "prediction":
        rank = _by_prediction(problem, components, noise)
    elif criterion == "cross-validation":
        rank = _by_leaving_out(problem, response, parts, full)
    else:
        limit = components.singular[:1] / condition_index
        rank = int(np.sum(components.singular >= limit))
    estimates = start + _estimates(components, rank, parts)
    noise = problem.noise(estimates)
    covariance = _covariance(problem, components, rank, parts, noise)
    complete = np.sqrt(np.diag(_covariance(problem, components, full, parts, noise)))
    standings = _standings(problem, components, rank, parts, start + whole, complete)
    count = rank + int(parts.kept.sum())
    return answer(
        "principal-components",
        problem,
        estimates,
        covariance,
        noise,
        count,
        standings=standings,
        assumes=(
            "What the records hardly determine stays at its prior or start value.",
            "Regressors are free of error.",
        ),
        notes=(
            f"Rank {rank} of {int(parts.moving.sum())} by {_TEXT[criterion]}.",
            *_left(problem, components, rank, parts),
        ),
    )


_TEXT: Final = {
    "prediction": "predicted square error for coloured residuals",
    "cross-validation": "cross-validation",
    "ratio": "the ratio of singular values",
}


@dataclass(frozen=True, eq=False)
class _Parts:
    """(f,) columns that are always kept, those whose components are taken, and those that are
    zero."""

    kept: Mask
    moving: Mask


@dataclass(frozen=True, eq=False)
class _Components:
    """``A_m - Q Q' A_m = U S V' scale`` of the moving columns about the kept ones; V holds all
    directions, those of zero singular values too.

    along : estimates (f - kept) of the kept columns from the response and from each moving one.
    """

    left: Array
    singular: Array
    right: Array
    scale: Array
    score: Array
    basis: Array
    offset: Array
    mixed: Array


def _split(problem: Reduced) -> _Parts:
    steady = np.ones(len(problem.unknown), dtype=bool)
    for block in problem.blocks(problem.columns):
        steady &= np.ptp(block, axis=0) <= 1e-9 * np.maximum(np.abs(block).max(axis=0), 1e-300)
    filled = np.abs(problem.columns).max(axis=0) > 0.0
    kept = np.zeros_like(steady)
    for k in np.flatnonzero(steady & filled):  # ones that others do not already give
        trial = problem.columns[:, kept | (np.arange(len(steady)) == k)]
        kept[k] = np.linalg.matrix_rank(trial) == trial.shape[1]
    return _Parts(kept, ~steady)


def _components(columns: Array, response: Array, parts: _Parts) -> _Components:
    steady, moving = columns[:, parts.kept], columns[:, parts.moving]
    basis, offset = np.zeros((len(columns), 0)), np.zeros(0)
    mixed = np.zeros((0, moving.shape[1]))
    if steady.shape[1]:
        basis = np.asarray(np.linalg.qr(steady)[0])
        offset = np.asarray(np.linalg.lstsq(steady, response, rcond=None)[0])
        mixed = np.asarray(np.linalg.lstsq(steady, moving, rcond=None)[0])
    about = moving - basis @ (basis.T @ moving)
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    if not about.shape[1]:
        empty = np.zeros((0, 0))
        return _Components(about, np.zeros(0), empty, scale, np.zeros(0), basis, offset, mixed)
    left, singular, right = np.linalg.svd(about / scale, full_matrices=False)
    rank = int(np.sum(singular > _ZERO * singular[0]))
    left, singular = left[:, :rank], singular[:rank]
    score = left.T @ response
    return _Components(left, singular, right.T, scale, score, basis, offset, mixed)


def _estimates(components: _Components, rank: int, parts: _Parts) -> Array:
    """(f,) from the first components; zero where nothing is estimated."""
    found = np.zeros(len(parts.kept))
    along = components.score[:rank] / components.singular[:rank]
    moving = components.right[:, :rank] @ along / components.scale
    found[parts.moving] = moving
    found[parts.kept] = components.offset - components.mixed @ moving
    return found


def _by_prediction(problem: Reduced, components: _Components, noise: NoiseModel) -> int:
    """Number of components with the least predicted square error."""
    full = len(components.singular)
    if not full:
        return 0
    optimism = 2.0 * np.diag(whitened(problem, components.left, noise, full))
    return int(np.argmin(np.concatenate([[0.0], np.cumsum(optimism - components.score**2)])))


def _by_leaving_out(problem: Reduced, response: Array, parts: _Parts, full: int) -> int:
    """Least number of components whose error on what was left out exceeds the least error by no
    more than one standard error over the folds (Breiman et al., Classification and Regression
    Trees, 1984, section 3.4.3)."""
    errors = []
    for inside, outside in _folds(problem):
        other = _components(problem.columns[inside], response[inside], parts)
        left = [
            response[outside]
            - problem.columns[outside] @ _estimates(other, min(rank, len(other.singular)), parts)
            for rank in range(full + 1)
        ]
        errors.append([float(each @ each) / len(each) for each in left])
    table = np.array(errors)
    beyond = table - table[:, [int(np.argmin(table.mean(axis=0)))]]
    allowed = beyond.std(axis=0, ddof=1) / np.sqrt(len(table))
    return int(np.argmax(beyond.mean(axis=0) <= allowed))


def _folds(problem: Reduced) -> list[tuple[Mask, Mask]]:
    """Samples to fit and samples to predict: each record in turn, or fifths of a single one."""
    lengths = problem.lengths
    if len(lengths) > 1:
        member = np.repeat(np.arange(len(lengths)), lengths)
    else:
        member = np.arange(lengths[0]) * _PARTS // lengths[0]
    return [(member != k, member == k) for k in range(int(member[-1]) + 1)]


def _covariance(
    problem: Reduced, components: _Components, rank: int, parts: _Parts, noise: NoiseModel
) -> Array:
    """(f, f) of the first components and the kept columns."""
    f = len(parts.kept)
    left = np.column_stack([components.left[:, :rank], components.basis])
    if not left.shape[1]:
        return np.zeros((f, f))
    gain = np.zeros((f, left.shape[1]))
    moving = components.right[:, :rank] / components.singular[:rank] / components.scale[:, None]
    gain[parts.moving, :rank] = moving
    gain[parts.kept, :rank] = -components.mixed @ moving
    if parts.kept.any():
        gain[parts.kept, rank:] = np.linalg.inv(components.basis.T @ problem.columns[:, parts.kept])
    return gain @ whitened(problem, left, noise, left.shape[1]) @ gain.T


def _standings(
    problem: Reduced,
    components: _Components,
    rank: int,
    parts: _Parts,
    whole: Array,
    complete: Array,
) -> Standings:
    standings: dict[str, tuple[Standing, str]] = {}
    shares = np.square(components.right[:, rank:]).sum(axis=1)
    full = len(components.singular)
    hidden = np.square(components.right[:, full:]).sum(axis=1)
    for k, share, lost in zip(np.flatnonzero(parts.moving), shares, hidden, strict=True):
        if share > _UNKNOWN:
            standings[problem.names[k]] = (
                "not identifiable",
                "it is left at its start value: these records hardly determine it",
            )
        elif share > _BIASED:
            alone = f"; least squares gives {whole[k]:.4g} +- {half_interval(complete[k]):.2g}"
            standings[problem.names[k]] = (
                "biased",
                f"{share:.0%} of it lies in combinations that stay at their start values"
                + (alone if lost < _BIASED else ""),
            )
    for k in np.flatnonzero(~parts.moving & ~parts.kept):
        standings[problem.names[k]] = (
            "not excited",
            "its regressor stands still; fly a manoeuvre that moves it, or fix it",
        )
    return standings


def _left(problem: Reduced, components: _Components, rank: int, parts: _Parts) -> Sequence[str]:
    """A sentence for each direction that is left at its start value."""
    names = [problem.names[k] for k in np.flatnonzero(parts.moving)]
    singular = np.zeros(components.right.shape[1])
    singular[: len(components.singular)] = components.singular
    sentences = []
    for k in range(rank, len(singular)):
        weights = components.right[:, k] / components.scale
        text = combination(names, weights / np.linalg.norm(weights))
        sentences.append(
            f"Left at its start value: {text} (singular value"
            f" {singular[k] / singular[0]:.2g} of the largest)."
        )
    return sentences
