"""The overview page, the session of changes, and the API's table of contents."""

from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import RedirectResponse, Response

from aerodb.flows.web.bodies import form_of
from aerodb.flows.web.console import access_of, console_of, document, page_of
from aerodb.flows.web.models import Session, Vehicle, answers
from aerodb.flows.web.sessions import check_csrf, keep_session, keep_units, session_of
from aerodb.storage.catalogue import FlightFilter
from aerodb.tasks.actors import user
from aerodb.tasks.result_versions import CANDIDATE, RELEASED
from aerodb.tasks.view import findings_page, flights_document, waiting
from aerodb.tasks.workspace_access import WorkspaceAccess
from aerodb.units import UnitSystem

router = APIRouter()
_NEWEST = 5


@router.get("/", include_in_schema=False)
def overview(request: Request) -> Response:
    """What waits for a decision, vehicles with their released versions, newest findings and
    flights."""
    access = access_of(request)
    vehicles = access.catalogue.vehicles()
    candidates = [row for each in vehicles for row in waiting(access.catalogue, each.name)]
    entries, _ = findings_page(access, _NEWEST)
    rows = access.catalogue.flight_page(FlightFilter(), _NEWEST).rows
    flights = flights_document(access.catalogue, rows)
    return page_of(
        request,
        "overview.html",
        "Overview",
        waiting=candidates,
        vehicles=_vehicles(access),
        findings=entries,
        flights=flights,
    )


@router.get(
    "/api/vehicles",
    summary="Vehicles, and the versions their names point to",
    tags=["vehicles"],
    responses=answers(list[Vehicle]),
)
def vehicles(request: Request) -> Response:
    """Name, file and names of versions of every vehicle."""
    return document(_vehicles(access_of(request)))


@router.get(
    "/api/session",
    summary="The token that a change requires",
    tags=["changes"],
    responses=answers(Session),
)
def session(request: Request) -> Response:
    """The token of this session; its cookie comes with the answer."""
    known, _ = session_of(request)
    answer = document({"csrf": console_of(request).guard.csrf_token(known, user())})
    keep_session(answer, known)
    return answer


@router.post("/units", include_in_schema=False)
async def choose_units(request: Request) -> Response:
    """Keep the units that a user has chosen, and go back to the page."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    units = UnitSystem(fields.get("units", ""))
    back = fields.get("back", "/")
    inside = back.startswith("/") and not back.startswith(("//", "/\\")) and back.isprintable()
    response = RedirectResponse(back if inside else "/", 303)
    keep_units(response, units)
    return response


@router.get("/api", include_in_schema=False)
def contents(request: Request) -> Response:
    """The endpoints of the API for people; programs read /openapi.json."""
    paths: dict[str, dict[str, Any]] = request.app.openapi()["paths"]
    entries = [
        {
            "method": method.upper(),
            "path": path,
            "summary": operation.get("summary", ""),
            "asked": operation.get("parameters", []),
        }
        for path, methods in paths.items()
        for method, operation in methods.items()
    ]
    return page_of(request, "api.html", "API", entries=entries)


def _vehicles(access: WorkspaceAccess) -> list[dict[str, Any]]:
    rows = []
    for row in access.catalogue.vehicles():
        names = access.catalogue.names(row.name)
        versions = access.catalogue.versions_by_id(names.values())
        pointed = {name: {"version": id, "label": versions[id].label} for name, id in names.items()}
        first: dict[str, Any] = {
            name: pointed[name] for name in (RELEASED, CANDIDATE) if name in pointed
        }
        entry: dict[str, Any] = {
            "vehicle": row.name,
            "sha256": row.sha256,
            "added_utc": row.added_utc.isoformat(),
        }
        rows.append(
            {
                **entry,
                "versions": access.catalogue.count_versions(row.name),
                "names": {**first, **pointed},
            }
        )
    return rows
