"""Whether a claimed shape fits: named terms against flexible functions of the observed variables.

A term of the library is a name and a shape. Where the truth has another shape, or depends on other
variables, the nearest term of the library is significant all the same, and no rival of the library
tells. Here each named term competes on its axis with functions of one or two observed variables
that are chosen and fitted without the flight that they predict. docs/method/tracing.md, section 26.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
from scipy.special import ndtri

from aerodb.effects import SURFACE_MOTION, Hypothesis
from aerodb.support import HALF, Array, in_processes
from aerodb.tables import HAT_RATES
from aerodb.tracing.decision.axis_products import AxisProducts
from aerodb.tracing.decision.explanation_sets import LOST
from aerodb.tracing.decision.findings import Finding, doubted
from aerodb.tracing.decision.functions import (
    TRACE,
    WORTH,
    BasisFunctions,
    FunctionProblem,
    bands,
    functions_of,
    present,
    with_past,
)
from aerodb.tracing.decision.residual_records import FlightResidual
from aerodb.tracing.estimates import OFFSET, paired_p
from aerodb.tracing.settings import TracingSettings

#: Flights (or folds of them) from which shapes are compared, or a scatter is estimated.
FEWEST_SHAPED: Final = 4
#: Part of the gain of functions of its own variables that a term must reach to keep its name. Of a
#: sensor's gain, that which a function must reach to stand beside it; `LOST` where the sensor gains
#: on no other axis.
_NEARLY: Final = 0.8
#: Terms whose shapes a term may stand for together, as a combination of what both miss. Of 20 such
#: terms in noise, one at a time finds 6, two 14; neither is wrong about 60 right terms.
_PARTNERS: Final = 2
#: Part of what an increment model explains that a wrong sensor must explain to be mended first.
#: The same part of what a term leaves takes its name, where another shape explains it.
_MOST: Final = HALF


def with_checked_shapes(
    flights: Sequence[FlightResidual],
    findings: Sequence[Finding],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
) -> tuple[Finding, ...]:
    """Return the findings; names that another shape beats are no longer confirmed alone.

    Parameters
    ----------
    flights : residuals against the current database, with the columns of all accepted terms and of
        all sensors, and the variables that effects may depend on
    findings : of tracing with the same database
    hypotheses : the library

    Returns
    -------
    tuple : where a function of observed variables predicts flights that were left out better than a
        confirmed term, the finding has a `shape`. If it depends on the present values of what the
        term depends on and of nothing else, gains little more, and takes away less than half of
        what the term leaves, the term stays confirmed; else it is suspected. So is a term that is
        needed only beside another one's shape (`shape.of`). A sensor with which such a function on
        one axis gains as much is ambiguous.
        Below four flights nothing changes.

    References
    ----------
    docs/method/tracing.md, section 26; Ibragimov & Mueller, JBES 28(4), 2010 (flights as units).
    """
    judged = [f for f in findings if f.verdict in ("confirmed", "sensor")]
    if len(flights) < FEWEST_SHAPED or not judged:
        return tuple(findings)
    shapes = _Shapes.of(flights, [f.hypothesis for f in findings], hypotheses, settings)

    def checked(finding: Finding) -> Finding:
        if finding.verdict == "sensor":
            return shapes.sensor(finding)
        if finding.effect == OFFSET:
            return shapes.constant(finding)
        return shapes.term(finding) if shapes.observed(finding) else finding

    changed = {finding.hypothesis: finding for finding in in_processes(checked, judged)}
    return tuple(changed.get(f.hypothesis, f) for f in findings)


def imitations(
    flights: Sequence[FlightResidual],
    models: Mapping[str, Sequence[str]],
    sensors: Sequence[str],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
) -> dict[str, tuple[str, ...]]:
    """Return body axis -> variables of at most two functions that predict left-out flights better
    than all terms of the axis' increment model together, or parameter of a sensor that explains
    most of what they do: the terms only imitate it.

    flights : as for `with_checked_shapes`. models : body axis -> ids of the model's terms.
    sensors : ids of those that may be wrong. Functions of the present values
    of all that the terms depend on do not count: they are the terms, in a shape of more freedom.
    docs/method/tracing.md, section 27.
    """
    if len(flights) < FEWEST_SHAPED:
        return {}
    terms = dict.fromkeys(id for ids in models.values() for id in ids)
    shapes = _Shapes.of(flights, [*terms], hypotheses, settings)
    better = {axis: shapes.instead_of(axis, ids, sensors) for axis, ids in models.items()}
    return {axis: variables for axis, variables in better.items() if variables}


@dataclass(frozen=True)
class _Shapes:
    """The comparison of names and functions. terms : ids of all that was found."""

    flights: Sequence[FlightResidual]
    functions: BasisFunctions
    known: Mapping[str, Hypothesis]
    terms: Sequence[str]
    settings: TracingSettings
    cached: dict[str, FunctionProblem] = field(default_factory=dict, init=False, repr=False)
    products: dict[tuple[str, bool], Sequence[AxisProducts]] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(
        cls,
        flights: Sequence[FlightResidual],
        terms: Sequence[str],
        hypotheses: Sequence[Hypothesis],
        settings: TracingSettings,
    ) -> "_Shapes":
        """The comparison with functions of all variables of the flights, and of their past."""
        functions = functions_of([with_past(f.variables, f.evidence.step) for f in flights])
        return cls(flights, functions, {h.id: h for h in hypotheses}, terms, settings)

    def term(self, finding: Finding) -> Finding:
        """A confirmed term against the functions that could stand in its place on its axes, or in
        that of another term there."""
        on = self._acts_on(finding)
        for axis in on:
            problem, named = self._problem(axis), self._named(axis)
            own, rest = self._own_and_rest(finding, axis)
            before = problem.left_out(problem.flights, range(len(named)))
            after = problem.predicted(rest)
            fall, p = self._fall(problem, after, before)
            if not (fall > WORTH and p < self.settings.level):
                continue
            picked = problem.chosen(problem.flights, rest)
            apart = self._apart(problem, own, rest, picked)
            if not picked or apart is None:
                continue
            rival = [k for k in picked if k not in apart]
            if apart:  # other defects of the axis: they stand beside the term and beside its rival
                after = problem.left_out(problem.flights, problem.with_functions(rest, picked))
                before = problem.left_out(
                    problem.flights, problem.with_functions([*rest, own], apart)
                )
                fall, p = self._fall(problem, after, before)
            beside = problem.with_functions(rest, apart)
            without = float(problem.left_out(problem.flights, beside).sum())
            share = (float(before.sum()) - without) / max(float(after.sum()) - without, TRACE)
            information = float(problem.square[:, own, own].sum()) / problem.combined[own, own] ** 2
            misfit = np.sqrt(max(0.0, float((after - before).sum())) / information)
            return self._other(finding, axis, problem, beside, rival, fall, p, misfit, share)
        return next(filter(None, (self._leaning(finding, axis) for axis in on)), finding)

    def _own_and_rest(self, finding: Finding, axis: str) -> tuple[int, list[int]]:
        """The column of a term on an axis, and those of the others there."""
        named = self._named(axis)
        own = named.index(finding.hypothesis)
        return own, [k for k in range(len(named)) if k != own]

    def _acts_on(self, finding: Finding) -> list[str]:
        """The axis on which a term gains most, and others on which its gain is significant: on the
        rest, such as the CY of a drag, it claims nothing that another effect could do better."""
        gains = {}
        for axis in finding.axis:
            if finding.hypothesis in self._named(axis):
                gains[axis] = self._gain(
                    self._problem(axis), *self._own_and_rest(finding, axis), ()
                )
        most = max(gains, key=lambda axis: float(gains[axis].sum()), default=None)
        return [
            axis
            for axis, gain in gains.items()
            if axis == most or paired_p(gain, np.zeros(len(gain))) < self.settings.level
        ]

    def _leaning(self, finding: Finding, axis: str) -> Finding | None:
        """The finding as suspected where it is needed only beside the shape of another term, or
        beside those of two, of which it is a combination.

        In their place stand functions of other variables than the finding's own, which predict as
        well; given them, the finding gains little. None where it leans on no other term.
        """
        problem, named = self._problem(axis), self._named(axis)
        own, others = self._own_and_rest(finding, axis)
        before = problem.left_out(problem.flights, range(len(named)))
        groups = (group for n in range(1, _PARTNERS + 1) for group in combinations(others, n))
        for partners in groups:
            rest = [k for k in range(len(named)) if k not in partners]
            picked = problem.chosen(problem.flights, rest)
            variables = self.functions.variables(picked)
            apart = self._drivers(finding).isdisjoint(_channels(variables))
            after = problem.predicted(rest)
            if not picked or not apart or float(after.sum()) < float(before.sum()):
                continue
            beside = [k for k in rest if k != own]
            alone = self._gain(problem, own, [*beside, *partners], ())
            if not self._kept(problem, own, beside, picked, alone):
                shape = _shape(axis, variables, *self._fall(problem, after, before), [])
                names = [named[k] for k in partners]
                return doubted(
                    finding,
                    f"a function of {', '.join(variables)} in the place of {' and '.join(names)}"
                    f" predicts {axis} of left-out flights as well, and leaves it nothing",
                    verdict="suspected",
                    shape=shape | {"of": names[0], **({"with": names[1]} if names[1:] else {})},
                )
        return None

    def instead_of(self, axis: str, ids: Sequence[str], sensors: Sequence[str]) -> tuple[str, ...]:
        """Variables of the functions that beat all of these terms together, or parameter of the
        sensor that explains most of what they do; none where none does."""
        problem, named = self._problem(axis), self._named(axis)
        rest = [number for number, id in enumerate(named) if id not in ids]
        before = problem.left_out(problem.flights, range(len(named)))
        left = float((problem.total - before).sum())
        for sensor in sensors:
            freed = self._made(axis, [*(named[k] for k in rest), sensor], sensor)
            gain = float(freed.left_out(freed.flights, range(freed.terms)).sum())
            if gain > 0.0 and gain >= _MOST * (float(freed.total.sum()) - left):
                return (self.known[sensor].parameter,)
        if float(problem.predicted(rest).sum()) <= float(before.sum()):
            return ()
        variables = self.functions.variables(problem.chosen(problem.flights, rest))
        drivers = _channels(d for id in ids for d in self.known[id].drivers)
        if set(variables) == set(map(present, variables)) and _channels(variables) == drivers:
            return ()
        return variables

    def constant(self, finding: Finding) -> Finding:
        """A constant is suspected where a function in addition to the named terms predicts its
        axis, and may have that level: the level of an effect is that of its shape."""
        (axis,) = finding.axis
        problem = self._problem(axis)
        named = range(problem.terms)
        before = problem.left_out(problem.flights, named)
        fall, p = self._fall(problem, problem.predicted(named), before)
        variables = self.functions.variables(problem.chosen(problem.flights, named))
        if not (fall > WORTH and p < self.settings.level and variables):
            return finding
        if min(map(abs, finding.ci95)) > self._largest_level(axis, variables, fall):
            return finding
        return doubted(
            finding,
            f"an effect of {', '.join(variables)} on {axis} is not named, and its level may be this"
            " constant",
            verdict="suspected",
            shape=_shape(axis, variables, fall, p, []),
        )

    def _largest_level(self, axis: str, variables: Sequence[str], fall: float) -> float:
        """The level that an effect of these variables may have on an axis where it explains this
        part of what varies: as much larger than its changes as a variable is than its own;
        infinite where that is not known."""
        levels = []
        for flight in self.flights:
            good = flight.evidence.usable[axis]
            varies = float(np.sqrt(fall) * np.std(flight.evidence.residual[axis][good]))
            for name in set(map(present, variables)) & flight.variables.keys():
                values = flight.variables[name][good]
                spread = float(np.std(values))
                known = np.isfinite(varies) and spread > 0.0
                levels.append(varies * float(np.abs(values).max()) / spread if known else np.inf)
        return max(levels, default=np.inf)

    def sensor(self, finding: Finding) -> Finding:
        """A freed sensor against functions on the one axis on which it gains most.

        A sensor that gains on several axes is known by that; one that gains on a single axis has no
        other witness.
        """
        axes = [
            axis
            for axis in finding.axis
            if all(axis in flight.evidence.residual for flight in self.flights)
        ]
        gains = {axis: self._freed_gain(axis, finding.hypothesis) for axis in axes}
        if not gains:
            return finding
        total = np.sum(list(gains.values()), axis=0)
        axis = max(gains, key=lambda a: float(gains[a].sum()))
        nothing = np.zeros(len(total))
        alone = not any(
            paired_p(gain, nothing) < self.settings.level
            for other, gain in gains.items()
            if other != axis
        )
        problem = self._problem(axis)
        named = range(problem.terms)
        instead = problem.predicted(named) - problem.left_out(problem.flights, named)
        share = float(instead.sum()) / max(float(total.sum()), TRACE)
        as_well = share >= _NEARLY and paired_p(total, instead) >= self.settings.level
        may_be = alone and share >= LOST
        variables = self.functions.variables(problem.chosen(problem.flights, named))
        past = any(present(name) != name for name in variables)
        if (
            finding.effect in SURFACE_MOTION
            and past
            and set(map(present, variables)) <= self._drivers(finding)
        ):
            return finding  # the past of the surface itself: the same defect in other words
        p = paired_p(instead, nothing)
        names = [*self._named(axis), finding.hypothesis]
        freed = self._made(axis, names, finding.hypothesis, True)
        rest = range(len(names) - 1)
        picked = freed.chosen(freed.flights, rest)
        if not alone and self._apart(freed, len(names) - 1, rest, picked) is None:
            return finding
        if not variables or not (as_well or may_be) or p >= self.settings.level:
            return finding
        how = "as well" if as_well else "too, and no other axis speaks for the sensor"
        return doubted(
            finding,
            f"an effect of {', '.join(variables)} on {axis}, of a shape that no known effect has,"
            f" predicts left-out flights {how}",
            verdict="ambiguous_sensor",
            shape=_shape(axis, variables, share, p, []),
        )

    def _apart(
        self, problem: FunctionProblem, own: int, rest: Sequence[int], picked: Sequence[int]
    ) -> list[int] | None:
        """Return those of the picked functions that are other defects of the axis, given which a
        named column keeps its gain, while the others take its place; None where it keeps its name.

        It keeps it where it keeps its gain given the functions, or given all but one of them, where
        that one predicts no more than the named column does in its place.
        """
        alone = self._gain(problem, own, rest, ())
        if self._kept(problem, own, rest, picked, alone):
            return None
        every = problem.left_out(problem.flights, problem.with_functions(rest, picked))
        apart: list[list[int]] = []
        for one in picked if len(picked) > 1 else ():
            others = [p for p in picked if p != one]
            if not self._kept(problem, own, rest, others, alone):
                continue
            instead = problem.left_out(
                problem.flights, problem.with_functions([*rest, own], others)
            )
            fall, p = self._fall(problem, every, instead)
            if not (fall > WORTH and p < self.settings.level):
                return None
            apart.append(others)
        return apart[0] if len(apart) == 1 else []

    def _kept(
        self,
        problem: FunctionProblem,
        own: int,
        rest: Sequence[int],
        functions: Sequence[int],
        alone: Array,
    ) -> bool:
        """Return whether a named column keeps its gain `alone` (g,) given functions."""
        beside = self._gain(problem, own, rest, functions)
        kept = float(beside.sum()) >= LOST * float(alone.sum())
        return kept and paired_p(beside, np.zeros(len(beside))) < self.settings.level

    @staticmethod
    def _gain(
        problem: FunctionProblem, own: int, rest: Sequence[int], functions: Sequence[int]
    ) -> Array:
        """Return what a named column gains on flights left out (g,), given `rest` and functions."""
        with_own, without = (
            problem.left_out(problem.flights, problem.with_functions(columns, functions))
            for columns in ([*rest, own], rest)
        )
        return np.asarray(with_own - without)

    @staticmethod
    def _fall(problem: FunctionProblem, after: Array, before: Array) -> tuple[float, float]:
        """Mean over the flights of the part by which the remaining error falls, and its p."""
        fall = (after - before) / np.maximum(problem.total - before, TRACE)
        return float(fall.mean()), paired_p(fall, np.zeros(len(fall)))

    def _other(
        self,
        finding: Finding,
        axis: str,
        problem: FunctionProblem,
        rest: Sequence[int],
        picked: Sequence[int],
        fall: float,
        p: float,
        misfit: float,
        share: float,
    ) -> Finding:
        """The finding with another shape. misfit : rms error of the effect in units of its
        parameter, by what its shape misses. share : what the term gains, in parts of what the
        functions gain in its place."""
        variables = self.functions.variables(picked)
        same = self._drivers(finding) == _channels(variables) and not any(
            present(name) != name for name in variables
        )
        shape = _shape(axis, variables, fall, p, bands(problem, self.functions, rest, picked))
        finding = doubted(
            finding,
            f"an effect of {', '.join(variables)} on {axis} of another shape predicts left-out"
            f" flights better by {fall:.0%} of what is left (p = {p:.1g})",
            shape=shape,
        )
        if same and share >= _NEARLY and fall < _MOST:
            middle = 0.5 * (finding.ci95[0] + finding.ci95[1])
            half = float(np.hypot(0.5 * (finding.ci95[1] - finding.ci95[0]), ndtri(0.975) * misfit))
            if abs(middle) > half:
                return replace(finding, ci95=(middle - half, middle + half))
        return replace(finding, verdict="suspected")

    def _drivers(self, finding: Finding) -> frozenset[str]:
        """Channels that a term depends on."""
        return _channels(self.known[finding.hypothesis].drivers)

    def observed(self, finding: Finding) -> bool:
        """Return whether functions may depend on all that a term depends on: not on the state of a
        stall, which no variable shows."""
        return self._drivers(finding) <= _channels(self.flights[0].variables)

    def _named(self, axis: str) -> list[str]:
        """Return the terms on the axis: everything found but constants and sensors."""
        return [
            id
            for id in self.terms
            if axis in self.known[id].axes
            and self.known[id].effect != OFFSET
            and self.known[id].kind == "aerodynamic"
            and all(id in flight.evidence.columns for flight in self.flights)
        ]

    def _freed_gain(self, axis: str, sensor: str) -> Array:
        """Gain (g,) of a sensor's common value on one axis, each flight under that of the others,
        given the named terms and over what they gain with the sensor under its prior."""
        named = self._named(axis)
        with_prior = self._made(axis, named, "")
        freed = self._made(axis, [*named, sensor], sensor)
        return np.asarray(
            freed.left_out(freed.flights, range(freed.terms))
            - with_prior.left_out(with_prior.flights, range(with_prior.terms))
        )

    def _problem(self, axis: str) -> FunctionProblem:
        """Named terms and functions on one axis."""
        if axis not in self.cached:
            self.cached[axis] = self._made(axis, self._named(axis), "", True)
        return self.cached[axis]

    def _made(
        self, axis: str, named: Sequence[str], freed: str, with_functions: bool = False
    ) -> FunctionProblem:
        """The problem of an axis; all sensors but the `freed` one are eliminated under their
        priors."""
        priors = {
            h.id: (h.prior_sigma or np.inf) ** -2.0
            for h in self.known.values()
            if h.kind == "sensor" and h.id != freed
        }
        made = [
            each.eliminated(named, priors, with_functions)
            for each in self._products(axis, with_functions)
        ]
        return FunctionProblem.of(
            np.stack([part for part, _ in made]),
            np.sum([alone for _, alone in made], axis=0),
            self.functions,
            len(named),
            self.settings.inflation_limit,
            with_functions,
        )

    def _products(self, axis: str, with_functions: bool) -> Sequence[AxisProducts]:
        """Products of everything that acts on an axis, by flight: every problem of the axis is made
        of them."""
        for functions in (True, with_functions):
            if (axis, functions) in self.products:
                return self.products[axis, functions]
        named = self._named(axis)
        sensors = [h.id for h in self.known.values() if h.kind == "sensor"]
        self.products[axis, with_functions] = made = [
            AxisProducts.of(
                flight.evidence,
                axis,
                [*named, *sensors],
                columns if with_functions else columns[:, :0],
                self.settings,
            )
            for flight, columns in zip(self.flights, self.functions.columns, strict=True)
        ]
        return made


def _shape(
    axis: str, variables: Sequence[str], fall: float, p: float, bands: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """The `shape` of a finding: docs/reference/contract.md."""
    return {
        "kind": "other",
        "axis": axis,
        "variables": list(variables),
        "fall": fall,
        "p": p,
        "bands": list(bands),
    }


def _channels(names: Iterable[str]) -> frozenset[str]:
    """Channels that variables are made of; Mach number, airspeed and dynamic pressure are one in a
    flight."""
    plain = {present(name) for name in names}
    plain = {HAT_RATES[name][0] if name in HAT_RATES else name for name in plain}
    if plain & {"mach", "qbar", "V"}:
        plain |= {"mach", "qbar", "V"}
    return frozenset(plain | ({"mach", "qbar", "V"} if "thrust" in plain else set()))
