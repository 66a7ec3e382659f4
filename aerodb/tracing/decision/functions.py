"""Flexible functions of observed variables, chosen and fitted on some flights to predict others.

Piecewise linear functions of one variable, and products of two, compete; which ones stand is
decided without the flights that they predict. See docs/method/tracing.md, section 26.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.special import stdtrit

from aerodb.effects import half_width
from aerodb.signals import played
from aerodb.support import Array

Indices = NDArray[np.intp]

#: Nodes of a function of one variable: quantiles of its values over all flights.
_QUANTILES: Final = (0.005, 0.17, 0.33, 0.5, 0.67, 0.83, 0.995)
#: Functions that one alternative may consist of.
_MOST: Final = 2
#: How many of the best inside the training flights are tried on each other.
_TRIED: Final = 4
#: Ridge on a column of a function, in parts of its own information in a flight.
_RIDGE: Final = 1e-2
#: Least part of the remaining error of left-out flights by which a function or a finer shape must
#: lower it. Less is no flight's worth of table nodes.
WORTH: Final = 0.02
#: Groups of flights that are predicted from all others: with more flights, several are one group.
_GROUPS: Final = 10
#: Variables that another effect may change with: one of them is in each product of two.
_MODULATE: Final = frozenset({"alpha", "beta", "mach", "qbar"})
#: Beginning of variables whose rate of change is a variable too: deflections.
_MOVING: Final = "delta_"
#: Others whose past is a variable: loads lag behind the flow (Wagner).
_ANGLES: Final = ("alpha", "beta")
#: Endings: of the rate of change of a variable, and of how far it is from its past.
RATE: Final = "_rate"
PAST: Final = "_past"
#: Of where it is in a play (`surface_motion`).
PLAY: Final = "_play"
OF_PAST: Final = (RATE, PAST, PLAY)
#: Lag of that past [s]: about the quickest that an aircraft's motion follows.
_LAG: Final = 0.25
#: Part of the largest singular value below which a direction is rounding.
RANK: Final = 1e-6
#: Part of the largest variance within flights below which a column's is rounding.
_STANDS: Final = 1e-12
#: Trace of ridge: a direction that no flight shows must not stop the others.
TRACE: Final = 1e-9


def with_past(variables: Mapping[str, Array], step: float) -> dict[str, Array]:
    """Return variables (name -> (n,)), and what a load may depend on of their past: the rates of
    change of deflections, how far deflections and flow angles are from what they were (the
    difference from a first-order lag of `_LAG`), and where in its play a deflection is; step
    [s]."""
    keep = float(np.exp(-step / _LAG))
    past = {}
    for name, values in variables.items():
        moves = name.startswith(_MOVING)
        if not (moves or name in _ANGLES):
            continue
        known = np.nan_to_num(values)
        past[f"{name}{PAST}"] = known - _lagged(known, keep)
        if moves:
            past[f"{name}{RATE}"] = np.gradient(values, step)
            past[f"{name}{PLAY}"] = known - played(known, half_width(known))
    return {**variables, **past}


def _lagged(values: Array, keep: float) -> Array:
    """A first-order lag (n,) of values that were steady before; keep : what is left of the past
    after a sample."""
    found, at = [], float(values[0])
    for value in values.tolist():
        at = keep * at + (1.0 - keep) * value
        found.append(at)
    return np.array(found)


def present(name: str) -> str:
    """The channel of which a variable is the rate of change or the past.

    >>> present("delta_elevator_rate"), present("alpha_past"), present("alpha")
    ('delta_elevator', 'alpha', 'alpha')
    """
    return next((name.removesuffix(end) for end in OF_PAST if name.endswith(end)), name)


@dataclass(frozen=True)
class BasisFunction:
    """A function of `variables`: its columns, by number; nodes where it is one of a single
    variable."""

    variables: tuple[str, ...]
    columns: tuple[int, ...]
    nodes: tuple[float, ...] = ()


@dataclass(frozen=True)
class BasisFunctions:
    """All functions, and the columns (n, k) of each flight."""

    each: tuple[BasisFunction, ...]
    columns: tuple[Array, ...]

    @property
    def size(self) -> int:
        """Number k of columns (n, k), all dimensionless."""
        return sum(len(each.columns) for each in self.each)

    def variables(self, picked: Sequence[int]) -> tuple[str, ...]:
        """Return the variables of some of the functions."""
        return tuple(dict.fromkeys(name for k in picked for name in self.each[k].variables))


def functions_of(flights: Sequence[Mapping[str, Array]]) -> BasisFunctions:
    """Return the functions of the variables (name -> (n,)) that all flights have, as dimensionless
    columns (n, k) per flight: linear ramps between quantiles, and products of standardised
    pairs."""
    names = sorted(set.intersection(*(set(flight) for flight in flights)))
    ends = np.cumsum([len(next(iter(flight.values()))) for flight in flights])[:-1]
    each, columns, scaled = [], list[Array](), dict[str, Array]()
    for name in names:
        values = np.nan_to_num(np.concatenate([flight[name] for flight in flights]))
        level, spread = float(values.mean()), float(values.std())
        if not spread > 1e-9 * max(1e-12, abs(level)):
            continue
        nodes = np.unique(np.quantile(values, _QUANTILES))
        if len(nodes) < 3:
            continue
        low, high = nodes[:-1], nodes[1:]
        numbers = tuple(range(len(columns), len(columns) + len(low)))
        columns += [*np.clip((values - low[:, None]) / (high - low)[:, None], 0.0, 1.0)]
        each.append(BasisFunction((name,), numbers, tuple(nodes.tolist())))
        if not name.endswith(OF_PAST):
            scaled[name] = (values - level) / spread
    for one, other in combinations(sorted(scaled), 2):
        if {one, other} & _MODULATE:
            each.append(BasisFunction((one, other), (len(columns),)))
            columns.append(scaled[one] * scaled[other])
    if not columns:
        return BasisFunctions(
            (), tuple(np.zeros((len(next(iter(f.values()))), 0)) for f in flights)
        )
    return BasisFunctions(tuple(each), tuple(np.split(np.array(columns).T, ends)))


def separable(after: Array, before: Array, inflation_limit: float) -> Array:
    """Return the matrix (k, k) that takes out of columns the combinations that sensors explain but
    for a part ``1 / inflation_limit`` of their variance: what is left of those is noise, and the
    residual shares it.

    after, before (k, k) : products of the columns over all flights, without and with what sensors
    could explain. Dimensionless; docs/method/tracing.md, section 14.
    """
    variance = np.diagonal(before)
    # a column that is constant within every flight has only rounding left
    moving = np.flatnonzero(variance > _STANDS * variance.max(initial=0.0))
    keep = np.eye(len(variance))
    if len(moving):
        size = np.sqrt(variance[moving])
        scale, chosen = np.outer(size, size), np.ix_(moving, moving)
        scaled = before[chosen] / scale
        power, direction = eigh(scaled)
        rank = power > RANK * power[-1]
        basis = direction[:, rank] / np.sqrt(power[rank])
        share, mixed = eigh(basis.T @ (after[chosen] / scale) @ basis)
        explained = basis @ mixed[:, share * inflation_limit < 1.0]
        keep[chosen] -= explained @ (explained.T @ scaled) * size / size[:, None]
    return keep


@dataclass(frozen=True)
class FunctionProblem:
    """Products of named columns, functions and residual, by flight.

    square (g, k, k), right (g, k), total (g,) of the residual. The columns are combinations of the
    original ones: values of these are `combined` (k, k) times values of the columns. The first
    `terms` are named ones; groups : number of a function -> its columns.
    """

    square: Array
    right: Array
    total: Array
    combined: Array
    terms: int
    groups: Mapping[int, tuple[int, ...]]

    @classmethod
    def of(
        cls,
        matrix: Array,
        before: Array,
        functions: BasisFunctions,
        terms: int,
        inflation_limit: float,
        used: bool = True,
    ) -> "FunctionProblem":
        """Return the problem of products (g, k + 1, k + 1), residual last.

        before (k, k) : products over all flights before sensors were eliminated. What sensors
        explain of a function but for one part in `inflation_limit` is taken out of it. used :
        whether there are columns of the functions, after the named ones.
        """
        k = matrix.shape[1] - 1
        every = matrix[:, :k, :k].sum(axis=0)
        after = np.diagonal(every)
        unit = np.sqrt(np.where(after > 0.0, after, 1.0) / len(matrix))
        combined = np.diag(1.0 / unit)
        groups, mixed = dict[int, tuple[int, ...]](), list[list[int]]()
        for number, function in enumerate(functions.each if used else ()):
            own = [terms + column for column in function.columns]
            block = np.ix_(own, own)
            if len(own) == 1:
                if every[own[0], own[0]] * inflation_limit > before[own[0], own[0]]:
                    groups[number] = tuple(own)
                continue
            keep = separable(every[block], before[block], inflation_limit)
            if np.trace(keep) > 0.5:
                groups[number] = tuple(own)
                combined[block] = keep / unit[own]
                mixed += [own] if np.any(keep != np.eye(len(own))) else []
        square = matrix[:, :k, :k] / np.outer(unit, unit)
        right = matrix[:, :k, k] / unit
        for own in mixed:
            keep = unit[own, None] * combined[np.ix_(own, own)]
            square[:, own] = keep.T @ square[:, own]
            square[:, :, own] = square[:, :, own] @ keep
            right[:, own] = right[:, own] @ keep
        return cls(square, right, matrix[:, k, k], combined, terms, groups)

    @property
    def flights(self) -> Indices:
        """Numbers (g,) of all flights, which index `square` (g, k, k)."""
        return np.arange(len(self.total))

    def ridge(self, active: Sequence[int]) -> Array:
        """Ridge (a,) of active columns in a flight, in units of a column's square: none on named
        ones."""
        return np.where(np.asarray(active, dtype=np.intp) < self.terms, 0.0, _RIDGE)

    def with_functions(self, named: Sequence[int], picked: Sequence[int]) -> list[int]:
        """Return the columns of named terms and of functions."""
        return [*named, *(column for k in picked for column in self.groups[k])]

    def solved(self, flights: Indices, active: Sequence[int]) -> Array:
        """Return the values (a,) of the active columns that these flights (f,) give: the ridge
        solution, dimensionless as the columns are."""
        index = np.asarray(active, dtype=np.intp)
        square = self.square[np.ix_(flights, index, index)].sum(axis=0)
        square += np.diag(len(flights) * self.ridge(active) + TRACE)
        right = self.right[np.ix_(flights, index)].sum(axis=0)
        return np.asarray(np.linalg.solve(square, right))

    def gain(self, flights: Indices, active: Sequence[int], values: Array) -> Array:
        """Return the fall (f,) of the sum of squares of flights under these values, (a,) or (f, a):
        ``2 v'b - v'Av``, in units of the whitened residual's square."""
        index = np.asarray(active, dtype=np.intp)
        square, right = self.square[np.ix_(flights, index, index)], self.right[flights][:, index]
        values = np.broadcast_to(values, right.shape)
        return np.asarray(
            2.0 * np.einsum("fa,fa->f", values, right)
            - np.einsum("fa,fab,fb->f", values, square, values)
        )

    def left_out(self, flights: Indices, active: Sequence[int]) -> Array:
        """Return the gain (f,) of each flight under the values that the others give, in units of
        the whitened residual's square."""
        if not len(active):
            return np.zeros(len(flights))
        index = np.asarray(active, dtype=np.intp)
        square, right = self.square[np.ix_(flights, index, index)], self.right[flights][:, index]
        others = square.sum(axis=0) - square
        others += np.diag((len(flights) - 1) * self.ridge(active) + TRACE)
        values = np.linalg.solve(others, (right.sum(axis=0) - right)[:, :, None])[:, :, 0]
        return self.gain(flights, active, values)

    def chosen(self, flights: Indices, named: Sequence[int]) -> tuple[int, ...]:
        """Return the functions that join the named columns in the model, chosen on these flights
        alone.

        Each time the one that predicts each of them from the others best, until none lowers their
        error by more than `WORTH`.
        """
        picked: tuple[int, ...] = ()
        total = float(self.total[flights].sum())
        now = float(self.left_out(flights, named).sum())
        square, right = self.square[flights].sum(axis=0), self.right[flights].sum(axis=0)
        while len(picked) < _MOST:
            active = self.with_functions(named, picked)
            gains = {
                k: float(self.left_out(flights, [*active, *self.groups[k]]).sum())
                for k in self._inside(square, right, len(flights), active, picked)[:_TRIED]
            }
            best = max(gains, key=lambda k: gains[k], default=None)
            if best is None or gains[best] - now <= WORTH * (total - now):
                break
            picked, now = (*picked, best), gains[best]
        return picked

    def predicted(self, named: Sequence[int]) -> Array:
        """Return the gain (g,) of each flight under functions that the others chose and fitted,
        with the named columns in the model; in units of the whitened residual's square."""
        gains = np.zeros(len(self.total))
        for out in np.array_split(self.flights, min(len(self.total), _GROUPS)):
            others = np.setdiff1d(self.flights, out)
            active = self.with_functions(named, self.chosen(others, named))
            if active:
                gains[out] = self.gain(out, active, self.solved(others, active))
        return gains

    def _inside(
        self, square: Array, right: Array, count: int, active: list[int], barred: Sequence[int]
    ) -> list[int]:
        """Functions by the gain on the flights that they are fitted to, largest first.

        square (k, k), right (k,) : sums over the `count` flights.
        """
        if active:
            own = square[np.ix_(active, active)] + np.diag(count * self.ridge(active) + TRACE)
            share = np.linalg.solve(own, square[active])
            square = square - square[:, active] @ share
            right = right - share.T @ right[active]
        gains: dict[int, float] = {}
        for size in {len(columns) for columns in self.groups.values()}:
            alike = [k for k, columns in self.groups.items() if len(columns) == size]
            index = np.array([self.groups[k] for k in alike], dtype=np.intp)
            blocks = square[index[:, :, None], index[:, None, :]]
            blocks += (count * _RIDGE + TRACE) * np.eye(size)
            driven = right[index]
            values = np.linalg.solve(blocks, driven[:, :, None])[:, :, 0]
            gains |= dict(zip(alike, np.einsum("ks,ks->k", values, driven).tolist(), strict=True))
        return sorted(gains.keys() - set(barred), key=lambda k: (-gains[k], k))


def bands(
    problem: FunctionProblem, functions: BasisFunctions, rest: Sequence[int], picked: Sequence[int]
) -> list[dict[str, Any]]:
    """Each picked function of one variable at its nodes beside the columns `rest`, with its
    pointwise 95 % band; zero at the mean over the flights."""
    active = problem.with_functions(rest, picked)
    count = len(problem.total)
    values = problem.solved(problem.flights, active)
    square = problem.square[:, active][:, :, active]
    inverse = np.linalg.inv(square.sum(axis=0) + np.diag(count * problem.ridge(active) + TRACE))
    score = problem.right[:, active] - square @ values
    between = inverse @ (score.T @ score) @ inverse * (count / (count - 1.0))
    combined = problem.combined[np.ix_(active, active)]
    values, between = combined @ values, combined @ between @ combined.T
    wide = float(stdtrit(count - 1, 0.975))
    found, first = [], len(rest)
    for p in picked:
        group, size = functions.each[p], len(problem.groups[p])
        part = slice(first, first + size)
        first += size
        if len(group.nodes) != size + 1:
            continue
        mean = np.mean([own[:, group.columns].mean(axis=0) for own in functions.columns], axis=0)
        at = np.tril(np.ones((size + 1, size)), -1) - mean
        error = wide * np.sqrt(np.einsum("nk,kl,nl->n", at, between[part, part], at))
        level = at @ values[part]
        found.append(
            {
                "variable": group.variables[0],
                "at": list(group.nodes),
                "effect": level.tolist(),
                "low": (level - error).tolist(),
                "high": (level + error).tolist(),
            }
        )
    return found
