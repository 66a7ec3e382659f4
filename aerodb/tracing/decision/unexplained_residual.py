"""Does anything in the state still predict the residual, flight after flight, where no template
fits?

A flexible model (additive piecewise-linear functions of each variable and products of pairs, ridge)
is fitted to all flights but one and predicts the one left out. Only if it beats a prediction of
zero over the flights is there something unnamed. The result names variables, not effects: it is a
question to the aerodynamicist, never an increment. See docs/method/tracing.md, section 14.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtr

from aerodb.errors import InputError
from aerodb.support import NOTABLE, Array, in_processes
from aerodb.tracing.decision.functions import BasisFunctions, FunctionProblem, functions_of
from aerodb.tracing.decision.residual_records import FlightResidual, ResidualRecord, records_in_band
from aerodb.tracing.decision.ridge_model import (
    Features,
    RidgeProblem,
    features_of,
    left_out_skills,
    ridge_problem,
    variables_of,
)
from aerodb.tracing.estimates import by_families
from aerodb.tracing.settings import TracingSettings

#: A variable matters if the model without it loses this part of the skill.
_MATTERS = NOTABLE


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
        """Return the skills (g,), 1 - SSE / SST and dimensionless, of the model (few or all
        variables) that found another residual."""
        return self.skills_few if other.few else self.skills_all


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
    flights = [records_in_band(flight, axes, names, more, settings) for flight in left]
    parts = {axis: [flight[axis] for flight in flights] for axis in axes}
    parts = {
        axis: records
        for axis, records in parts.items()
        if all(len(record.residual) for record in records)
    }
    features: dict[tuple[int, ...], Features] = {}
    for records in parts.values():
        if variables_of(records) not in features:
            features[variables_of(records)] = features_of(
                [record.variables for record in records], names
            )
    problems = {
        axis: ridge_problem(records, features[variables_of(records)], settings.inflation_limit)
        for axis, records in parts.items()
    }
    judged = dict(zip(problems, in_processes(left_out_skills, problems.values()), strict=True))
    # functions of one or two variables need less data than all together; each test has half the
    # level
    shared: dict[tuple[int, ...], BasisFunctions] = {}
    for records in parts.values():
        if variables_of(records) not in shared:
            shared[variables_of(records)] = _functions(records, [*names, *more], few_names)

    def by_few(records: Sequence[ResidualRecord]) -> tuple[Array, tuple[str, ...]]:
        return _few(records, shared[variables_of(records)], settings.inflation_limit)

    few = dict(zip(parts, in_processes(by_few, parts.values()), strict=True))
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

    flights = [
        records_in_band(
            flight, [axis for axis in axes if axis in flight.evidence.residual], names, (), settings
        )
        for flight in left
    ]

    def error(axis: str) -> float:
        records = [flight[axis] for flight in flights if axis in flight]
        few = len(records) < settings.fewest
        if few or not all(len(record.residual) for record in records):
            return 0.0
        skills, _ = _few(records, _functions(records, names, names), settings.inflation_limit)
        power = [float(np.mean(record.residual**2)) for record in records]
        return float(np.sqrt(max(0.0, float(np.mean(skills * power)))))

    return {axis: error(axis) for axis in axes}


def _known_in_all(flights: Sequence[Mapping[str, Array]]) -> set[str]:
    """Names of variables that all flights have without a gap."""
    return set.intersection(
        *(
            {name for name, values in flight.items() if np.isfinite(values).all()}
            for flight in flights
        )
    )


def _functions(
    records: Sequence[ResidualRecord], names: Sequence[str], used: Sequence[str]
) -> BasisFunctions:
    """Functions of one or two of the `used` variables, not of their rates of change: the noise of a
    flow angle in these is that of the residual."""
    variables, columns = [], {name: names.index(name) for name in used}
    for record in records:
        values = np.concatenate([record.variables, record.further], axis=1)
        variables.append({name: values[:, column] for name, column in columns.items()})
    return functions_of(variables)


def _few(
    records: Sequence[ResidualRecord], functions: BasisFunctions, inflation_limit: float
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
        f" {on}; no known effect fits"
    )


def _judged(
    axis: str,
    names: list[str],
    problem: RidgeProblem,
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
        others = [left_out_skills(problem.without(name), ridges)[0] for name in names]
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

    noisy : per copy of all flights, the same axes in the same order. Skills are per flight (g,),
    dimensionless.
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
