"""Versions: list, evaluation, sweeps, tables, exports, differences, and the history of names."""

import tempfile
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from aerodb.errors import InputError
from aerodb.flows.answers import Evaluated, Move, Version
from aerodb.flows.fly import validate_flow
from aerodb.flows.report import report_flow
from aerodb.flows.web import models
from aerodb.flows.web.compare_pages import lines_of
from aerodb.flows.web.console import (
    PER_PAGE,
    AsOf,
    Limit,
    Point,
    Vehicle,
    Word,
    access_of,
    address,
    console_of,
    document,
    page_of,
    report,
    version_at,
)
from aerodb.flows.web.models import answers
from aerodb.report import (
    beyond_data,
    beyond_words,
    channel_scale,
    error_rows,
    gate_rows,
    release_lines,
)
from aerodb.tasks.references import flights_to_judge, value_of, vehicle_of
from aerodb.tasks.steps import FORMS, export_version, judge_version, known_responses
from aerodb.tasks.view import (
    MOST_LINE_POINTS,
    database_of,
    evaluate_at,
    findings_words,
    flights_words,
    held_out_words,
    history_document,
    matching,
    sweep,
    table_document,
    version_details,
    versions_document,
    waiting,
)
from aerodb.tasks.workspace_access import WorkspaceAccess

router = APIRouter(tags=["versions"])
Before = Annotated[
    int | None,
    Query(ge=1, le=2**53, description="End of the previous page, from its header Link."),
]
Format = Literal["daveml", "jsbsim", "csv", "mat", "netcdf", "gazebo", "sitl"]
_SUFFIX: dict[str, str] = {
    "daveml": "dml",
    "jsbsim": "xml",
    "csv": "csv",
    "mat": "mat",
    "netcdf": "nc",
    "gazebo": "sdf",
    "sitl": "json",
}


def _chosen(access: WorkspaceAccess, vehicle: str | None) -> tuple[str | None, list[str]]:
    """Return the vehicle to list (the named, the only or the first one), and all vehicles."""
    names = [row.name for row in access.catalogue.vehicles()]
    return (vehicle_of(access.catalogue, vehicle) if vehicle else next(iter(names), None)), names


@router.get("/versions", include_in_schema=False)
def versions_page(
    request: Request, vehicle: Vehicle = None, before: Before = None, search: Word = None
) -> Response:
    """The versions of a vehicle, newest first, or the newest of those with some words."""
    access = access_of(request)
    owner, names = _chosen(access, vehicle)
    rows = access.catalogue.versions(owner, None if search else PER_PAGE, before) if owner else ()
    further = (
        address("/versions", vehicle=owner, before=rows[0].number)
        if rows and rows[0].number > 1
        else ""
    )
    labels = {
        row.id: row.label
        for row in access.catalogue.versions_by_id(
            row.parent for row in rows if row.parent
        ).values()
    }
    listed = versions_document(access.catalogue, owner, rows) if owner else []
    if search:
        listed = matching(listed, search)[-PER_PAGE:]
    shown = {
        "search": search,
        "held_out_words": held_out_words,
        "flights_words": flights_words,
        "findings_words": findings_words,
        "versions": listed[::-1],
        "labels": labels,
        "vehicle": owner,
        "vehicles": names,
        "before": before,
        "further": further,
    }
    return page_of(request, "versions.html", "Versions", **shown)


@router.get("/api/versions", summary="Versions of a vehicle", responses=answers(list[Version]))
def versions(
    request: Request,
    vehicle: Vehicle = None,
    before: Before = None,
    limit: Limit = PER_PAGE,
    search: Word = None,
) -> Response:
    """The document of `aerodb version list`: the newest, oldest first; the next page has earlier
    ones. With `search`: the newest of those that have all its words."""
    access = access_of(request)
    owner = vehicle_of(access.catalogue, vehicle)
    if search:
        found = versions_document(access.catalogue, owner, access.catalogue.versions(owner))
        return document(matching(found, search)[-limit:])
    rows = access.catalogue.versions(owner, limit, before)
    more = bool(rows) and rows[0].number > 1
    further = (
        address("/api/versions", vehicle=owner, before=rows[0].number, limit=limit) if more else ""
    )
    return document(versions_document(access.catalogue, owner, rows), further)


@router.get("/versions/{version}", include_in_schema=False)
def version_page(
    request: Request,
    version: str,
    vehicle: Vehicle = None,
    as_of: AsOf = None,
    at: Point = "",
    table: Word = None,
) -> Response:
    """One version: quality, flights, gate and findings on top; below them an evaluation at a point,
    curves, one of its tables, and exports."""
    access = access_of(request)
    row = version_at(access, version, vehicle, as_of)
    details = version_details(access.catalogue, row)
    database = database_of(access.catalogue, row)
    names = [name for name, id in access.catalogue.names(row.vehicle).items() if id == row.id]
    evaluation, fault = None, ""
    if at or not database.inputs:
        try:
            evaluation = evaluate_at(access.catalogue, row, at)
        except InputError as error:
            fault = f"{error.what}. {error.remedy}"
    parent = access.catalogue.version_of_id(row.parent) if row.parent else None
    gate = judge_version(row.id, workspace=str(access.workspace.root), run="", fly=False)
    responses = known_responses(access, row, row.parent)
    waits = {each.id for each in waiting(access.catalogue, row.vehicle)}
    return page_of(
        request,
        "version.html",
        f"Version {row.label} of {row.vehicle}",
        waits=row.id in waits,
        passes=gate["passed"],
        summary=_summary(gate, details["report"], responses),
        errors=error_rows(details["report"]) if "axes" in details["report"] else [],
        rows=gate_rows(gate["checks"]),
        responses=responses,
        beyond=[] if parent is None else beyond_data(access.database(parent.id), database),
        outside=beyond_words(database.increments, evaluation["outside_envelope"])
        if evaluation and evaluation["outside_envelope"]
        else [],
        version=details,
        database=database,
        names=sorted(names),
        parent=parent,
        at=at,
        found=evaluation,
        fault=fault,
        table=_table(database, table) if table else None,
        lines=lines_of(database),
        axes=database.axes,
        formats=sorted(FORMS),
    )


def _summary(
    gate: dict[str, Any], report: dict[str, Any], responses: dict[str, Any] | None
) -> list[tuple[str, list[str]]]:
    """What to judge a version on, with the number of its flights by role."""
    roles = report.get("flights", {})
    shown = [
        f"{len(roles[role])} {role.replace('_', ' ')}"
        for role in ("identified", "held_out", "excluded")
        if roles.get(role)
    ]
    lines = release_lines(gate, report, responses)
    flights = [("flights", [", ".join(shown)])] if shown else []
    return [*flights, *lines]


@router.get("/api/versions/{version}", summary="One version", responses=answers(Version))
def version(
    request: Request, version: str, vehicle: Vehicle = None, as_of: AsOf = None
) -> Response:
    """The document of `aerodb version show`."""
    access = access_of(request)
    return document(version_details(access.catalogue, version_at(access, version, vehicle, as_of)))


@router.get(
    "/api/versions/{version}/evaluate",
    summary="A version at a point",
    responses=answers(Evaluated),
)
def evaluate(
    request: Request, version: str, at: Point = "", vehicle: Vehicle = None, as_of: AsOf = None
) -> Response:
    """The document of `aerodb version evaluate`."""
    access = access_of(request)
    return document(evaluate_at(access.catalogue, version_at(access, version, vehicle, as_of), at))


@router.get(
    "/api/versions/{version}/sweep",
    summary="A version along one input",
    responses=answers(models.Sweep),
)
def along(
    request: Request,
    version: str,
    over: Annotated[str, Query(max_length=80, description="The input that varies.")],
    start: Annotated[
        str, Query(alias="from", max_length=60, description="From, with a unit or in SI.")
    ],
    end: Annotated[str, Query(alias="to", max_length=60, description="To, with a unit or in SI.")],
    points: Annotated[int, Query(ge=2, le=MOST_LINE_POINTS)] = 201,
    at: Point = "",
    vehicle: Vehicle = None,
    as_of: AsOf = None,
) -> Response:
    """Value, standard error and place of every axis along a line; values and line in SI."""
    access = access_of(request)
    row = version_at(access, version, vehicle, as_of)
    factor, label = channel_scale(over)
    reach = (value_of(over, start, by_program=True), value_of(over, end, by_program=True))
    values = sweep(access.catalogue, row, over, reach, points, at)
    return document({**values, "label": label, "factor": factor})


@router.get("/api/versions/{version}/tables/{table}", summary="A table of a version")
def table(
    request: Request, version: str, table: str, vehicle: Vehicle = None, as_of: AsOf = None
) -> Response:
    """Breakpoints and values of a table, in its own units."""
    access = access_of(request)
    return document(
        table_document(
            database_of(access.catalogue, version_at(access, version, vehicle, as_of)), table
        )
    )


@router.get("/versions/{version}/report", include_in_schema=False)
def version_report(request: Request, version: str, vehicle: Vehicle = None) -> Response:
    """The report of a version, as `aerodb report version` writes it."""
    row = version_at(access_of(request), version, vehicle)
    parameters = {"kind": "version", "about": row.id, "in_pieces": True}
    return report(request, console_of(request).run(report_flow, parameters))


@router.get("/versions/{version}/responses", include_in_schema=False)
def version_responses(
    request: Request, version: str, vehicle: Vehicle = None, fly: bool = False
) -> Response:
    """The version and its parent flown over the held-out flights, as `aerodb version validate`
    writes it. Where they were not flown before, a page says so and asks for the one with `fly`."""
    access = access_of(request)
    row = version_at(access, version, vehicle)
    flights, independent = flights_to_judge(access.catalogue, row)
    if not fly and known_responses(access, row, row.parent) is None:
        further = address(f"/versions/{row.id}/responses", fly="true")
        parent = access.catalogue.version_of_id(row.parent) if row.parent else None
        labels = [each.label for each in (row, parent) if each is not None]
        title = f"Responses of {row.label} of {row.vehicle}"
        shown = {"labels": labels, "flights": len(flights), "further": further}
        page = page_of(request, "flown_first.html", title, **shown)
        page.headers["refresh"] = f"0;url={further}"
        return page
    parameters = {
        "version": row.id,
        "baseline": row.parent,
        "flights": flights,
        "independent": independent,
        "page": True,
        "in_pieces": True,
    }
    return report(request, console_of(request).run(validate_flow, parameters)["page"])


@router.get("/api/versions/{version}/export", summary="Export of a version")
def export(
    request: Request, version: str, format: Format, vehicle: Vehicle = None, as_of: AsOf = None
) -> Response:
    """The file that `aerodb version export` writes: read back, and returned only if its check cases
    pass."""
    access = access_of(request)
    row = version_at(access, version, vehicle, as_of)
    name = f"{row.vehicle}-{row.label}.{_SUFFIX[format]}"
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / name
        outcome = export_version(access.workspace, access.catalogue, row, format, target)
        data = target.read_bytes()
    headers = {
        "content-disposition": f'attachment; filename="{name}"',
        "x-checked": outcome["checked"],
    }
    return Response(data, 200, headers, "application/octet-stream")


@router.get("/history", include_in_schema=False)
def history_page(
    request: Request, vehicle: Vehicle = None, name: Word = None, before: Before = None
) -> Response:
    """Moves of the names of a vehicle's versions, newest first."""
    access = access_of(request)
    owner, names = _chosen(access, vehicle)
    events = access.catalogue.name_history(owner, name, PER_PAGE + 1, before) if owner else ()
    shown = events[-PER_PAGE:]
    more = len(events) > PER_PAGE
    further = (
        address("/history", vehicle=owner, name=name, before=shown[0].sequence) if more else ""
    )
    versions = access.catalogue.versions_by_id(
        {id for event in shown for id in (event.version, event.previous) if id}
    )
    labels = {id: row.label for id, row in versions.items()}
    known = list(access.catalogue.names(owner)) if owner else []
    moves = history_document(shown)[::-1]
    context: dict[str, Any] = {
        "moves": moves,
        "labels": labels,
        "vehicle": owner,
        "vehicles": names,
        "name": name,
    }
    return page_of(
        request,
        "history.html",
        "History of names",
        **context,
        names=known,
        before=before,
        further=further,
    )


@router.get("/api/history", summary="Releases and rollbacks", responses=answers(list[Move]))
def history(
    request: Request,
    vehicle: Vehicle = None,
    name: Word = None,
    before: Before = None,
    limit: Limit = PER_PAGE,
) -> Response:
    """The document of `aerodb version history`: the newest, oldest first; the next page has earlier
    ones."""
    access = access_of(request)
    owner = vehicle_of(access.catalogue, vehicle)
    events = access.catalogue.name_history(owner, name, limit + 1, before)
    shown = events[-limit:]
    parameters = {"vehicle": owner, "name": name, "limit": limit}
    further = (
        address("/api/history", **parameters, before=shown[0].sequence)
        if len(events) > limit
        else ""
    )
    return document(history_document(shown), further)


def _table(database: Any, name: str) -> dict[str, Any]:
    """Return a table with breakpoints in the units that are shown to people (angles in degrees)."""
    content = table_document(database, name)
    if "points" in content:
        return {**content, "heads": _scattered_heads(content)}
    if content["channels"] is None:
        return {
            **content,
            "heads": list(zip(content["arguments"], content["breakpoints"], strict=True)),
        }
    scales = [channel_scale(channel) for channel in content["channels"]]
    at = [
        [factor * value for value in values]
        for (factor, _), values in zip(scales, content["nodes"], strict=True)
    ]
    return {
        **content,
        "heads": [(label, values) for (_, label), values in zip(scales, at, strict=True)],
    }


def _scattered_heads(content: dict[str, Any]) -> list[tuple[str, list[float]]]:
    """Return label and values of each argument of a table on scattered points, as people read
    them."""
    names = content["channels"] or content["arguments"]
    columns = zip(*content["points"], strict=True)
    scales = [channel_scale(name) if content["channels"] else (1.0, name) for name in names]
    return [
        (label, [factor * value for value in values])
        for (factor, label), values in zip(scales, columns, strict=True)
    ]
