"""Two versions side by side: their differences, and their curves with bands at any point."""

import math
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from aerodb.flows.web.console import Vehicle, Word, access_of, document, page_of, version_at
from aerodb.nomenclature import is_surface
from aerodb.report import beyond_data, beyond_words, channel_scale, edits_of
from aerodb.storage.catalogue import VersionRow
from aerodb.tables import AeroDatabase, breakpoints_over, scattered_over
from aerodb.tasks.view import compare_versions, database_of, draw_differences

router = APIRouter(tags=["versions"])
Reference = Annotated[
    str, Query(max_length=300, description="A version: id, label, name or prefix.")
]


@router.get("/compare", include_in_schema=False)
def compare_page(
    request: Request, before: Word = None, after: Word = None, vehicle: Vehicle = None
) -> Response:
    """Curves of two versions over one input, with sliders for all others."""
    access, chosen, lines = access_of(request), [], dict[str, dict[str, Any]]()
    rows, beyond = list[VersionRow](), list[str]()
    for reference in (before, after) if before and after else ():
        rows.append(row := version_at(access, reference, vehicle))
        database = database_of(access.catalogue, row)
        chosen.append({"id": row.id, "label": row.label, "inputs": list(database.inputs)})
        beyond += [f"{row.label}, {each}" for each in beyond_words(database.increments)]
        for line in lines_of(database):
            known = lines.get(line["name"])
            lines[line["name"]] = _joined(known, line) if known else line
    labels = [each["label"] for each in chosen]
    title = f"{labels[0]} and {labels[1]} side by side" if chosen else "Compare curves"
    return page_of(
        request,
        "compare.html",
        title,
        versions=chosen,
        beyond=beyond,
        lines=[_with_reach(line) for line in lines.values()],
        asked=_called(*rows) if rows else (before, after, vehicle),
    )


@router.get("/diff", include_in_schema=False)
def diff_page(
    request: Request, before: Word = None, after: Word = None, vehicle: Vehicle = None
) -> Response:
    """Differences between two versions."""
    access = access_of(request)
    if before is None or after is None:
        return page_of(
            request,
            "diff.html",
            "Compare versions",
            before=None,
            after=None,
            asked=(before, after, vehicle),
        )
    old, new = version_at(access, before, vehicle), version_at(access, after, vehicle)
    difference = compare_versions(access.catalogue, old, new)
    labels = access.catalogue.flight_labels(
        {flight for term in difference["terms"] for flight in term["flights"]}
    )
    title = f"Changes from {old.label} to {new.label} of {new.vehicle}"
    context: dict[str, Any] = {
        "before": old,
        "after": new,
        "diff": difference,
        "edits": edits_of(difference),
        "beyond": beyond_data(*(database_of(access.catalogue, row) for row in (old, new))),
        "labels": labels,
        "asked": _called(old, new),
    }
    return page_of(request, "diff.html", title, **context)


@router.get("/api/diff", summary="Differences between two versions")
def diff(
    request: Request,
    before: Reference,
    after: Reference,
    vehicle: Vehicle = None,
) -> Response:
    """The document of `aerodb version diff`."""
    access = access_of(request)
    return document(
        compare_versions(
            access.catalogue,
            version_at(access, before, vehicle),
            version_at(access, after, vehicle),
        )
    )


@router.get("/diff/figure.svg", include_in_schema=False)
def diff_figure(
    request: Request,
    before: Reference,
    after: Reference,
    on_phone: bool = False,
) -> Response:
    """Slices through two versions where they differ, as a figure; for a phone below one another."""
    access = access_of(request)
    rows = [version_at(access, each, None) for each in (before, after)]
    drawn = draw_differences(access.catalogue, rows[0], rows[1], "svg", on_phone)
    return Response(drawn, media_type="image/svg+xml")


def _called(old: VersionRow, new: VersionRow) -> tuple[str, str, str]:
    """Return references of two versions for people: labels, if both belong to one vehicle."""
    return (
        (old.label, new.label, new.vehicle) if old.vehicle == new.vehicle else (old.id, new.id, "")
    )


#: Range [SI] of an input that no table and no flight bounds.
_REACH: Final = {"V": (1.0, 100.0), "mach": (0.0, 1.0), **dict.fromkeys("pqr", (-1.0, 1.0))}
_ANGLE: Final = math.radians(20.0)


def _with_reach(line: dict[str, Any]) -> dict[str, Any]:
    """An input with a range that can be moved through, and where it begins (SI)."""
    low, high = line["low"], line["high"]
    if not line["known"]:
        angle = line["factor"] > 1.0 or is_surface(line["name"])
        low, high = _REACH.get(line["name"], (-_ANGLE, _ANGLE) if angle else (low, high))
    start = min(max(0.0, low), high) if low <= 0.0 <= high else 0.5 * (low + high)
    return {**line, "low": low, "high": high, "start": start}


def _joined(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """One input of two versions: the range of both, or of the one that knows it."""
    if one["known"] and other["known"]:
        ends = {"low": min(one["low"], other["low"]), "high": max(one["high"], other["high"])}
        return {**one, **ends}
    return one if one["known"] else other


def lines_of(database: AeroDatabase) -> list[dict[str, Any]]:
    """Return the inputs along which a version can be drawn, and their range (SI) in tables and
    flights."""
    lines = []
    for name in database.inputs:
        marks = [
            float(edge)
            for points in (*breakpoints_over(name, database), *scattered_over(name, database))
            for edge in (points[0], points[-1])
        ]
        for increment in database.increments:
            if name in increment.envelope:
                marks += [increment.envelope[name].low, increment.envelope[name].high]
        marks = [mark for mark in marks if math.isfinite(mark)]
        factor, label = channel_scale(name)
        low, high = (
            (min(marks), max(marks))
            if marks and max(marks) > min(marks)
            else (0.0, 1.0 / factor if factor > 1 else 1.0)
        )
        lines.append(
            {
                "name": name,
                "label": label,
                "factor": factor,
                "low": low,
                "high": high,
                "known": bool(marks) and max(marks) > min(marks),
            }
        )
    return lines
