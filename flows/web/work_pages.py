"""Status page: files that wait, runs in progress, failures and remedies (as `aerodb status`)."""

from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response

from aerodb.flows.web.console import access_of, document, page_of
from aerodb.flows.web.server_paths import for_visitor
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.view import status_of, waiting

router = APIRouter(tags=["work"])


@router.get("/work", include_in_schema=False)
def work_page(request: Request) -> Response:
    """The status page."""
    access = access_of(request)
    status = for_visitor(status_of(access))
    vehicles = access.catalogue.vehicles()
    candidates = [row for each in vehicles for row in waiting(access.catalogue, each.name)]
    server = _server(status)
    has_pages = load_settings(access.workspace.root).serve.ui
    return page_of(
        request,
        "work.html",
        "Status",
        status=status,
        server=server,
        waiting=candidates,
        of_server=server.removesuffix("/api") + "/" if has_pages else f"{server}/admin/version",
    )


@router.get("/api/status", summary="What is waiting, running or failed")
def status(request: Request) -> Response:
    """The document of `aerodb status`."""
    return document(for_visitor(status_of(access_of(request))))


def _server(status: dict[str, Any]) -> str:
    """Return the URL of the Prefect server of `aerodb serve`; empty if it is not running."""
    url = str(status["serve"].get("url", ""))
    return url if status["serve"]["running"] and url.startswith(("http://", "https://")) else ""
