"""Does anything in the state still predict the residual, flight after flight, where no template
fits?

A flexible model (additive piecewise-linear functions of each variable and products of pairs, ridge)
is fitted to all flights but one and predicts the one left out. Only if it beats a prediction of
zero over the flights is there something unnamed. The result names variables, not effects: it is a
question to the aerodynamicist, never an increment. docs/method/tracing.md, section 14.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import stdtr

from aerodb.errors import InputError
from aerodb.support import Array, in_threads
from aerodb.tracing.decision.functions import (
    RANK,
    FunctionProblem,
    Functions,
    functions_of,
    separable,
)
from aerodb.tracing.estimates import by_families
from aerodb.tracing.evidence import Evidence, band_limited, stretches
from aerodb.tracing.settings import TracingSettings

#: Knots of a variable's function: quantiles of its values over all flights.
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Ridge weights tried, in parts of the features' own sum of squares; chosen by leaving out flights
#: of the training set.
_RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
#: Groups of flights among which the weight is chosen: pairs of two hundred flights would be twenty
#: thousand.
_GROUPS = 5
#: A variable matters if the model without it loses this part of the skill.
_MATTERS = 0.2


@dataclass(frozen=True)
class UnexplainedResidual:
    """What is predictable in the residual of one axis, and named by no hypothesis.

    skill : fall of the left-out flights' sum of squares (1: all explained, 0: nothing). p_adjusted
    : over the axes, one-sided t over flights. variables : those that the skill rests on, the
    strongest first; empty where nothing is found. skills, power (flights,) : per flight, and the
    residual's mean square in the band of tracing that it is a part of. few : whether functions of
    one or two variables predict it, and not all variables together; skills_all, skills_few
    (flights,) : skills of either model.
    """

    axis: str
    found: bool
    skill: float
    p_adjusted: float
    variables: tuple[str, ...]
    skills: tuple[float, ...]
    because: str
    power: tuple[float, ...] = ()
    few: bool = False
    skills_all: tuple[float, ...] = ()
    skills_few: tuple[float, ...] = ()

    def skills_as(self, other: "UnexplainedResidual") -> tuple[float, ...]:
        """Return the skills of the model that found another residual."""
        return self.skills_few if other.few else self.skills_all


class Record(NamedTuple):
    """One axis of a flight in the band.

    variables (m, v), residual (m,), and a basis (m, s) of what sensors could explain; further
    (m, w) : variables over which only functions of one or two are tried.
    """

    variables: Array
    residual: Array
    basis: Array
    further: Array


@dataclass(frozen=True)
class FlightResidual:
    """One flight's residual beside the candidate, and the variables that may predict it.

    evidence : its residual has the accepted terms subtracted; its columns are those of the sensors:
    what any of them could explain, whatever its size, is not unexplained. variables : name -> (n,);
    further : likewise, those over which functions of one or two are tried; all where empty.
    """

    evidence: Evidence
    variables: Mapping[str, Array]
    further: Mapping[str, Array] = field(default_factory=dict)


def unexplained_by_axis(
    left: Sequence[FlightResidual], settings: TracingSettings
) -> tuple[UnexplainedResidual, ...]:
    """Return what is unexplained on each axis, over at least `settings.fewest` flights.

    Raises InputError for fewer flights, or when the flights have no variable in common.
    """
    if len(left) < settings.fewest:
        raise InputError(
            f"{len(left)} flights are too few to find an unexplained residual",
            "unexplained residual",
            f"give at least {settings.fewest}",
        )
    names = sorted(set.intersection(*(set(flight.variables) for flight in left)))
    if not names:
        raise InputError(
            "the flights have no variable in common",
            "unexplained residual",
            "give each the database's variables",
        )
    axes = [
        axis
        for axis in left[0].evidence.residual
        if all(axis in flight.evidence.residual for flight in left)
    ]
    few_names = sorted(_known_in_all([flight.further or flight.variables for flight in left]))
    more = [name for name in few_names if name not in names]
    flights = in_threads(
        partial(_in_band, axes=axes, names=names, more=more, settings=settings), left
    )
    parts = {axis: [flight[axis] for flight in flights] for axis in axes}
    parts = {
        axis: records
        for axis, records in parts.items()
        if all(len(record.residual) for record in records)
    }
    features: dict[tuple[int, ...], _Features] = {}
    for records in parts.values():
        if _which(records) not in features:
            features[_which(records)] = _features([record.variables for record in records], names)
    problems = dict(
        zip(
            parts,
            in_threads(
                lambda r: _problem(r, features[_which(r)], settings.inflation_limit),
                parts.values(),
            ),
            strict=True,
        )
    )
    judged = dict(zip(parts, in_threads(_left_out_skills, problems.values()), strict=True))
    # functions of one or two variables need less data than all together; each test has half the
    # level
    shared: dict[tuple[int, ...], Functions] = {}
    for records in parts.values():
        if _which(records) not in shared:
            shared[_which(records)] = _functions(records, [*names, *more], few_names)
    few = dict(
        zip(
            parts,
            in_threads(
                lambda r: _few(r, shared[_which(r)], settings.inflation_limit), parts.values()
            ),
            strict=True,
        )
    )
    p = [_one_sided(skills) for skills, *_ in (*judged.values(), *few.values())]
    rows = range(len(parts))
    adjusted = by_families(np.array(p), [rows, [len(parts) + row for row in rows]])
    found = []
    for row, axis in enumerate(parts):
        p_all, p_few = float(adjusted[row]), float(adjusted[row + len(parts)])
        of_all = _judged(axis, names, problems[axis], *judged[axis], p_all, settings)
        skills, variables = few[axis]
        of_all = replace(of_all, skills_few=tuple(skills.tolist()))
        if p_few < settings.level and variables and not of_all.found:
            found.append(_by_functions(of_all, variables, p_few))
        else:
            found.append(of_all)
    return tuple(found)


def model_errors(
    left: Sequence[FlightResidual], axes: Sequence[str], settings: TracingSettings
) -> dict[str, float]:
    """Return, for each axis, the rms [coefficient] of what functions of one or two variables
    predict of the residual of flights that were left out; zero where that is nothing.

    Columns of the evidence count as explained: without any, also what sensors could explain is part
    of the error. Fewer flights than `settings.fewest` that have an axis show none on it.
    """
    if len(left) < settings.fewest:
        return dict.fromkeys(axes, 0.0)
    names = sorted(_known_in_all([flight.variables for flight in left]))

    def in_band(flight: FlightResidual) -> dict[str, Record]:
        has = [axis for axis in axes if axis in flight.evidence.residual]
        return _in_band(flight, has, names, (), settings)

    flights = in_threads(in_band, left)

    def error(axis: str) -> float:
        records = [flight[axis] for flight in flights if axis in flight]
        few = len(records) < settings.fewest
        if few or not all(len(record.residual) for record in records):
            return 0.0
        skills, _ = _few(records, _functions(records, names, names), settings.inflation_limit)
        power = [float(np.mean(record.residual**2)) for record in records]
        return float(np.sqrt(max(0.0, float(np.mean(skills * power)))))

    return dict(zip(axes, in_threads(error, axes), strict=True))


def _known_in_all(flights: Sequence[Mapping[str, Array]]) -> set[str]:
    """Names of variables that all flights have without a gap."""
    return set.intersection(
        *(
            {name for name, values in flight.items() if np.isfinite(values).all()}
            for flight in flights
        )
    )


def _functions(records: Sequence[Record], names: Sequence[str], used: Sequence[str]) -> Functions:
    """Functions of one or two of the `used` variables, not of their rates of change: the noise of a
    flow angle in these is that of the residual."""
    variables, columns = [], {name: names.index(name) for name in used}
    for record in records:
        values = np.concatenate([record.variables, record.further], axis=1)
        variables.append({name: values[:, column] for name, column in columns.items()})
    return functions_of(variables)


def _few(
    records: Sequence[Record], functions: Functions, inflation_limit: float
) -> tuple[Array, tuple[str, ...]]:
    """Per flight, skill of functions of one or two variables that the others chose; and the
    variables of those that all flights choose."""
    matrices, before = [], np.zeros((functions.size, functions.size))
    for record, columns in zip(records, functions.columns, strict=True):
        whole = np.column_stack([columns, record.residual])
        left = whole - record.basis @ (record.basis.T @ whole)
        matrices.append(left.T @ left)
        apart = columns - columns.mean(axis=0)
        before += apart.T @ apart
    problem = FunctionProblem.of(np.stack(matrices), before, functions, 0, inflation_limit)
    total = np.where(problem.total > 0.0, problem.total, 1.0)
    picked = problem.chosen(problem.flights, ())
    return problem.predicted(()) / total, functions.variables(picked)


def _by_functions(
    of_all: UnexplainedResidual, variables: tuple[str, ...], p: float
) -> UnexplainedResidual:
    """The residual of an axis as functions of one or two variables predict it."""
    skill = float(np.mean(of_all.skills_few))
    return replace(
        of_all,
        found=True,
        skill=skill,
        p_adjusted=p,
        variables=variables,
        skills=of_all.skills_few,
        because=_because(skill, of_all.axis, variables),
        few=True,
    )


def _because(skill: float, axis: str, variables: Sequence[str]) -> str:
    on = ", ".join(variables) or "no single variable"
    return (
        f"{skill:.0%} of what is left on {axis} returns on flights that were left out and rests on"
        f" {on}; no template fits"
    )


def _judged(
    axis: str,
    names: list[str],
    problem: "_Problem",
    skills: Array,
    ridges: Array,
    p: float,
    settings: TracingSettings,
) -> UnexplainedResidual:
    skill = float(skills.mean())
    is_found = bool(p < settings.level)
    variables: tuple[str, ...] = ()
    because = (
        f"nothing in {', '.join(names)} predicts what is left on {axis} of a flight that the model"
        " has not seen"
    )
    if is_found:
        others = [_left_out_skills(problem.without(name), ridges)[0] for name in names]
        lost = {name: skill - float(left.mean()) for name, left in zip(names, others, strict=True)}
        variables = tuple(
            sorted((n for n in names if lost[n] > _MATTERS * skill), key=lambda n: -lost[n])
        )
        because = _because(skill, axis, variables)
    return UnexplainedResidual(
        axis,
        is_found,
        skill,
        p,
        variables,
        tuple(float(s) for s in skills),
        because,
        tuple((problem.total / problem.samples).tolist()),
        skills_all=tuple(float(s) for s in skills),
    )


def without_state_noise(
    found: Sequence[UnexplainedResidual],
    noisy: Sequence[Sequence[UnexplainedResidual]],
    settings: TracingSettings,
) -> tuple[UnexplainedResidual, ...]:
    """Return what is unexplained, less what noise of the states predicts of itself.

    Noise of a variable is in the residual as well, and so predicts it. What it predicts grows with
    its power, as the rest does not: without the noise, the fall of a flight's sum of squares is
    twice that of the flights less that of their copies with twice the noise (simulation-
    extrapolation: Cook & Stefanski 1994). Only a fall that remains over the flights is unexplained.

    noisy : per copy of all flights, the same axes in the same order.
    """
    left = []
    for place, each in enumerate(found):
        if not each.found:
            left.append(each)
            continue
        power = np.maximum(each.power, 1e-300)
        falls = [np.multiply(copy[place].skills_as(each), copy[place].power) for copy in noisy]
        skills = 2.0 * np.array(each.skills) - np.mean(falls, axis=0) / power
        p = max(each.p_adjusted, _one_sided(skills))
        skill, is_found = float(skills.mean()), bool(p < settings.level)
        because = (
            _because(skill, each.axis, each.variables)
            if is_found
            else f"what predicts {each.axis} is noise of the states: with more of it, more is"
            " predicted"
        )
        left.append(
            replace(
                each,
                found=is_found,
                skill=skill,
                p_adjusted=p,
                variables=each.variables if is_found else (),
                skills=tuple(skills.tolist()),
                because=because,
            )
        )
    return tuple(left)


def _one_sided(skills: Array) -> float:
    """p of "the mean skill over flights is not above zero"."""
    spread = float(skills.std(ddof=1))
    if spread == 0.0:
        return 1.0
    return float(stdtr(len(skills) - 1, -skills.mean() / (spread / np.sqrt(len(skills)))))


def _in_band(
    flight: FlightResidual,
    axes: Sequence[str],
    names: Sequence[str],
    more: Sequence[str],
    settings: TracingSettings,
) -> dict[str, Record]:
    """Axis -> variables (m, v), residual (m,) and an orthonormal basis (m, s) of its level and of
    what the columns of the evidence (sensors) could explain, in the tracing band; the residual
    without its part in that basis.

    Axes that are usable at the same samples have the same array of variables.
    """
    evidence, variables = flight.evidence, [flight.variables[name] for name in names]
    variables += [flight.further[name] for name in more]
    known = np.logical_and.reduce([np.isfinite(row) for row in variables])
    records: dict[str, Record] = {}
    for same in evidence.usable_alike(axes):
        usable = evidence.usable[same[0]]
        tangents = {
            axis: [columns[axis] for columns in evidence.columns.values() if axis in columns]
            for axis in same
        }
        rows = [
            *variables,
            *(row for axis in same for row in (evidence.residual[axis], *tangents[axis])),
        ]
        limited = [
            band_limited(
                [row[part] for row in rows],
                (usable & known)[part],
                evidence.step,
                settings.bandwidth,
            )
            for part in stretches(usable, evidence.step, settings.bandwidth, settings.order)
        ]
        joined = np.concatenate(limited) if limited else np.zeros((0, len(rows)))
        shared, first = np.ascontiguousarray(joined[:, : len(names)]), len(variables)
        further = joined[:, len(names) : first]
        for axis in same:
            last = first + 1 + len(tangents[axis])
            records[axis] = _record(shared, joined[:, first], joined[:, first + 1 : last], further)
            first = last
    return records


def _record(variables: Array, residual: Array, tangents: Array, further: Array) -> Record:
    if len(residual) == 0:
        return Record(variables, residual, np.zeros((0, 0)), further)
    explained = np.column_stack([np.ones(len(residual)), tangents])
    size = np.linalg.norm(explained, axis=0)
    left, singular, _ = np.linalg.svd(
        explained[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    basis = left[:, singular > RANK * singular[0]]
    return Record(variables, residual - basis @ (basis.T @ residual), basis, further)


@dataclass(frozen=True)
class _Problem:
    """Products of the features: square (g, f, f), right (g, f) with the residual, total (g,) of it,
    and its samples (g,), by flight; and the variables that each feature is made of."""

    square: Array
    right: Array
    total: Array
    samples: Array
    made_of: tuple[frozenset[str], ...]

    def without(self, name: str) -> "_Problem":
        """The same without what is made of one variable."""
        kept = [k for k, names in enumerate(self.made_of) if name not in names]
        return _Problem(
            self.square[:, kept][:, :, kept],
            self.right[:, kept],
            self.total,
            self.samples,
            tuple(self.made_of[k] for k in kept),
        )

    def separable(self, before: Array, inflation_limit: float) -> "_Problem":
        """The same without the combinations of features that sensors explain but for a part ``1 /
        inflation_limit`` of their variance: what is left of those is noise, and the residual shares
        it. before (f, f) : square over all flights before what sensors could explain was taken out.
        """
        keep = separable(self.square.sum(axis=0), before, inflation_limit)
        return replace(self, square=keep.T @ self.square @ keep, right=self.right @ keep)


@dataclass(frozen=True)
class _Features:
    """Hinge functions of each variable and products of pairs: the block (m, f) of each flight, and
    what each is made of."""

    blocks: list[Array]
    made_of: tuple[frozenset[str], ...]


def _which(records: Sequence[Record]) -> tuple[int, ...]:
    """The arrays of variables, which axes may share."""
    return tuple(id(record.variables) for record in records)


def _features(variables: Sequence[Array], names: Sequence[str]) -> _Features:
    """Of the variables (m, v) of each flight; the residual is not looked at, so that knots and
    scales may come from all."""
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
    return _Features(blocks, tuple(made_of))


def _problem(records: Sequence[Record], features: _Features, inflation_limit: float) -> _Problem:
    """Per flight: the features' products without the flight's own level, and without what sensors
    could explain, which is taken out of them as it is out of the residual."""
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
    problem = _Problem(np.stack(squares), np.stack(right), total, samples, features.made_of)
    return problem.separable(before, inflation_limit)


def _left_out_skills(problem: _Problem, ridges: Array | None = None) -> tuple[Array, Array]:
    """Per flight, 1 - SSE / SST of the prediction by the others, and the ridge; it is chosen inside
    the others, unless given."""
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
