"""Manoeuvres as sampling units, where fewer flights than needed can take part in the tests.

docs/method/tracing.md, section 16.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from aerodb.conditioning import STATES
from aerodb.effects import SURFACE_MOTION
from aerodb.loop.evidence import evidence_beside
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.moving_air import rolling_share
from aerodb.support import SMALL
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
#: Manoeuvres vote where the air rolls no faster than this part of the aircraft's own roll rate. It
#: can then change a damping by a tenth of itself at most. They have no error rate to be kept.
_STILL = SMALL
#: Axes on which units must be independent for a finding of that plane of motion.
_PLANES = (("CX", "CZ", "Cm"), ("CY", "Cl", "Cn"))


def too_few_took_part(traced: Traced, settings: TracingSettings) -> bool:
    """Return whether there are hardly more flights than the error rate needs, and too few show some
    effect. See docs/method/tracing.md, section 16.
    """
    few = len(traced.flights) < settings.fewest
    return few or (
        len(traced.flights) == settings.fewest
        and any(item.verdict in _TOO_FEW for item in traced.not_found)
    )


def by_manoeuvres(
    source: FlightSource, traced: Traced, library: Library, database: AeroDatabase
) -> tuple[FewFlightFindings, ...]:
    """Return what the manoeuvres of all flights suspect together, one plane of motion after the
    other.

    Known findings of whole flights are in the model. Empty where there are enough flights, fewer
    than two manoeuvres, or where the air moved. Two passes: how far apart manoeuvres must be
    depends on the correlation time of the remaining residual, and that on what has been found. A
    manoeuvre reverses a surface too seldom to tell how it follows: such hypotheses stay out. See
    docs/method/tracing.md, section 16; values are in the unit of each hypothesis, times in [s].
    """
    hypotheses = tuple(h for h in library.hypotheses if h.effect not in SURFACE_MOTION)
    library = replace(library, hypotheses=hypotheses)
    settings = library.settings
    if not too_few_took_part(traced, settings):
        return ()
    if rolling_share(source, traced.flights, database, library) > _STILL:
        return ()  # too short to tell the air's rotation from the aircraft's own
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
    suspected = few_flight_findings(chosen, hypotheses, settings, known)
    parts = []
    for axes in _PLANES:
        mine = _in_plane(suspected, axes)
        if not mine.findings:
            continue
        apart = {
            flight: max(times.get(axis, 0.0) for axis in axes)
            for flight, times in suspected.correlation_time.items()
        }
        again = _units(evidence, spans, apart)
        if len(again) > 1 and [each.flight for each in again] != [each.flight for each in chosen]:
            mine = _in_plane(few_flight_findings(again, hypotheses, settings, known), axes)
        if len(again) > 1:
            parts.append(mine)
    return tuple(parts) or (replace(suspected, findings=()),)


def _in_plane(suspected: FewFlightFindings, axes: Collection[str]) -> FewFlightFindings:
    """The same with the findings of one plane of motion only."""
    lateral = {"CY", "Cl", "Cn", "C_side"}
    wanted = bool(lateral & set(axes))
    # A force along the wind is felt on more body axes than those of its plane: what counts is where
    # the formula stands.
    written = {
        hypothesis.id: hypothesis.written_on[0]
        for hypothesis in suspected.joint.tests.campaign.hypotheses
    }
    return replace(
        suspected,
        findings=tuple(
            f for f in suspected.findings if (written[f.hypothesis] in lateral) == wanted
        ),
    )


def with_few_flight_findings(traced: Traced, parts: Sequence[FewFlightFindings]) -> Traced:
    """Return what flights found and bounded, with what their manoeuvres suspect. Each unit is named
    with its window in seconds (`SamplingUnit`)."""
    names = dict.fromkeys(
        equations.flight for suspected in parts for equations in suspected.joint.normal_equations
    )
    included = [SamplingUnit.parse(name) for name in names]
    findings = [finding for suspected in parts for finding in suspected.findings]
    short = ", ".join(unit.short if unit.window is None else f"{unit.short} s" for unit in included)
    by_window = any(unit.window is not None for unit in included)
    what = "single manoeuvres" if by_window else "these flights"
    note = (
        f"Too few flights for an error rate. Effects that {what} show are suspected at most"
        f" ({short})."
    )
    found_ids = {finding.hypothesis for finding in findings}
    return replace(
        traced,
        findings=(*traced.findings, *sorted(findings, key=lambda finding: finding.p_adjusted)),
        not_found=tuple(item for item in traced.not_found if item.hypothesis not in found_ids),
        notes=(*traced.notes, note),
    )


def manoeuvre_spans(source: FlightSource, flight: str) -> tuple[tuple[float, float], ...]:
    """Return start and end [s from the first sample] of a flight's manoeuvres, overlapping ones as
    one.
    """
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
    """The flights cut at their manoeuvres; a flight with one or none stays whole."""
    parts: list[Evidence] = []
    for each in evidence:
        cut = (
            windows(spans[each.flight], (each.samples - 1) * each.step, apart.get(each.flight, 0.0))
            if spans[each.flight]
            else ()
        )
        parts += units(each, cut, 0.0) if len(cut) > 1 else (each,)
    return parts
