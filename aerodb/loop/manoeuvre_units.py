"""Manoeuvres as units of tracing where fewer flights than it needs can vote: which they are, and
what they say."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from aerodb.conditioning import STATES
from aerodb.loop.evidence import evidence_beside
from aerodb.loop.flights import FlightSource
from aerodb.loop.library import Library
from aerodb.tables import AeroDatabase
from aerodb.tracing import (
    Evidence,
    FewFlightFindings,
    SamplingUnit,
    Traced,
    TracingSettings,
    few_flight_findings,
    units,
    windows,
)

#: Verdicts that more votes could change.
_TOO_FEW = ("not_testable",)
#: Axes on which units must be independent for a finding of that plane of motion.
_PLANES = (("CX", "CZ", "Cm"), ("CY", "Cl", "Cn"))


def too_few_voted(traced: Traced, settings: TracingSettings) -> bool:
    """Whether there are hardly more flights than the error rate needs, and some effect has fewer
    votes than that."""
    few = len(traced.flights) < settings.fewest
    return few or (
        len(traced.flights) == settings.fewest
        and any(item.verdict in _TOO_FEW for item in traced.not_found)
    )


def by_manoeuvres(
    source: FlightSource, traced: Traced, library: Library, database: AeroDatabase
) -> tuple[FewFlightFindings, ...]:
    """What the manoeuvres of the flights suspect together, beside what the flights have found, one
    plane of motion after the other; empty where flights are enough, or where there are no two
    manoeuvres.

    Twice: how far apart manoeuvres must be hangs on how long what is left is correlated, and that
    on what has been found.
    """
    hypotheses, settings = library.hypotheses, library.settings
    if not too_few_voted(traced, settings):
        return ()
    known = [finding.hypothesis for finding in traced.findings]
    evidence = [evidence_beside(source, flight, database, library) for flight in traced.flights]
    # A stall and the way back are one event, whatever else is moved meanwhile.
    spans = {
        each.flight: () if each.flight in library.stall else manoeuvre_spans(source, each.flight)
        for each in evidence
    }
    chosen = _units(evidence, spans, {})
    if len(chosen) < 2:
        return ()
    said = few_flight_findings(chosen, hypotheses, settings, known)
    parts = []
    for axes in _PLANES:
        mine = _in_plane(said, axes)
        if not mine.findings:
            continue
        apart = {
            flight: max(times.get(axis, 0.0) for axis in axes)
            for flight, times in said.correlation_time.items()
        }
        again = _units(evidence, spans, apart)
        if len(again) > 1 and [each.flight for each in again] != [each.flight for each in chosen]:
            mine = _in_plane(few_flight_findings(again, hypotheses, settings, known), axes)
        if len(again) > 1:
            parts.append(mine)
    return tuple(parts) or (replace(said, findings=()),)


def _in_plane(said: FewFlightFindings, axes: Collection[str]) -> FewFlightFindings:
    """With the findings of one plane of motion only."""
    lateral = {"CY", "Cl", "Cn", "C_side"}
    wanted = bool(lateral & set(axes))
    # A force along the wind is felt on more body axes than those of its plane: what counts is where
    # the formula stands.
    written = {
        hypothesis.id: hypothesis.written_on[0]
        for hypothesis in said.joint.tests.campaign.hypotheses
    }
    return replace(
        said,
        findings=tuple(f for f in said.findings if (written[f.hypothesis] in lateral) == wanted),
    )


def with_few_flight_findings(traced: Traced, parts: Sequence[FewFlightFindings]) -> Traced:
    """What flights found and bounded, and what their manoeuvres suspect."""
    names = dict.fromkeys(
        equations.flight for said in parts for equations in said.joint.normal_equations
    )
    included = [SamplingUnit.parse(name) for name in names]
    findings = [finding for said in parts for finding in said.findings]
    short = ", ".join(unit.short if unit.window is None else f"{unit.short} s" for unit in included)
    by_window = any(unit.window is not None for unit in included)
    what = (
        "manoeuvres voted, not flights"
        if by_window
        else "these flights voted beside the linear set"
    )
    note = (
        f"Too few flights for the error rate: {what} ({short}); what they found so is suspected at"
        " most."
    )
    found = {finding.hypothesis for finding in findings}
    return replace(
        traced,
        findings=(*traced.findings, *sorted(findings, key=lambda finding: finding.p_adjusted)),
        not_found=tuple(item for item in traced.not_found if item.hypothesis not in found),
        notes=(*traced.notes, note),
    )


def manoeuvre_spans(source: FlightSource, flight: str) -> tuple[tuple[float, float], ...]:
    """Start and end [s from the first sample] of the manoeuvres of a flight (its id), those that
    overlap as one."""
    spans: list[tuple[float, float]] = []
    for segment in sorted(source.segments(flight), key=lambda segment: segment.start):
        start, end = segment.start, segment.end
        if segment.kind in STATES:
            continue
        if spans and start <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(end, spans[-1][1]))
        else:
            spans.append((start, end))
    return tuple(spans)


def _units(
    evidence: Sequence[Evidence],
    spans: Mapping[str, Sequence[tuple[float, float]]],
    apart: Mapping[str, float],
) -> list[Evidence]:
    """The flights cut at their manoeuvres; a flight without any, or with one, votes whole."""
    found: list[Evidence] = []
    for each in evidence:
        cut = (
            windows(spans[each.flight], (each.samples - 1) * each.step, apart.get(each.flight, 0.0))
            if spans[each.flight]
            else ()
        )
        found += units(each, cut, 0.0) if len(cut) > 1 else (each,)
    return found
