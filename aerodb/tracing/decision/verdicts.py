"""From the normal equations of several flights to findings, verdicts and bounds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.errors import InputError
from aerodb.tracing.decision.explanation_sets import (
    Explanation,
    explain,
    finding_of,
    with_cancelling,
)
from aerodb.tracing.decision.findings import Finding, NotFound, Traced, Verdict, with_unit
from aerodb.tracing.decision.next_flight import next_flights
from aerodb.tracing.decision.selection import (
    FEWEST_SUSPECTED,
    CrossFlightTests,
    Decision,
    decide,
    half_interval,
)
from aerodb.tracing.estimates import OFFSET, Tested, campaign
from aerodb.tracing.evidence import FlightNormalEquations
from aerodb.tracing.settings import TracingSettings

#: Times the largest believable size of a term, from which it is none. Believable sizes are those of
#: usual databases; a tenfold one is another unit (57 from degrees), or noise over noise.
_ABSURD = 10.0


def trace(
    normal_equations: Sequence[FlightNormalEquations],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
    earlier: Mapping[str, float] | None = None,
) -> Traced:
    """Return which of the hypotheses explain the residuals of these flights.

    normal_equations : one per flight (or independent manoeuvre), made with these settings;
    hypotheses : the whole frozen library, whatever a flight excites: the error rate is over all of
    them. earlier : id -> value of terms that the database got in earlier rounds: what is left of
    their shape is no second effect. The method: `aerodb.tracing` and docs/method/tracing.md.

    Raises InputError without flights, without hypotheses, for a flight given twice, for normal
    equations of another library.
    """
    if not normal_equations or not hypotheses:
        raise InputError(
            "nothing to trace",
            "tracing",
            "give at least one flight's normal equations and one hypothesis",
        )
    normal_equations, notes = _once(normal_equations)
    tests = CrossFlightTests(
        campaign(normal_equations, hypotheses, earlier),
        tuple(range(len(normal_equations))),
        settings,
    )
    return judged(tests, decide, normal_equations, notes)


def judged(
    tests: CrossFlightTests,
    decide: Callable[[CrossFlightTests], Decision],
    normal_equations: Sequence[FlightNormalEquations],
    notes: Sequence[str] = (),
) -> Traced:
    """Return the findings of a decision with their rivals, and bounds for everything else.

    decide : from tests to the terms of the model; it is repeated without one fold of the flights
    after another. Values and intervals (2,) are in the unit of each hypothesis;
    docs/method/tracing.md, section 12.
    """
    decision, hypotheses, settings = decide(tests), tests.campaign.hypotheses, tests.settings
    indices = (*decision.terms, *decision.freed)
    explanations = with_cancelling(
        tests, decision, [explain(tests, decision, index) for index in indices]
    )
    repeated = _repeated(tests, decide, decision)
    findings = [_finding(tests, decision, explanation, repeated) for explanation in explanations]
    findings.sort(key=lambda finding: finding.p_adjusted)
    test = tests.tested(decision.terms, decision.freed)
    explained = {*indices, *(i for e in explanations for i in (*e.rivals, *e.sensors))}
    rest = [i for i in range(len(hypotheses)) if i not in explained]
    if len(normal_equations) < settings.fewest:
        notes = (
            *notes,
            f"{len(normal_equations)} flights: below {settings.fewest} no error rate can be"
            " promised and nothing is confirmed",
        )
    return Traced(
        flights=tests.campaign.flights,
        findings=tuple(findings),
        not_found=tuple(_not_found(hypotheses[i], test, i, settings) for i in rest),
        next_flight=next_flights(tests, decision, explanations, normal_equations),
        notes=tuple(notes),
    )


def _once(
    normal_equations: Sequence[FlightNormalEquations],
) -> tuple[list[FlightNormalEquations], list[str]]:
    """Each flight once: normal equations equal to earlier ones under another name are the same
    flight.
    """
    kept: list[FlightNormalEquations] = []
    alike: dict[str, list[FlightNormalEquations]] = {}
    notes = []
    for equations in normal_equations:
        candidates = alike.setdefault(f"{equations.matrix[-1, -1]:.6e}", [])
        twin = next(
            (
                g
                for g in candidates
                if g.hypotheses == equations.hypotheses
                and np.allclose(g.matrix, equations.matrix, rtol=1e-9)
            ),
            None,
        )
        if twin is not None and twin.flight != equations.flight:
            notes.append(
                f"{equations.flight} has the samples of {twin.flight}: it counts once, and is left"
                " out"
            )
        else:
            candidates.append(equations)
            kept.append(equations)
    return kept, notes


def _repeated(
    tests: CrossFlightTests, decide: Callable[[CrossFlightTests], Decision], decision: Decision
) -> list[tuple[tuple[int, ...], Decision]]:
    """The decision without one fold of the flights after another; of pairs, those are searched that
    all flights show."""
    count = min(tests.settings.folds, len(tests.flights))
    if count < 2:
        return []
    folds = [tuple(int(i) for i in fold) for fold in np.array_split(np.array(tests.flights), count)]
    pairs = tuple(p for p in tests.campaign.shapes if set(p) <= set(decision.accepted))
    return [(fold, decide(replace(tests.without(fold), pairs=pairs))) for fold in folds]


def _finding(
    tests: CrossFlightTests,
    decision: Decision,
    explanation: Explanation,
    repeated: list[tuple[tuple[int, ...], Decision]],
) -> Finding:
    index = explanation.index
    fewest = FEWEST_SUSPECTED if index in decision.suspected else tests.settings.fewest
    test = tests.tested(decision.terms, decision.freed, fewest)
    absurd = index not in decision.freed and _absurd(tests, test, index)
    significant = bool(test.adjusted[index] < tests.settings.level)
    verdict = verdict_of(decision, explanation, significant and not absurd)
    again = sum(index in (*d.terms, *d.freed) for _, d in repeated)
    hypothesis = tests.campaign.hypotheses[index]
    low, high = min(
        (
            test.interval(index),
            tests.remaining(decision.terms, decision.freed, fewest).interval(index),
        ),
        key=np.ptp,
    )
    return finding_of(
        tests,
        decision,
        test,
        explanation,
        verdict=verdict,
        value=float(test.mean[index]),
        ci95=(low, high),
        size=(
            f"{hypothesis.parameter} = {with_unit(float(test.mean[index]), hypothesis.unit)} (95 %:"
            f" {low:.3g} to {high:.3g}) over {np.count_nonzero(test.included[:, index])} flights"
        ),
        reasons=("its size is ten times what is believable, or more",)
        if absurd and verdict == "suspected"
        else _reasons(tests, decision, explanation, verdict),
        refound=(again, len(repeated)),
    )


def _absurd(tests: CrossFlightTests, test: Tested, index: int) -> bool:
    """Whether the whole interval of a term is far beyond what is believable: what drives it hardly
    moves, or the log has another unit."""
    most = max(map(abs, tests.campaign.hypotheses[index].plausible))
    return abs(float(test.mean[index])) - half_interval(test, index) > _ABSURD * most


def verdict_of(decision: Decision, explanation: Explanation, significant: bool) -> Verdict:
    """Return the verdict; significant : whether it is over the library, in the model of all, and of
    a size that is believable. The rules are those of docs/method/tracing.md, section 12."""
    if explanation.index in decision.freed:
        return "ambiguous_sensor" if explanation.rivals else "sensor"
    if explanation.sensors:
        return "ambiguous_sensor"
    if explanation.index in decision.suspected:
        return "suspected"
    if explanation.rivals:
        return "alias_group"
    # significant when it was found, but perhaps not beside what was found later
    return "confirmed" if significant else "suspected"


def _reasons(
    tests: CrossFlightTests, decision: Decision, explanation: Explanation, verdict: Verdict
) -> tuple[str, ...]:
    """How sure the finding is, and what may explain it as well."""
    names = tests.campaign.hypotheses
    rivals = ", ".join(names[i].id for i in explanation.rivals)
    sensors = ", ".join(names[i].id for i in explanation.sensors)
    weak = "significant when it was found, but not in the model of all findings"
    few = ("too few flights for an error rate", *([f"{rivals} would do as well"] if rivals else ()))
    if verdict == "suspected":
        return few if explanation.index in decision.suspected else (weak,)
    ends: dict[str, str] = {
        "confirmed": (
            "no other effect explains it as well, and no single sensor error takes it away"
        ),
        "alias_group": f"these flights cannot tell it from {rivals}",
        "sensor": (
            "it acts on all axes as this sensor would, and every aerodynamic effect explains less"
        ),
        "ambiguous_sensor": (
            f"it cannot be told from {', '.join(part for part in (rivals, sensors) if part)}"
        ),
    }
    return (ends[verdict],)


def _not_found(
    hypothesis: Hypothesis, test: Tested, index: int, settings: TracingSettings
) -> NotFound:
    """Verdict and bounds of a hypothesis that is in no explanation set."""
    bound, detectable = float(test.bound[index]), float(test.detectable[index])
    believable = max(abs(hypothesis.plausible[0]), abs(hypothesis.plausible[1]))
    verdict: Verdict = "not_detected"
    if not test.excited[index]:
        verdict = "not_excited"
    elif hypothesis.effect != OFFSET and test.inflation[index] > settings.inflation_limit:
        verdict = "not_separable"
    elif test.count[index] < settings.fewest:
        verdict = "not_testable"
    elif detectable > believable:
        verdict = "not_excited"
    return NotFound(
        hypothesis=hypothesis.id,
        effect=hypothesis.effect,
        axis=tuple(hypothesis.axes),
        subject=hypothesis.subject,
        verdict=verdict,
        parameter=hypothesis.parameter,
        unit=hypothesis.unit,
        upper_bound=bound if np.isfinite(bound) else None,
        minimum_detectable=detectable if np.isfinite(detectable) else None,
        believable=hypothesis.plausible,
    )
