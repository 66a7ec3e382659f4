"""The increment model of an axis: its linear terms and surfaces, estimated together.

Forward selection adds one term after the other. Where many effects act at once, what the model
still lacks stands in for others, and a term that is right in sign and name has the wrong size. Here
the whole set of 003, eq. 7 is in the model from the start (zero term, slopes with their breaks,
rates, surfaces), and what these flights do not need leaves, the weakest first.
docs/method/tracing.md, section 27.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.tracing.decision.few_flights import LINEAR
from aerodb.tracing.decision.findings import Finding, Traced
from aerodb.tracing.decision.selection import CrossFlightTests, Decision
from aerodb.tracing.decision.verdicts import judged
from aerodb.tracing.estimates import campaign, holm
from aerodb.tracing.evidence import FlightNormalEquations
from aerodb.tracing.settings import TracingSettings

#: Effects of an increment model, besides the constant of its axis.
_MODEL: Final = frozenset({*LINEAR, "alpha_slope_break", "body_flap", "speed_brake", "flap"})
#: p from which a term leaves. One whose estimate is smaller than its standard error predicts other
#: flights worse than none at all would. Theil's adjusted R2 says the same (Toro-Vizcarrondo &
#: Wallace, JASA 63, 1968).
_LEAVES: Final = 0.32


def cross_flight_tests(
    normal_equations: Sequence[FlightNormalEquations],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
) -> CrossFlightTests:
    """Return the tests of all hypotheses over all flights, given any model. Raises InputError where
    columns were made with another library, or a flight occurs twice; docs/method/tracing.md,
    section 8."""
    return CrossFlightTests(
        campaign(normal_equations, hypotheses), tuple(range(len(normal_equations))), settings
    )


def increment_models(
    tests: CrossFlightTests,
    axes: Collection[str],
    beside: Sequence[int] = (),
    barred: Collection[int] = (),
    freed: Sequence[int] = (),
) -> tuple[int, ...]:
    """Return the terms (indices) of the increment models of some axes, estimated together.

    axes : axes on which the terms are written, body or wind. beside : terms of other axes that are
    in the model as well, and stay. barred : terms that may not enter. A term stays where its size
    over flights, less what state noise would leave, exceeds its standard error. Sensors are in the
    model with their priors, but do not decide: what predicts other flights of the same installation
    need not be known apart. freed : sensors without prior, which do decide: what they explain
    leaves. See docs/method/tracing.md, section 27.
    """
    hypotheses = tests.campaign.hypotheses
    kept = [
        index
        for index, each in enumerate(hypotheses)
        if each.kind == "aerodynamic"
        and each.effect in _MODEL
        and index not in barred
        and index not in beside
        and set(each.written_on) <= set(axes)
    ]
    while kept:
        test = tests.tested((*beside, *kept), freed, fewest=1)
        p = test.unmasked[kept]
        if p.max() >= _LEAVES:
            kept.pop(int(p.argmax()))
            continue
        by_noise = test.p_by_noise(kept)
        if by_noise.max() < _LEAVES:
            break
        kept.pop(int(by_noise.argmax()))
    test = tests.tested((*beside, *kept), freed, fewest=1)
    constants = [
        index
        for index in tests.campaign.offsets
        if set(hypotheses[index].written_on) <= {body for i in kept for body in hypotheses[i].axes}
        and index not in barred
        and test.unmasked[index] < _LEAVES
    ]
    return (*kept, *constants)


def outdoing_sensors(tests: CrossFlightTests) -> tuple[int, ...]:
    """Return the sensors (indices) that explain more than any single effect does, and more than
    chance would (Holm over the library), before anything is found.

    Errors of other sensors may hide them from the test of docs/method/tracing.md, section 8: a mass
    from that of dynamic pressure and all inertias together.
    """
    test, sensors = tests.tested((), ()), set(tests.campaign.sensors)
    effects = [i for i in range(len(test.gain)) if i not in sensors and test.testable[i]]
    most = max((float(test.gain[i]) for i in effects), default=0.0)
    p = holm(test.unmasked, len(test.unmasked))
    return tuple(i for i in sorted(sensors) if p[i] < tests.settings.level and test.gain[i] > most)


def imitated_sensors(
    tests: CrossFlightTests,
    axes: Collection[str],
    sensors: Sequence[int],
    beside: Sequence[int] = (),
    barred: Collection[int] = (),
) -> bool:
    """Return whether increment models would imitate one of the sensors (indices) found to be wrong.

    Where many effects act at once, one that is not found yet can look like a sensor. In a first
    elimination the sensors are free, and terms that imitate them leave: sensors that are not
    significant given what is left are not wrong. With the others free, a significant term of the
    models leaves where it imitates one. See docs/method/tracing.md, section 27.
    """
    model = (*beside, *increment_models(tests, axes, beside, barred, sensors))
    others = {each: [one for one in sensors if one != each] for each in sensors}
    wrong = [
        each
        for each, rest in others.items()
        if tests.tested(model, rest, fewest=1).p_at([each])[0] < tests.settings.level
    ]
    if not wrong:
        return False
    model = increment_models(tests, axes, beside, barred)
    gone = set(model) - set(increment_models(tests, axes, beside, barred, wrong))
    p = tests.tested((*beside, *model), (), fewest=1).unmasked[sorted(gone)]
    return bool(np.any(p < tests.settings.level))


def supported_axes(
    tests: CrossFlightTests, terms: Sequence[int], beside: Sequence[int]
) -> set[str]:
    """Return the axes on which some term of the models is significant given the errors that sensors
    may have, after Bonferroni over all terms. Test: docs/method/tracing.md, section 8."""
    claims = [index for index in terms if index not in tests.campaign.offsets]
    test = tests.tested((*beside, *terms), (), fewest=1)
    p = test.p_at(claims) * len(claims)
    return {
        axis
        for index, each in zip(claims, p, strict=True)
        if each < tests.settings.level
        for axis in tests.campaign.hypotheses[index].written_on
    }


def trace_increment_models(
    tests: CrossFlightTests,
    normal_equations: Sequence[FlightNormalEquations],
    terms: Sequence[int],
    beside: Sequence[int],
    barred: Collection[int],
) -> Traced:
    """Return the findings of the terms of increment models, each judged given the others.

    normal_equations : those of `tests`; the rest as in `increment_models`, which is repeated
    without some of the flights to see which terms return. Values and intervals (2,) are in the unit
    of each term; see docs/method/tracing.md, section 27.
    """
    axes = {axis for index in terms for axis in tests.campaign.hypotheses[index].written_on}

    def decide(given: CrossFlightTests) -> Decision:
        model = terms if given is tests else increment_models(given, axes, beside, barred)
        enough = len(given.flights) >= given.settings.fewest
        every = (*beside, *model)
        return Decision(every, (), ()) if enough else Decision((), every, ())

    traced = judged(tests, decide, normal_equations)
    hypotheses, level = tests.campaign.hypotheses, tests.settings.level
    p = tests.tested((*beside, *terms), (), fewest=1).p_at(terms)
    alone = {hypotheses[index].id: each < level for index, each in zip(terms, p, strict=True)}
    findings = [
        _as_member(each, alone[each.hypothesis])
        for each in traced.findings
        if each.hypothesis in alone
    ]
    return replace(traced, findings=tuple(findings))


def significant_beside(tests: CrossFlightTests, terms: Sequence[int]) -> frozenset[str]:
    """Return the ids of hypotheses significant over the whole library given the terms (Holm;
    docs/method/tracing.md, section 8); terms : indices."""
    significant = tests.tested(terms, ()).significant
    return frozenset(
        h.id for h, is_it in zip(tests.campaign.hypotheses, significant, strict=True) if is_it
    )


def _as_member(finding: Finding, alone: bool) -> Finding:
    """The finding of a term of an increment model, with the reason why nothing is claimed of it by
    itself.

    alone : whether it differs from what the errors of all sensors together may leave. Where it does
    not, no single one of them is a better explanation.
    """
    if alone and finding.verdict != "suspected":
        return finding
    together = "estimated together with the terms of its axis"
    if alone:
        return replace(
            finding, reasons=(f"{together}, and not significant over all effects tested",)
        )
    return replace(
        finding,
        verdict="suspected",
        explanation_set=tuple(id for id in finding.explanation_set if "@all" not in id),
        reasons=(together, "errors of sensors that are believable together may leave as much"),
    )
