"""The rest: does anything in the state predict what is left of the residual, flight after flight, although no template fits?

A flexible model (additive piecewise-linear functions of each variable and products of pairs, ridge) is fitted to all flights but
one and predicts the one left out. Only if it beats "nothing" over the flights is there something unnamed. It names variables,
not effects: it is a question to the aerodynamicist, never an increment.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.linalg import cho_factor, cho_solve

from aerodb.errors import InputError
from aerodb.parallel import in_threads
from aerodb.tracing.conditioning import band_limited, stretches
from aerodb.tracing.evidence import Array, Evidence
from aerodb.tracing.settings import Settings
from aerodb.tracing.significance import holm

#: Knots of a variable's function: quantiles of its values over all flights.
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Ridge weights tried, in parts of the features' own sum of squares; chosen by leaving out flights of the training set.
_RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
#: Part of the largest singular value below which a direction of the sensors' columns is rounding.
_RANK = 1e-6
#: A variable matters if the model without it loses this part of the skill.
_MATTERS = 0.2


@dataclass(frozen=True)
class Remainder:
    """What is left on one axis. skill : fall of the left-out flights' sum of squares (1: all explained, 0: nothing).

    p_adjusted : over the axes, one-sided t over flights. variables : those that the skill rests on, the strongest first; empty
    where nothing is found. skills (flights,): per flight.
    """

    axis: str
    found: bool
    skill: float
    p_adjusted: float
    variables: tuple[str, ...]
    skills: tuple[float, ...]
    because: str


class Record(NamedTuple):
    """One axis of a flight in the band: variables (m, v), residual (m,), and a basis (m, s) of what sensors could explain."""

    variables: Array
    residual: Array
    basis: Array


@dataclass(frozen=True)
class Left:
    """One flight's remainder: evidence whose residual has the accepted terms taken off, and variables name -> (n,).

    Columns of the evidence are those of the sensors: what any of them could explain, whatever its size, is no remainder."""

    evidence: Evidence
    variables: Mapping[str, Array]


def take_off(evidence: Evidence, values: Mapping[str, float]) -> Evidence:
    """The evidence with ``value * column`` of each named hypothesis taken off the residual; what a flight lacks is nothing."""
    residual = {axis: np.array(rest) for axis, rest in evidence.residual.items()}
    for name, value in values.items():
        for axis, column in evidence.columns.get(name, {}).items():
            if axis in residual:
                residual[axis] = residual[axis] - value * column
    return Evidence(evidence.flight, evidence.step, residual, evidence.usable, {})


def remainders(left: Sequence[Left], settings: Settings) -> tuple[Remainder, ...]:
    """What each axis has left, over at least `settings.fewest` flights.

    Raises InputError for fewer flights, or when the flights have no variable in common.
    """
    if len(left) < settings.fewest:
        raise InputError(f"{len(left)} flights are too few to say what is left", "remainder", f"give at least {settings.fewest}")
    names = sorted(set.intersection(*(set(flight.variables) for flight in left)))
    if not names:
        raise InputError("the flights have no variable in common", "remainder", "give each the database's variables")
    axes = [axis for axis in left[0].evidence.residual if all(axis in flight.evidence.residual for flight in left)]
    parts = {axis: in_threads(partial(_in_band, axis=axis, names=names, settings=settings), left) for axis in axes}
    parts = {axis: records for axis, records in parts.items() if all(len(record[1]) for record in records)}
    problems = dict(zip(parts, in_threads(partial(_problem, names=names), parts.values()), strict=True))
    judged = dict(zip(parts, in_threads(_left_out_skills, problems.values()), strict=True))
    p = np.array([_one_sided(skills) for skills, _ in judged.values()])
    adjusted = holm(p, len(p)) if len(p) else p
    return tuple(
        _judged(axis, names, problems[axis], *judged[axis], float(adjusted[row]), settings) for row, axis in enumerate(parts)
    )


def _judged(
    axis: str, names: list[str], problem: "_Problem", skills: Array, ridges: Array, p: float, settings: Settings
) -> Remainder:
    skill = float(skills.mean())
    found = bool(p < settings.level)
    variables: tuple[str, ...] = ()
    because = f"nothing in {', '.join(names)} predicts what is left on {axis} of a flight that the model has not seen"
    if found:
        others = [_left_out_skills(problem.without(name), ridges)[0] for name in names]
        lost = {name: skill - float(left.mean()) for name, left in zip(names, others, strict=True)}
        variables = tuple(sorted((n for n in names if lost[n] > _MATTERS * skill), key=lambda n: -lost[n]))
        on = ", ".join(variables) or "no single variable"
        because = (
            f"{skill:.0%} of what is left on {axis} returns on flights that were left out and rests on {on}; no template fits"
        )
    return Remainder(axis, found, skill, p, variables, tuple(float(s) for s in skills), because)


def _one_sided(skills: Array) -> float:
    """p of "the mean skill over flights is not above zero"."""
    spread = float(skills.std(ddof=1))
    if spread == 0.0:
        return 1.0
    return float(stats.t.sf(skills.mean() / (spread / np.sqrt(len(skills))), len(skills) - 1))


def _in_band(flight: Left, axis: str, names: Sequence[str], settings: Settings) -> Record:
    """Variables (m, v), residual (m,) and an orthonormal basis (m, s) of its level and of what the columns of the evidence
    (sensors) could explain, in the tracing band; the residual without its part in that basis."""
    evidence = flight.evidence
    tangents = [found[axis] for found in evidence.columns.values() if axis in found]
    rows = [*(flight.variables[name] for name in names), evidence.residual[axis], *tangents]
    usable = evidence.usable[axis]
    good = usable & np.logical_and.reduce([np.isfinite(row) for row in rows])
    found = [
        band_limited([row[part] for row in rows], good[part], evidence.step, settings.bandwidth)
        for part in stretches(usable, evidence.step, settings.bandwidth, settings.order)
    ]
    joined = np.concatenate(found) if found else np.zeros((0, len(names) + 1 + len(tangents)))
    if len(joined) == 0:
        return Record(joined[:, : len(names)], joined[:, len(names)], np.zeros((0, 0)))
    explained = np.column_stack([np.ones(len(joined)), joined[:, len(names) + 1 :]])
    size = np.linalg.norm(explained, axis=0)
    left, singular, _ = np.linalg.svd(explained[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    basis = left[:, singular > _RANK * singular[0]]
    residual = joined[:, len(names)]
    return Record(joined[:, : len(names)], residual - basis @ (basis.T @ residual), basis)


@dataclass(frozen=True)
class _Problem:
    """Products of the features: square (g, f, f), right (g, f) with the residual, total (g,) of it, by flight; and the variables
    that each feature is made of."""

    square: Array
    right: Array
    total: Array
    made_of: tuple[frozenset[str], ...]

    def without(self, name: str) -> "_Problem":
        """The same without what is made of one variable."""
        kept = [k for k, names in enumerate(self.made_of) if name not in names]
        return _Problem(self.square[:, kept][:, :, kept], self.right[:, kept], self.total, tuple(self.made_of[k] for k in kept))


def _problem(records: list[Record], names: Sequence[str]) -> _Problem:
    """Per flight: hinge functions of each variable and products of pairs, without the flight's own level.

    What sensors could explain is taken out of them as it is out of the residual. The residual is not looked at, so that knots
    and scales may come from all flights.
    """
    every = np.concatenate([record.variables for record in records])
    level, spread = every.mean(axis=0), every.std(axis=0)
    columns = [c for c in range(len(names)) if spread[c] > 1e-9 * max(1e-12, abs(level[c]))]
    pairs = list(combinations(range(len(columns)), 2))
    knots = np.quantile((every[:, columns] - level[columns]) / spread[columns], _QUANTILES, axis=0)
    squares, right = [], []
    for variables, residual, basis in records:
        scaled = (variables[:, columns] - level[columns]) / spread[columns]
        hinges = [np.maximum(scaled - knot, 0.0) for knot in knots]
        products = [scaled[:, [a]] * scaled[:, [b]] for a, b in pairs]
        block = np.concatenate([scaled, *hinges, *products], axis=1)
        block -= basis @ (basis.T @ block)
        squares.append(block.T @ block)
        right.append(block.T @ residual)
    used = [names[c] for c in columns]
    made_of = [frozenset({name}) for name in used] * (1 + len(knots)) + [frozenset({used[a], used[b]}) for a, b in pairs]
    total = np.array([float(record.residual @ record.residual) for record in records])
    return _Problem(np.stack(squares), np.stack(right), total, tuple(made_of))


def _left_out_skills(problem: _Problem, ridges: Array | None = None) -> tuple[Array, Array]:
    """Per flight, 1 - SSE / SST of the prediction by the others, and the ridge; it is chosen inside the others, unless given."""
    squares, right, total = problem.square, problem.right, problem.total
    if not problem.made_of:
        return np.zeros(len(total)), np.zeros(len(total))
    every, driving, count = squares.sum(axis=0), right.sum(axis=0), len(total)

    def skill(out: int, weight: Array) -> float:
        change = 2.0 * weight @ right[out] - weight @ squares[out] @ weight
        return float(change / total[out]) if total[out] > 0.0 else 0.0

    if ridges is None:
        ridges = _chosen_ridges(squares, right, skill)
    outer = [skill(out, _ridge(every - squares[out], driving - right[out], ridges[out])) for out in range(count)]
    return np.array(outer), ridges


def _chosen_ridges(squares: Array, right: Array, skill: Callable[[int, Array], float]) -> Array:
    """For each flight left out (g,), the weight with which the others predict each other best."""
    every, driving, count = squares.sum(axis=0), right.sum(axis=0), len(squares)
    inner = np.zeros((len(_RIDGES), count, count))  # by whom judged last: the training set of a pair is that of both orders
    for one, other in combinations(range(count), 2):
        rest = every - squares[one] - squares[other]
        for number, ridge in enumerate(_RIDGES):
            weight = _ridge(rest, driving - right[one] - right[other], ridge)
            inner[number, one, other], inner[number, other, one] = skill(other, weight), skill(one, weight)
    return np.array(_RIDGES)[np.argmax(inner.sum(axis=2), axis=0)]


def _ridge(square: Array, right: Array, ridge: float) -> Array:
    shifted = square + np.diag(ridge * np.diagonal(square) + 1e-12)
    return np.asarray(cho_solve(cho_factor(shifted, overwrite_a=True, check_finite=False), right, check_finite=False))
