"""Increment models of whole axes, where many effects act at once.

Effects that are found one after the other leave an axis far above its noise where many act
together. Then the axis' increment model (003, eq. 7) competes with them: zero term, slopes with
their breaks, rates and surfaces, estimated together as declared increments are. It replaces them
where it predicts flights that were left out much better. docs/method/tracing.md, section 27.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import Hypothesis
from aerodb.flight import Flight
from aerodb.increments import (
    DeclaredIncrement,
    ModelFile,
    Update,
    derivative_changes,
    estimate_increments,
    keep_slope_signs,
)
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.moving_air import evidently_moving
from aerodb.loop.sensor_share import beside_sensors, compared_with
from aerodb.loop.shapes import imitated_shapes
from aerodb.support import HALF
from aerodb.tables import AeroDatabase, Increment
from aerodb.tracing import (
    ADDED,
    Finding,
    Traced,
    TracingSettings,
    cross_flight_tests,
    imitated_sensors,
    increment_models,
    outdoing_sensors,
    significant_beside,
    supported_axes,
    trace_increment_models,
)

#: Part of the mean square error with the singles that the increment model must leave at most. It
#: counts on flights that did not estimate it, as it is and about each flight's mean. Half, so that
#: it is no matter of a few per cent of scale, which the errors of sensors leave too.
_MATERIAL: Final = HALF
#: Terms, the constant apart, from which effects are many: a single one is found by itself, or not.
_MANY: Final = 2


@dataclass(frozen=True)
class AxisModel:
    """The increment model of one axis.

    axis : on which it is written, body or wind. terms : ids. singles, left_out : rms error with the
    effects found one by one, and of the model on flights left out; 0 where it was not judged.
    """

    axis: str
    terms: tuple[str, ...]
    singles: float = 0.0
    left_out: float = 0.0

    @property
    def remark(self) -> str:
        """Sentence for the report with both rms errors, dimensionless scalars
        (docs/method/tracing.md, section 27)."""
        return (
            f"{self.axis}: many effects act at once, and were added together. On flights left out"
            f" this leaves an error of {self.left_out:.2g}; one by one they leave"
            f" {self.singles:.2g}. Their sum is known better than each of them."
        )


@dataclass(frozen=True)
class AxisModels:
    """Increment models of some axes: the candidate with them, the tracing given them with their
    terms as findings, and the ids of what is significant given them."""

    candidate: AeroDatabase
    traced: Traced
    models: tuple[AxisModel, ...]
    standing: frozenset[str]

    def apart(self, library: Library) -> frozenset[str]:
        """Return the ids (`Hypothesis.id`) of sensors, and of effects that are written on none of
        these axes."""
        axes = {model.axis for model in self.models}
        return frozenset(
            each.id
            for each in library.hypotheses
            if each.kind == "sensor" or not axes & set(each.written_on)
        )


def axis_models(
    source: FlightSource,
    flights: Sequence[str],
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    library: Library,
    added: Sequence[Finding],
    without_gain: Collection[str] = (),
    late: Collection[str] = (),
    given: Collection[str] | None = None,
    sensors: Mapping[str, float] = MappingProxyType({}),
    surfaces: Sequence[str] = (),
) -> tuple[AxisModels | None, tuple[str, ...]]:
    """Return the increment models that replace the singles on their axes, None where there are
    none; and a sentence about each that predicts better but is not added, because a control or a
    damping becomes its opposite.

    candidate : `baseline` with the singles, `added`. without_gain : ids that lowered no error of
    other flights: on their axes others would stand in for them, and nothing is proposed. late : ids
    that may not enter, as these flights may have suggested them. given : ids of the terms, as more
    flights have decided; None: decided here, where the values that the other flights give must
    predict each flight. sensors : sensors found to be wrong (id -> error, SI): where terms would
    imitate one that is wrong given the models as well, it is to be mended first, and nothing is
    proposed; what they explain is no error that a model lowers.
    surfaces : ids of findings that a surface follows its log badly, whatever explains them as well:
    an axis most of whose model one of them explains stays as it is; so does one most of whose model
    a sensor explains that outdoes every single effect.
    """
    hypotheses, settings = library.hypotheses, library.settings
    number = {each.id: index for index, each in enumerate(hypotheses)}
    if given is not None:
        axes = _axes(hypotheses[number[id]] for id in given)
    else:
        axes = (
            _far(source, flights, candidate, library)
            if len(flights) >= TracingSettings.fewest
            else set()
        )
        axes -= _axes(hypotheses[number[id]] for id in without_gain)
    if not axes:
        return None, ()
    normal_equations = source.normal_equations(flights, baseline, library)
    tests = cross_flight_tests(normal_equations, hypotheses, settings)
    out = [number[id] for id in late]
    beside = [
        number[each.hypothesis]
        for each in added
        if each.hypothesis in number
        and each.effect != "zero_offset"
        and not axes & set(hypotheses[number[each.hypothesis]].written_on)
    ]
    if given is not None:
        terms = tuple(number[id] for id in given)
    else:
        wrong = [number[id] for id in sensors if id in number]
        if wrong and imitated_sensors(tests, axes, wrong, beside, out):
            return None, ()
        terms = increment_models(tests, axes, beside, out)
        axes &= supported_axes(tests, terms, beside)
    estimator = _Estimator(source, baseline, tuple(flights), library, sensors)
    errors = dict.fromkeys(sorted(axes), (0.0, 0.0))
    remarks: tuple[str, ...] = ()
    if given is None:
        models = {
            axis: members
            for axis, members in _on(axes, terms, hypotheses).items()
            if sum(each.effect != "zero_offset" for each in members) >= _MANY
        }
        errors = _proved(estimator, candidate, models)
        if not errors or evidently_moving(source, flights, baseline, library):
            return None, ()
        proved = {axis: models[axis] for axis in errors}
        outdo = [*dict.fromkeys([*surfaces, *(hypotheses[i].id for i in outdoing_sensors(tests))])]
        beaten = imitated_shapes(source, flights, baseline, library, proved, outdo)
        remarks = tuple(_imitates(axis, *errors[axis], beaten[axis]) for axis in beaten)
        errors = {axis: error for axis, error in errors.items() if axis not in beaten}
    while errors:
        terms = tuple(i for i in terms if set(hypotheses[i].written_on) <= errors.keys())
        traced = trace_increment_models(tests, normal_equations, terms, beside, out)
        standing = significant_beside(tests, [*beside, *terms])
        on = _on(errors, terms, hypotheses)
        made = _entered(estimator, candidate, library, traced, on, errors, standing)
        opposite = {} if given is not None else _opposite(estimator, made)
        if not opposite:
            return made, remarks
        remarks += tuple(_not_added(axis, why, *errors[axis]) for axis, why in opposite.items())
        errors = {axis: error for axis, error in errors.items() if axis not in opposite}
    return None, remarks


@dataclass(frozen=True)
class _Estimator:
    """Estimates increment models from the comparisons of flights with a database, without what
    sensors that were found to be wrong (id -> error, SI) leave."""

    source: FlightSource
    baseline: AeroDatabase
    flights: tuple[str, ...]
    library: Library
    sensors: Mapping[str, float]

    @cached_property
    def compared(self) -> Mapping[str, tuple[Flight, Comparison]]:
        """Flights (by id) with their comparisons with the baseline."""
        compared = compared_with(self.beside, self.flights, self.baseline)
        return {id: (self.source.flight(id), compared[id]) for id in self.flights}

    @cached_property
    def beside(self) -> FlightSource:
        """The flights without what the sensors leave."""
        given = (self.flights, self.baseline, self.library, self.sensors)
        return beside_sensors(self.source, *given)

    def update(self, models: Mapping[str, Sequence[Hypothesis]], flights: Sequence[str]) -> Update:
        """Return the database with the models (axis -> terms), estimated from some of the flights.

        Each flight has a constant of its own on each axis; the zero term is their mean.
        """
        declared = ModelFile(
            increment=tuple(
                DeclaredIncrement(
                    axis=axis,
                    terms=tuple(str(_regressor(term, axis)) for term in terms),
                    own_constants=any(term.effect == "zero_offset" for term in terms),
                )
                for axis, terms in models.items()
            )
        )
        needs = {need for terms in models.values() for term in terms for need in term.needs}
        able = [
            self.compared[id] for id in flights if needs <= self.compared[id][0].channels.keys()
        ]
        return estimate_increments(
            [flight for flight, _ in able],
            [comparison for _, comparison in able],
            declared,
            self.baseline,
        )


def _entered(
    estimator: _Estimator,
    candidate: AeroDatabase,
    library: Library,
    traced: Traced,
    models: Mapping[str, Sequence[Hypothesis]],
    errors: Mapping[str, tuple[float, float]],
    standing: frozenset[str],
) -> AxisModels:
    """The models (axis -> terms) in place of the singles on their axes, with values from all
    flights.

    traced : with the terms as findings. errors : axis -> with the singles, and of the model on
    flights left out.
    """
    baseline = estimator.baseline
    update = estimator.update(models, estimator.flights)
    findings, increments = _with_values(traced.findings, update, library.hypotheses)
    members = {finding.hypothesis for finding in findings}
    singles = candidate.increments[len(baseline.increments) :]
    others = (each for each in singles if each.axis not in errors)
    database = replace(candidate, increments=(*baseline.increments, *others, *increments))
    return AxisModels(
        keep_slope_signs(Update(database, (), estimator.flights), baseline).candidate,
        replace(traced, findings=findings),
        tuple(
            AxisModel(axis, tuple(each.id for each in on if each.id in members), *errors[axis])
            for axis, on in models.items()
        ),
        standing,
    )


def _opposite(estimator: _Estimator, made: AxisModels) -> dict[str, str]:
    """Axis -> why its model cannot be right: a control or a damping on it becomes its opposite, and
    tracing does not confirm the term.

    What sensors leave open is added because a sum is known better than its terms. A wind tunnel's
    signs are known better still: a log or vehicle data that are wrong explain the opposite one.
    Forces along the wind axes are not judged here: they have no damping.
    """
    flights = [flight for flight, _ in estimator.compared.values()]
    confirmed = {each.parameter for each in made.traced.findings if each.verdict in ADDED}
    axes = {model.axis for model in made.models}
    return {
        change.axis: change.reversal
        for change in reversed(derivative_changes(flights, estimator.baseline, made.candidate))
        if change.axis in axes and change.reversal and change.name not in confirmed
    }


def _not_added(axis: str, why: str, singles: float, left_out: float) -> str:
    """The sentence about a model that cannot be right."""
    return (
        f"{axis}: not corrected as a whole. On flights left out its increment model leaves"
        f" {left_out:.2g}, the effects found one by one {singles:.2g}, but with it {why}. These"
        " flights do not confirm that: a sensor or the vehicle's data may be wrong instead. Check"
        " the signs of the log's channels, and mass, inertia and surfaces of the vehicle file."
    )


def _imitates(axis: str, singles: float, left_out: float, variables: Sequence[str]) -> str:
    """The sentence about a model that imitates another shape."""
    return (
        f"{axis}: not corrected as a whole. An effect of {', '.join(variables)} explains most of"
        f" what its increment model does, whose terms would imitate it. On flights left out the"
        f" model leaves {left_out:.2g} of {singles:.2g}."
    )


def _regressor(term: Hypothesis, axis: str) -> object:
    return next(expression for on, expression in term.increment if on == axis)


def _axes(hypotheses: Iterable[Hypothesis]) -> set[str]:
    return {axis for each in hypotheses for axis in each.written_on}


def _on(
    axes: Iterable[str], terms: Sequence[int], hypotheses: Sequence[Hypothesis]
) -> dict[str, list[Hypothesis]]:
    """Axis -> its terms; axes without a term stay out."""
    on = {
        axis: [hypotheses[i] for i in terms if axis in hypotheses[i].written_on]
        for axis in sorted(axes)
    }
    return {axis: members for axis, members in on.items() if members}


def _far(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> set[str]:
    """The axes whose error is far enough above the noise of the sensors for a model to lower it
    materially."""
    compared = compared_with(source, flights, candidate).values()

    def is_far(axis: str) -> bool:
        if not all(axis in each.usable and each.usable[axis].any() for each in compared):
            return False
        noise = sum(np.square(each.sigma[axis][each.usable[axis]]).sum() for each in compared)
        return _MATERIAL * sum(_square(axis, each) for each in compared) > noise

    aerodynamic = (each for each in library.hypotheses if each.kind == "aerodynamic")
    return {axis for axis in _axes(aerodynamic) if is_far(axis)}


def _square(axis: str, compared: Comparison, level: bool = False) -> float:
    """Sum of squares of the error of an axis, about its mean or as it is."""
    residual = compared.residual(axis)[compared.usable[axis]]
    return float(np.square(residual if level else residual - residual.mean()).sum())


def _proved(
    estimator: _Estimator,
    candidate: AeroDatabase,
    models: Mapping[str, Sequence[Hypothesis]],
) -> dict[str, tuple[float, float]]:
    """Axis -> errors (rms) with the singles and of the model on flights left out, where the model
    is materially better than the singles, and better about the mean of every flight."""
    if not models:
        return {}
    flights = estimator.flights

    def alone(flight: str) -> Comparison:
        others = estimator.update(models, [other for other in flights if other != flight])
        return estimator.beside.comparison(flight, others.candidate)

    pairs = list(
        zip(
            compared_with(estimator.beside, flights, candidate).values(),
            map(alone, flights),
            strict=True,
        )
    )

    def better(axis: str) -> bool:
        if any(_square(axis, model) >= _square(axis, single) for single, model in pairs):
            return False
        return all(
            sum(_square(axis, model, level) for _, model in pairs)
            <= _MATERIAL * sum(_square(axis, single, level) for single, _ in pairs)
            for level in (False, True)
        )

    def rms(axis: str, side: int) -> float:
        samples = sum(int(pair[side].usable[axis].sum()) for pair in pairs)
        return float(np.sqrt(sum(_square(axis, pair[side], True) for pair in pairs) / samples))

    return {axis: (rms(axis, 0), rms(axis, 1)) for axis in models if better(axis)}


def _with_values(
    findings: Sequence[Finding],
    update: Update,
    hypotheses: Sequence[Hypothesis],
) -> tuple[tuple[Finding, ...], list[Increment]]:
    """The findings with the values of the update, and its increments with their uncertainty.

    The intervals are those of tracing, which contain what sensors may leave; the correlations
    between the terms are those of the update. A term that the update could not estimate stays out.
    """
    added = update.candidate.increments[-len(update.axes) :]
    by_id = {each.id: each for each in hypotheses}
    about = dict[str, Finding]()
    increments = []
    for increment in added:
        members, sigma = [], []
        for regressor, value in zip(increment.regressors, increment.estimates, strict=True):
            (finding,) = (
                each
                for each in findings
                if (increment.axis, regressor) in by_id[each.hypothesis].increment
            )
            half = 0.5 * (finding.ci95[1] - finding.ci95[0])
            members.append(finding)
            sigma.append(half / 1.96)
            about[finding.hypothesis] = replace(
                finding, value=float(value), ci95=(float(value) - half, float(value) + half)
            )
        deviation = np.sqrt(np.diag(increment.covariance))
        larger = np.maximum(1.0, np.array(sigma) / deviation)
        increments.append(
            replace(
                increment,
                covariance=increment.covariance * np.outer(larger, larger),
                note="increment model: "
                + ", ".join(f"{f.hypothesis} ({f.verdict.replace('_', ' ')})" for f in members),
            )
        )
    ordered = tuple(about[f.hypothesis] for f in findings if f.hypothesis in about)
    return ordered, increments
