"""Lineage: what a version, a table cell or a point is based on, and what is based on a flight."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from aerodb.errors import InputError
from aerodb.flows.web.console import Point, Vehicle, access_of, document, page_of, version_at
from aerodb.storage.catalogue import VersionRow
from aerodb.tasks.steps import lineage_of
from aerodb.tasks.view import impact_document, lineage_document, origins_document, prov_of
from aerodb.tasks.workspace_access import WorkspaceAccess

router = APIRouter(tags=["lineage"])
Node = Annotated[
    str | None, Query(max_length=200, description="A table node, TABLE[i,j], counted from 0.")
]


def _asked(access: WorkspaceAccess, row: VersionRow, node: str | None, at: str) -> dict[str, Any]:
    """Return the lineage document of the whole version, or of a node or point."""
    if node and at:
        raise InputError("node and point exclude each other", "node, at", "give a node or a point")
    if node or at:
        return origins_document(access.catalogue, row, node or None, at)
    return lineage_document(access.catalogue, row)


@router.get("/versions/{version}/lineage", include_in_schema=False)
def lineage_page(
    request: Request, version: str, node: Node = None, at: Point = "", vehicle: Vehicle = None
) -> Response:
    """What a version, or one number of it, is based on."""
    access = access_of(request)
    row = version_at(access, version, vehicle)
    answer = _asked(access, row, node, at)
    labels = access.catalogue.flight_labels(entry["flight"] for entry in answer.get("flights", ()))
    if "flights" in answer:
        by_name = sorted(answer["flights"], key=lambda entry: labels[entry["flight"]])
        answer = {**answer, "flights": by_name}
    what = node or at
    title = (
        f"Lineage of {what} in {row.label}" if what else f"Lineage of {row.label} of {row.vehicle}"
    )
    return page_of(
        request,
        "lineage.html",
        title,
        row=row,
        found=answer,
        labels=labels,
        what=what,
        graph=None if what else lineage_of(access, row),
        node=node or "",
        at=at,
    )


@router.get(
    "/api/versions/{version}/lineage", summary="Lineage of a version, or of one of its numbers"
)
def lineage(
    request: Request, version: str, node: Node = None, at: Point = "", vehicle: Vehicle = None
) -> Response:
    """The document of `aerodb version lineage`, also with --node or --at."""
    access = access_of(request)
    return document(_asked(access, version_at(access, version, vehicle), node, at))


@router.get("/api/versions/{version}/prov", summary="The lineage of a version as W3C PROV-JSON")
def prov(request: Request, version: str, vehicle: Vehicle = None) -> Response:
    """The file that `aerodb version lineage --prov` writes."""
    access = access_of(request)
    return Response(
        prov_of(access.catalogue, version_at(access, version, vehicle)),
        media_type="application/json",
    )


@router.get("/flights/{flight}/impact", include_in_schema=False)
def impact_page(request: Request, flight: str, vehicle: Vehicle = None) -> Response:
    """Versions based on a flight."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    uses = access.catalogue.impact(row.id)
    pointed = {id: name for name, id in access.catalogue.names(row.vehicle).items()}
    through = {
        id: version.label
        for id, version in access.catalogue.versions_by_id(use.through for use in uses).items()
    }
    label = access.catalogue.flight_labels([row.id])[row.id]
    shown = {"row": row, "label": label, "uses": uses, "through": through, "pointed": pointed}
    return page_of(request, "impact.html", f"Versions based on {label}", **shown)


@router.get("/api/flights/{flight}/impact", summary="Versions based on a flight")
def impact(request: Request, flight: str, vehicle: Vehicle = None) -> Response:
    """The document of `aerodb version impact`."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    return document(impact_document(row.id, access.catalogue.impact(row.id)))
