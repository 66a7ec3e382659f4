"""A flexible model of a residual: piecewise-linear functions of each variable and products of
pairs, by ridge regression on all flights but one, which it predicts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from aerodb.support import Array
from aerodb.tracing.decision.functions import separable
from aerodb.tracing.decision.residual_records import ResidualRecord

#: Knots of a variable's function: quantiles of its values over all flights.
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Ridge weights tried, in parts of the features' own sum of squares; chosen by leaving out flights
#: of the training set.
_RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
#: Groups of flights among which the weight is chosen: pairs of two hundred flights would be twenty
#: thousand.
_GROUPS = 5


@dataclass(frozen=True)
class RidgeProblem:
    """Products of the features: square (g, f, f), right (g, f) with the residual, total (g,) of it,
    and its samples (g,), by flight; and the variables that each feature is made of."""

    square: Array
    right: Array
    total: Array
    samples: Array
    made_of: tuple[frozenset[str], ...]

    def without(self, name: str) -> "RidgeProblem":
        """Return the problem without the features of one variable: square (g, f, f) and right (g,
        f) lose those columns; values stay dimensionless."""
        kept = [k for k, names in enumerate(self.made_of) if name not in names]
        return RidgeProblem(
            self.square[:, kept][:, :, kept],
            self.right[:, kept],
            self.total,
            self.samples,
            tuple(self.made_of[k] for k in kept),
        )

    def separable(self, before: Array, inflation_limit: float) -> "RidgeProblem":
        """Return the problem without the combinations of features that sensors explain but for a
        part ``1 / inflation_limit`` of their variance: what is left of those is noise, and the
        residual shares it. before (f, f) : square over all flights before what sensors could
        explain was taken out.
        """
        keep = separable(self.square.sum(axis=0), before, inflation_limit)
        return replace(self, square=keep.T @ self.square @ keep, right=self.right @ keep)


@dataclass(frozen=True)
class Features:
    """Hinge functions of each variable and products of pairs: the block (m, f) of each flight, and
    what each is made of."""

    blocks: list[Array]
    made_of: tuple[frozenset[str], ...]


def variables_of(records: Sequence[ResidualRecord]) -> tuple[int, ...]:
    """Return the identities of the records' arrays (m, v) of variables, which axes may share
    (`records_in_band`)."""
    return tuple(id(record.variables) for record in records)


def features_of(variables: Sequence[Array], names: Sequence[str]) -> Features:
    """Return standardised features (m, f), dimensionless, of the variables (m, v) of each flight:
    linear, hinges at quantiles and products of pairs. The residual is not looked at, so that knots
    and scales may come from all."""
    every = np.concatenate(variables)
    level, spread = every.mean(axis=0), every.std(axis=0)
    columns = [c for c in range(len(names)) if spread[c] > 1e-9 * max(1e-12, abs(level[c]))]
    pairs = list(combinations(range(len(columns)), 2))
    first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    knots = np.quantile((every[:, columns] - level[columns]) / spread[columns], _QUANTILES, axis=0)
    blocks = []
    for own in variables:
        scaled = (own[:, columns] - level[columns]) / spread[columns]
        hinges = [np.maximum(scaled - knot, 0.0) for knot in knots]
        blocks.append(
            np.concatenate([scaled, *hinges, scaled[:, first] * scaled[:, second]], axis=1)
        )
    used = [names[c] for c in columns]
    made_of = [frozenset({name}) for name in used] * (1 + len(knots)) + [
        frozenset({used[a], used[b]}) for a, b in pairs
    ]
    return Features(blocks, tuple(made_of))


def ridge_problem(
    records: Sequence[ResidualRecord], features: Features, inflation_limit: float
) -> RidgeProblem:
    """Return per flight the features' products (f, f) and (f,) with the dimensionless residual,
    without the flight's own level, and without what sensors could explain, which is taken out of
    them as it is out of the residual."""
    squares, right = [], []
    before = np.zeros((len(features.made_of), len(features.made_of)))
    for record, whole in zip(records, features.blocks, strict=True):
        block = whole - record.basis @ (record.basis.T @ whole)
        squares.append(block.T @ block)
        right.append(block.T @ record.residual)
        apart = whole - whole.mean(axis=0)
        before += apart.T @ apart
    total = np.array([float(record.residual @ record.residual) for record in records])
    samples = np.array([float(len(record.residual)) for record in records])
    problem = RidgeProblem(np.stack(squares), np.stack(right), total, samples, features.made_of)
    return problem.separable(before, inflation_limit)


def left_out_skills(problem: RidgeProblem, ridges: Array | None = None) -> tuple[Array, Array]:
    """Return per flight 1 - SSE / SST of the prediction by the others, and the ridge, both (g,) and
    dimensionless; it is chosen inside the others, unless given."""
    total = problem.total
    if not problem.made_of:
        return np.zeros(len(total)), np.zeros(len(total))
    squares, right = problem.square, problem.right
    every, driving, count = squares.sum(axis=0), right.sum(axis=0), len(total)

    def skill(out: int, weight: Array) -> float:
        change = 2.0 * weight @ right[out] - weight @ squares[out] @ weight
        return float(change / total[out]) if total[out] > 0.0 else 0.0

    if ridges is None:
        ridges = _chosen_ridges(squares, right, skill)
    outer = [
        skill(out, _ridge(every - squares[out], driving - right[out], ridges[out]))
        for out in range(count)
    ]
    return np.array(outer), ridges


def _chosen_ridges(squares: Array, right: Array, skill: Callable[[int, Array], float]) -> Array:
    """For each flight left out (g,), the weight with which groups of others, without its own,
    predict each other best."""
    groups = np.array_split(np.arange(len(squares)), min(len(squares), _GROUPS))
    own = [(squares[group].sum(axis=0), right[group].sum(axis=0)) for group in groups]
    every, driving = sum(square for square, _ in own), sum(drive for _, drive in own)
    # by whom judged last: the training set of a pair of groups is that of both orders
    inner = np.zeros((len(_RIDGES), len(groups), len(groups)))
    for one, other in combinations(range(len(groups)), 2):
        rest, driven = every - own[one][0] - own[other][0], driving - own[one][1] - own[other][1]
        for number, ridge in enumerate(_RIDGES):
            weight = _ridge(rest, driven, ridge)
            inner[number, one, other] = sum(skill(int(flight), weight) for flight in groups[other])
            inner[number, other, one] = sum(skill(int(flight), weight) for flight in groups[one])
    chosen = np.array(_RIDGES)[np.argmax(inner.sum(axis=2), axis=0)]
    return np.repeat(chosen, [len(group) for group in groups])


def _ridge(square: Array, right: Array, ridge: float) -> Array:
    shifted = square.copy()
    shifted.flat[:: len(square) + 1] += ridge * np.diagonal(square) + 1e-12
    return np.asarray(
        cho_solve(
            cho_factor(shifted, overwrite_a=True, check_finite=False), right, check_finite=False
        )
    )
