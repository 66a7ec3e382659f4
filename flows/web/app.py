"""The application: its routers, static files and error pages; errors read as in the commands."""

from collections import OrderedDict
from pathlib import Path
from typing import Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.responses import Response
from starlette.staticfiles import StaticFiles

from aerodb.errors import (
    AeroError,
    GateRefusal,
    InputError,
    StoreBusyError,
    StoreError,
    UnknownNameError,
)
from aerodb.flows.web import change_pages as changes
from aerodb.flows.web import compare_pages as compare
from aerodb.flows.web import draft_pages as drafts
from aerodb.flows.web import finding_pages as findings
from aerodb.flows.web import flight_pages as flights
from aerodb.flows.web import lineage_pages as lineage
from aerodb.flows.web import overview_page as overview
from aerodb.flows.web import record_pages as records
from aerodb.flows.web import upload_pages as uploads
from aerodb.flows.web import version_pages as versions
from aerodb.flows.web import work_pages as work
from aerodb.flows.web.access_log import AccessLog
from aerodb.flows.web.console import Console, document, page_of
from aerodb.flows.web.guard import Guard
from aerodb.flows.web.models import REFUSALS
from aerodb.flows.web.security import Secured, UserOf
from aerodb.flows.web.server_paths import for_visitor
from aerodb.flows.web.sessions import ForbiddenError, units_of
from aerodb.report import FLAGGED, FLIGHT, MEASURED, UPDATED, render
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import Actor, NotAllowedError
from aerodb.tasks.workspace_access import access_workspace

_STATIC: Final = Path(__file__).parent / "static"
_CACHED: Final = {"cache-control": "max-age=3600"}
_STATUS: Final[tuple[tuple[type[AeroError], int], ...]] = (
    (ForbiddenError, 403),
    (NotAllowedError, 403),
    (UnknownNameError, 404),
    (GateRefusal, 409),
    (InputError, 422),
    (StoreBusyError, 503),
    (StoreError, 503),
)
_SAID: Final = {
    404: "there is no page at this address",
    405: "this address does not accept this method",
}
_DESCRIPTION: Final = (
    "The documents that the commands of aerodb print with --json. The header Link of a list gives"
    " the address of the next page. A change requires the token from GET /api/session in the header"
    " X-CSRF-Token, and its cookie."
)


def create_app(root: Path, guard: Guard) -> FastAPI:
    """Return the console of the workspace folder `root`; InputError if it is not a workspace."""
    workspace = Workspace.open(root, create=False)
    app = FastAPI(
        title="aerodb",
        version="1",
        description=_DESCRIPTION,
        docs_url=None,
        redoc_url=None,
        responses=REFUSALS,
    )
    app.state.console = Console(root.absolute(), guard)
    app.state.looked_at = OrderedDict()
    app.state.drafted = OrderedDict()
    for part in (
        overview,
        flights,
        records,
        versions,
        compare,
        lineage,
        findings,
        work,
        changes,
        uploads,
        drafts,
    ):
        app.include_router(part.router)
    app.add_api_route("/static/report.css", _report_style, include_in_schema=False)
    app.mount("/static", StaticFiles(directory=_STATIC), name="static")
    app.add_exception_handler(AeroError, _refused)
    app.add_exception_handler(HTTPException, _not_there)
    app.add_exception_handler(RequestValidationError, _malformed)
    app.add_middleware(
        Secured,
        guard=guard,
        log=AccessLog(workspace.access_log),
        user_of=_users_of(workspace),
        units_of=lambda scope: units_of(HTTPConnection(scope), root),
    )
    return app


def _users_of(workspace: Workspace) -> UserOf:
    def user_of(hashed: str) -> Actor | None:
        users = access_workspace(str(workspace.root)).catalogue.users()
        return next(
            (Actor(row.name, row.role) for row in users if row.token_sha256 == hashed), None
        )

    return user_of


def _report_style() -> Response:
    """Return the reports' stylesheet, with the colours that have the same meaning everywhere."""
    named = {
        "flight": FLIGHT,
        "measured": MEASURED,
        "flagged": FLAGGED,
        "updated-band": f"{UPDATED}40",
    }
    colours = "".join(f"--{name}: {value}; " for name, value in named.items())
    return Response(
        f"{render('style.css')}\n:root {{ {colours}}}\n", headers=_CACHED, media_type="text/css"
    )


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, AeroError)
    status = next((code for kind, code in _STATUS if isinstance(error, kind)), 500)
    return _said(request, status, error.what, error.where, error.remedy)


async def _not_there(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return _said(
        request,
        error.status_code,
        _SAID.get(error.status_code, str(error.detail)),
        "",
        "see the overview",
    )


async def _malformed(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    where = ".".join(str(step) for step in first["loc"][1:])
    return _said(
        request, 422, str(first["msg"]), where, "see the description of the API for its parameters"
    )


def _said(request: Request, status: int, what: str, where: str, remedy: str) -> Response:
    """Return an error as a page, or as a document if a document was requested; with paths of the
    server for those who may release only."""
    what, where, remedy = (for_visitor(text) for text in (what, where, remedy))
    if request.url.path.startswith("/api/") or request.url.path == "/openapi.json":
        answer = document(
            {"error": {"status": status, "what": what, "where": where, "remedy": remedy}},
            status=status,
        )
    else:
        title = (
            "The gate refused"
            if status == 409
            else "Not found"
            if status == 404
            else "The request failed"
        )
        answer = page_of(request, "error.html", title, what=what, where=where, remedy=remedy)
        answer.status_code = status
    if status == 503:
        answer.headers["retry-after"] = "5"
    return answer
