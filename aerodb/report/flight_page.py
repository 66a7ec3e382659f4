"""The report page of one flight: its verdict first, then the evidence for it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import partial
from typing import Any, Final

from aerodb.coefficients import Comparison
from aerodb.conditioning import Segment, Suspicion
from aerodb.flight import Flight
from aerodb.nomenclature import axis_description, in_order
from aerodb.remarks import SUSPECTED, Remark
from aerodb.report.flight_figures import (
    channel_figure,
    coefficient_figure,
    envelope_figure,
    ranges,
    segment_figure,
    shown_channels,
)
from aerodb.report.head import Head
from aerodb.report.numbers import for_people, number
from aerodb.report.page import pieces
from aerodb.report.style import Picture
from aerodb.report.terms import sensor_error_unit
from aerodb.signals import rms
from aerodb.tables import AeroDatabase

_SAYS: Final = {
    "good": "The flight can be used for identification and validation",
    "limited": "The flight can be used with limitations",
    "rejected": "The flight is stored but not used for identification",
    "unchecked": "The kinematic consistency of the flight has not been checked",
}
#: Number of segments listed; the figure shows all.
_MOST_SEGMENTS: Final = 60
#: Number of channels whose time histories fill a page.
_ON_A_PAGE: Final = 16
#: Inputs whose range is shown beside a database without inputs.
_USUAL_INPUTS: Final = ("V", "alpha", "beta", "mach", "altitude")


@dataclass(frozen=True)
class FlightStory:
    """Contents of the report page of a flight.

    Attributes
    ----------
    consistency : stored document of the consistency step; None before it ran.
    measured, flight : channels before and after the consistency step.
    comparison : of the flight with `version` and its `database`; None where `no_comparison` says
        why there is none.
    versions : (label, role) of the versions that use the flight.
    suspicions, segments : results of conditioning.
    head : where the consistency result comes from.
    """

    id: str
    label: str
    vehicle: str
    log: str
    start_utc: datetime | None
    verdict: str
    remarks: Sequence[Remark]
    retracted: str
    consistency: Mapping[str, Any] | None
    measured: Flight
    flight: Flight
    comparison: Comparison | None
    database: AeroDatabase | None
    version: str
    no_comparison: str
    versions: Sequence[tuple[str, str]]
    suspicions: Sequence[Suspicion] = ()
    segments: Sequence[Segment] = ()
    head: Head | None = None


def flight_report(story: FlightStory) -> Iterator[str]:
    """Return the report of a flight as one HTML page in pieces (`pieces`), in display units
    (`channel_scale`: degrees for radians), with times from its first sample; it fetches nothing."""
    zero, story = float(story.flight.time[0]), _from_first_sample(story)
    flight, names = story.flight, shown_channels(story.flight)
    span = f"{flight.time[-1] - flight.time[0]:.1f} s at {1 / flight.step:.4g} Hz"
    histories = [
        Picture(
            partial(channel_figure, part, story.measured, flight),
            f"Time histories of {', '.join(part)}, measured and reconstructed.",
            "Black: reconstructed. Grey: measured, where it differs. Shaded: unused samples.",
        )
        for part in (names[k : k + _ON_A_PAGE] for k in range(0, max(1, len(names)), _ON_A_PAGE))
    ]
    coefficients = None
    if story.comparison is not None:
        coefficients = Picture(
            partial(coefficient_figure, story.comparison, flight),
            f"Coefficients of the flight and of {story.version} over time, their difference, and"
            " both against alpha or beta.",
            f"Black: flight. Orange, dashed or large dots: {story.version}. Middle column: flight −"
            f" {story.version}. Grey band, and black lines in the middle column: two standard"
            " errors of the sensors, which no database can explain.",
        )
    flown = Picture(
        partial(envelope_figure, flight, story.database),
        "Planes of angle of attack, sideslip, Mach number, airspeed and altitude with the samples"
        " flown.",
        "Usable samples. Dashed: edges of the database's tables, where they are near.",
    )
    inputs = (story.database.flight_inputs if story.database else ()) or _USUAL_INPUTS
    return pieces(
        "flight.html",
        title=f"Flight {story.label}",
        head=story.head,
        story=story,
        says=verdict_sentences(story.verdict, story.remarks, story.consistency),
        zero=zero,
        activity=_activity(story),
        segments=_listed(story.segments),
        more_segments=max(0, len(story.segments) - _MOST_SEGMENTS),
        span=span,
        checks=_checks(story.consistency),
        corrections=_corrections(story.consistency),
        histories=histories,
        coefficients=coefficients,
        errors=_errors(story.comparison),
        flown=flown,
        ranges=ranges(flight, inputs, story.database),
    )


def _from_first_sample(story: FlightStory) -> FlightStory:
    """Return it with the times that all pages of a flight have: [s] from its first sample."""
    zero = float(story.flight.time[0])
    compared = story.comparison
    return replace(
        story,
        measured=replace(story.measured, time=story.measured.time - zero),
        flight=replace(story.flight, time=story.flight.time - zero),
        comparison=compared and replace(compared, time=compared.time - zero),
        segments=[
            replace(each, start=each.start - zero, end=each.end - zero) for each in story.segments
        ],
    )


def verdict_sentences(
    verdict: str, remarks: Sequence[Remark], consistency: Mapping[str, Any] | None
) -> tuple[str, str]:
    """Return the verdict (docs/reference/conventions.md, section Consistency verdicts): what the
    flight can be used for and why not for more, and its consistency; empty where none was checked.

    What is only suspected takes nothing away from it. Errors are in display units.
    """
    limiting = (remark for remark in remarks if remark.kind != SUSPECTED)
    why = "; ".join(dict.fromkeys(remark.clause for remark in limiting))
    sentence = f"{_SAYS.get(verdict, 'Its verdict is ' + verdict)}{f': {why}' if why else ''}."
    channels = (consistency or {}).get("channels", ())
    checked = [
        entry for entry in channels if entry["limit"] is not None and math.isfinite(entry["limit"])
    ]
    if not checked:
        return sentence, ""
    beyond = [entry["channel"] for entry in checked if entry["verdict"] != "good"]
    if beyond:
        return sentence, f"Outside their limits: {', '.join(beyond)}."
    closest = max(checked, key=lambda entry: entry["after"] / entry["limit"])
    factor, unit = for_people(sensor_error_unit(closest["channel"]))
    after, limit = number(factor * closest["after"], 2), number(factor * closest["limit"], 2)
    gusts = ", gusts included" if closest["after"] > closest["limit"] else ""
    count = (
        f"All {len(checked)} channels with a limit are consistent"
        if len(checked) > 1
        else "The one channel with a limit is consistent"
    )
    return sentence, (
        f"{count} with the reconstructed motion; {closest['channel']} is closest to its limit"
        f" ({after} of {limit} {unit}{gusts})."
    )


def _activity(story: FlightStory) -> Picture | None:
    if not story.segments:
        return None
    kinds = ", ".join(dict.fromkeys(segment.kind.replace("_", " ") for segment in story.segments))
    return Picture(
        partial(segment_figure, story.segments, story.flight),
        f"Segments of the flight over time: {kinds}.",
        "Black: manoeuvres; grey: states.",
    )


def _listed(segments: Sequence[Segment]) -> list[dict[str, Any]]:
    return [
        {**asdict(segment), "kind": segment.kind.replace("_", " ")}
        for segment in segments[:_MOST_SEGMENTS]
    ]


def _checks(consistency: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Rows of the consistency table, in display units."""
    rows = []
    used = consistency.get("used", {}) if consistency else {}
    for entry in consistency["channels"] if consistency else ():
        factor, unit = for_people(sensor_error_unit(entry["channel"]))
        limit = None if entry["limit"] is None else factor * entry["limit"]
        rows.append(
            {
                "channel": entry["channel"],
                "before": factor * entry["before"],
                "after": factor * entry["after"],
                "limit": limit,
                "unit": unit,
                "verdict": entry["verdict"],
                "used": used.get(entry["channel"], ""),
            }
        )
    return rows


def _corrections(consistency: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Rows of the estimated sensor errors, in display units, applied ones first.

    Errors estimated for a single stretch of the flight are left out.
    """
    rows = []
    for entry in consistency.get("estimates", ()) if consistency else ():
        if entry["stretch"] is not None:
            continue
        factor, unit = for_people(sensor_error_unit(entry["parameter"]))
        rows.append(
            {
                "parameter": entry["parameter"],
                "value": factor * entry["value"],
                "error": factor * entry["standard_error"],
                "unit": unit,
                "applied": entry["applied"],
            }
        )
    return sorted(rows, key=lambda row: not row["applied"])


def _errors(comparison: Comparison | None) -> list[dict[str, Any]]:
    rows = []
    for axis in in_order(comparison.usable) if comparison is not None else ():
        assert comparison is not None
        good = comparison.usable[axis]
        if good.any():
            rows.append(
                {
                    "axis": axis,
                    "meaning": axis_description(axis),
                    "measured": rms(comparison.measured[axis][good]),
                    "residual": rms(comparison.residual(axis)[good]),
                    "floor": rms(comparison.sigma[axis][good]),
                    "samples": int(good.sum()),
                }
            )
    return rows
