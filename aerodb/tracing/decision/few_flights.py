"""Trace too few flights: their manoeuvres are the units, beside the whole linear set.

A search that accepts one term after the other needs many units: on a short record, what the model
still lacks acts as noise on what is tested. Where manoeuvres are the units, the linear set of all
axes is in the model from the start (docs/method/tracing.md, section 16), and a candidate is judged
by the noise that remains when it is in the model as well. Findings are suspected at most. The joint
fit itself is in `aerodb.tracing.decision.joint_model`.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.effects import Hypothesis
from aerodb.support import HALF, standard_errors
from aerodb.tracing.decision.explanation_sets import explain, finding_of
from aerodb.tracing.decision.findings import Finding, with_unit
from aerodb.tracing.decision.joint_model import JointModel, joint_bands, joint_fit, under
from aerodb.tracing.decision.selection import (
    FEWEST_SUSPECTED,
    TWIN,
    Decision,
    cross_validated,
    is_no_term,
)
from aerodb.tracing.estimates import OFFSET, FlightEstimates, Tested, campaign
from aerodb.tracing.evidence import Evidence, SamplingUnit, halves
from aerodb.tracing.settings import TracingSettings

#: The linear set: what every axis is given before anything else is looked for.
LINEAR: Final = (
    *(
        "alpha_slope",
        "beta_slope",
        "pitch_rate_force",
        "pitch_damping",
        "roll_damping",
        "yaw_damping",
        "cross_rate",
    ),
    "control_effectiveness",
)
#: Effects that are claimed only of many flights: a manoeuvre seldom deflects to both sides alike,
#: and seldom pitches both slowly and quickly.
_MANY: Final = frozenset({"control_one_sided", "lift_lag"})
#: Part of a manoeuvre that its window must hold.
_SHARE = HALF
#: Distance between two windows, in correlation times.
_APART = 5.0
#: Candidates per step that are fitted, each judged by the noise that remains with it.
_TRIED = 8
#: Standard errors from zero at which the other units support the only unit in a test: the level of
#: tests, one-sided.
_ONE_SIDED = standard_errors(2.0 * TracingSettings.level)


def windows(
    spans: Sequence[tuple[float, float]], duration: float, correlation_time: float
) -> tuple[tuple[float, float], ...]:
    """Cut a flight of `duration` [s] into windows around its manoeuvres.

    spans : start and end [s] of each manoeuvre. Each window begins with its manoeuvre (the first
    with the record), holds the response to it, and ends five correlation times of the residual
    before the next begins; a manoeuvre that would lose more than half of itself in this way goes
    together with the next one.

    >>> windows([(2.0, 6.0), (8.0, 10.0)], 20.0, 0.2)
    ((0.0, 7.0), (8.0, 20.0))
    >>> windows([(2.0, 6.0), (8.0, 10.0)], 20.0, 1.0)
    ((0.0, 20.0),)
    """
    cut: list[tuple[float, float]] = []
    begin = 0.0
    ordered = sorted(spans)
    for (start, end), (following, _) in pairwise(ordered):
        stop = following - _APART * correlation_time
        if stop >= start + _SHARE * (end - start):
            cut.append((begin, stop))
            begin = following
    return (*cut, (begin, duration))


@dataclass(frozen=True)
class FewFlightFindings:
    """Findings of manoeuvres.

    joint : the final model. findings : `suspected` or `ambiguous_sensor`, in the order of their p.
    correlation_time : flight -> axis -> s, of the remaining residual.
    """

    joint: JointModel
    findings: tuple[Finding, ...]
    correlation_time: Mapping[str, Mapping[str, float]]


def few_flight_findings(
    evidence: Sequence[Evidence],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
    known: Collection[str] = (),
) -> FewFlightFindings:
    """Fit the linear set, add the terms that gain most, and return those that hold given all
    others.

    evidence : of the units; settings : the frozen ones; known : ids that whole flights have found:
    they are in the model where they fit, and are no findings here. A term is found when it is
    significant in its family, and when the value from the other units lowers the error of each unit
    that takes part in its test. A term of the linear set may rest on one unit, the only one made
    for it, when the other units bear it out, or when its own halves do and the other units do not
    contradict.
    """
    bands, settings = joint_bands(evidence, hypotheses, settings)
    shown = {
        index
        for band in bands
        for records in band.records.values()
        for index in np.flatnonzero(records[0].any(axis=0)) - 1
    }
    able = [i for i, h in enumerate(hypotheses) if _claimable(h) and i in shown]
    linear = tuple(i for i in able if hypotheses[i].effect in LINEAR)
    joint = joint_fit(bands, linear, hypotheses, settings)
    while len(joint.terms) - len(linear) < settings.most_terms:
        best: tuple[float, JointModel] | None = None
        for index in _promising(joint, able):
            tried = joint_fit(bands, (*joint.terms, index), hypotheses, settings)
            test = _tested(tried)
            gains_most = best is None or test.gain[index] > best[0]
            if (
                gains_most
                and _holds(tried, test, index, evidence)
                and not is_no_term(tried.tests, test, index, joint.terms)
            ):
                best = float(test.gain[index]), tried
        if best is None:
            break
        joint = best[1]
    test = _tested(joint)
    indices = [
        i for i in joint.terms if hypotheses[i].id not in known and _holds(joint, test, i, evidence)
    ]
    indices.sort(key=lambda i: float(test.adjusted[i]))
    sensors = believable_sensors(joint, indices)
    findings = tuple(_finding(joint, test, index, sensors[index]) for index in indices)
    return FewFlightFindings(joint, findings, _correlation_times(joint))


def _correlation_times(joint: JointModel) -> dict[str, dict[str, float]]:
    """Flight -> axis -> correlation time [s]: mean over the flight's units, weighted by their
    samples.
    """
    sums: dict[str, dict[str, tuple[float, float]]] = {}
    for equations in joint.normal_equations:
        of_flight = sums.setdefault(SamplingUnit.parse(equations.flight).flight, {})
        for axis, time, samples in zip(
            equations.axes, equations.correlation, equations.samples, strict=True
        ):
            total, weight = of_flight.get(axis, (0.0, 0.0))
            of_flight[axis] = (total + float(time) * float(samples), weight + float(samples))
    return {
        flight: {axis: total / weight for axis, (total, weight) in of_axes.items()}
        for flight, of_axes in sums.items()
    }


def _promising(joint: JointModel, able: Sequence[int]) -> list[int]:
    """The candidates that gain most by the noise of the present model.

    Each is then judged by the noise that remains with it.
    """
    test = _tested(joint)
    apart = [i for i in able if i not in joint.terms and test.count[i] >= FEWEST_SUSPECTED]
    return sorted(apart, key=lambda i: -float(test.gain[i]))[:_TRIED]


def _claimable(hypothesis: Hypothesis) -> bool:
    return hypothesis.kind == "aerodynamic" and hypothesis.effect not in {OFFSET, *_MANY}


def _tested(joint: JointModel) -> Tested:
    """The test of the final model.

    Manoeuvres find effects, no sensors and no offsets: only these are tested together, the linear
    set with one half of the level, so that it does not lose power with every template that joins
    the library.
    """
    test = joint.tests.tested(joint.terms, (), 1)
    hypotheses = joint.tests.campaign.hypotheses
    linear = tuple(i for i, h in enumerate(hypotheses) if _claimable(h) and h.effect in LINEAR)
    others = tuple(i for i, h in enumerate(hypotheses) if _claimable(h) and h.effect not in LINEAR)
    return replace(test, families=(linear, others))


def _holds(joint: JointModel, test: Tested, index: int, evidence: Sequence[Evidence]) -> bool:
    estimates = joint.tests.flight_estimates(joint.terms, ())
    if not test.adjusted[index] < joint.tests.settings.level:
        return False
    if test.count[index] != 1:
        return cross_validated(estimates, test, index)
    silent = _silent(estimates, test, index)
    if _agree(float(test.mean[index]), *silent):
        return True
    return not _contradicted(estimates, test, index, silent) and _halves_agree(
        joint, test, index, evidence
    )


def _silent(estimates: FlightEstimates, test: Tested, index: int) -> tuple[float, float]:
    """Sums of ``A_hy`` and of ``A_hh`` over the units that take no part in the test."""
    silent = ~test.included[:, index] & (estimates.information[:, index] > 0.0)
    information = estimates.information[silent, index]
    return float(information @ estimates.estimate[silent, index]), float(information.sum())


def _agree(value: float, right: float, total: float) -> bool:
    """Return whether a part with these sums supports the `value` of another part.

    It rejects on its own that there is nothing (one-sided, 5 %), and its error is lower with the
    `value` than with none.
    """
    return bool(
        np.sign(value) * right > _ONE_SIDED * np.sqrt(total)
        and 2.0 * value * right > value**2 * total
    )


def _contradicted(
    estimates: FlightEstimates, test: Tested, index: int, silent: tuple[float, float]
) -> bool:
    """Return whether the other units reject that the effect is as large as the one unit says
    (one-sided, 5 %).
    """
    right, total = silent
    if total <= 0.0:
        return False
    value, own = (
        float(test.mean[index]),
        float(estimates.information[test.included[:, index], index].sum()),
    )
    return bool(
        np.sign(value) * (value - right / total) > _ONE_SIDED * np.sqrt(1.0 / total + 1.0 / own)
    )


def _halves_agree(
    joint: JointModel, test: Tested, index: int, evidence: Sequence[Evidence]
) -> bool:
    """Return whether the halves of the one unit support each other, as other units would.

    Blocks of one record: Ibragimov & Mueller, JBES 28(4), 2010.
    """
    equations = joint.normal_equations[int(np.flatnonzero(test.included[:, index])[0])]
    hypothesis = joint.tests.campaign.hypotheses[index]
    noise = dict(zip(equations.axes, equations.spread.tolist(), strict=True))
    times = [
        float(time)
        for axis, time in zip(equations.axes, equations.correlation, strict=True)
        if axis in hypothesis.axes
    ]
    unit = next(each for each in evidence if each.flight == equations.flight)
    cut = halves(unit, hypothesis.id, noise, max(times, default=0.0))
    if not cut:
        return False
    parts = under(joint, cut)
    estimates = parts.flight_estimates(joint.terms, ())
    if len(parts.flights) != 2 or not np.all(estimates.information[:, index] > 0.0):
        return False
    value, information = estimates.estimate[:, index], estimates.information[:, index]
    return all(
        _agree(
            float(value[1 - half]), float(information[half] * value[half]), float(information[half])
        )
        for half in (0, 1)
    )


def accompanying_linear_terms(
    joint: JointModel, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Return the linear terms of the model that are written on the axes of `findings` and are no
    findings themselves.

    The value of a finding holds only with them. They are suspected like the findings; a term
    without any unit in its test stays out.
    """
    hypotheses = joint.tests.campaign.hypotheses
    named = {finding.hypothesis for finding in findings}
    axes = {axis for each in hypotheses if each.id in named for axis in each.written_on}
    test = _tested(joint)
    chosen = [
        i
        for i in joint.terms
        if hypotheses[i].id not in named and axes & set(hypotheses[i].written_on) and test.count[i]
    ]
    return tuple(_finding(joint, test, index, ()) for index in chosen)


def _finding(joint: JointModel, test: Tested, index: int, behind: Sequence[int]) -> Finding:
    tests, decision = joint.tests, Decision((), joint.terms, ())
    hypotheses, hypothesis = tests.campaign.hypotheses, tests.campaign.hypotheses[index]
    explanation = explain(tests, decision, index)
    rivals = tuple(i for i in explanation.rivals if set(hypotheses[i].axes) & set(hypothesis.axes))
    value, half = joint.value(index), 0.5 * float(np.ptp(test.interval(index)))
    on = np.flatnonzero(test.included[:, index])
    rival_names, sensor_names = ([hypotheses[i].id for i in part] for part in (rivals, behind))
    return finding_of(
        tests,
        decision,
        test,
        replace(explanation, rivals=rivals, sensors=tuple(behind)),
        verdict="ambiguous_sensor" if behind else "suspected",
        value=value,
        ci95=(value - half, value + half),
        size=(
            f"{hypothesis.parameter} = {with_unit(value, hypothesis.unit)} (95 %:"
            f" {value - half:.3g} to {value + half:.3g}) beside all linear terms"
        ),
        reasons=(
            *_reasons(len(on), rival_names, sensor_names),
            *_twins(joint, index, explanation.rivals, on),
        ),
    )


def _reasons(flights: int, rivals: Sequence[str], sensors: Sequence[str]) -> Iterator[str]:
    units = (
        f"{flights} manoeuvres or flights show it"
        if flights > 1
        else "only the one manoeuvre that was made for it shows it"
    )
    yield f"{units}, too few for an error rate"
    if rivals:
        yield f"these manoeuvres cannot tell it from {', '.join(rivals)}"
    yield (
        f"an error of believable size would explain it: {', '.join(sensors)}"
        if sensors
        else "no sensor error of believable size explains it"
    )


def _twins(
    joint: JointModel, index: int, rivals: Sequence[int], units: Sequence[int] | NDArray[np.intp]
) -> Iterator[str]:
    """Yield which rivals are the same column up to a factor, and in which units.

    No flight of this kind can tell them apart.
    """
    matrix, names = joint.tests.campaign.products.matrix, joint.tests.campaign.hypotheses
    for rival in rivals:
        alike = [
            g
            for g in units
            if matrix[g, index, rival] ** 2
            > TWIN**2 * matrix[g, index, index] * matrix[g, rival, rival]
        ]
        if alike:
            where = ", ".join(
                SamplingUnit.parse(joint.tests.campaign.flights[g]).short for g in alike
            )
            yield f"{names[rival].id} is its exact twin in {where}"


def believable_sensors(joint: JointModel, indices: Sequence[int]) -> dict[int, tuple[int, ...]]:
    """Return, for each finding, the sensors and vehicle data whose believable error would explain
    it.

    On one manoeuvre all sensors are nearly collinear: freed, without bounds, they explain anything
    (docs/method/tracing.md, section 16). So each in turn is known no better than its believable
    range, the range's limit being kappa of its sigmas; the finding must keep its sign and p < level
    given it, the other sensors having their priors.
    """
    tests = joint.tests
    hypotheses, settings = tests.campaign.hypotheses, tests.settings
    before = _tested(joint)
    explaining: dict[int, list[int]] = {index: [] for index in indices}
    for sensor in tests.campaign.sensors:
        limit = max(abs(edge) for edge in hypotheses[sensor].plausible)
        loose = list(hypotheses)
        loose[sensor] = replace(
            hypotheses[sensor],
            prior_sigma=max(limit / settings.kappa, hypotheses[sensor].prior_sigma or 0.0),
        )
        test = replace(
            tests, campaign=campaign(joint.normal_equations, loose, extrapolated=False)
        ).tested(joint.terms, (), 1)
        for index, sensors in explaining.items():
            if not (
                test.p[index] < settings.level
                and np.sign(test.mean[index]) == np.sign(before.mean[index])
            ):
                sensors.append(sensor)
    return {index: tuple(sensors) for index, sensors in explaining.items()}
