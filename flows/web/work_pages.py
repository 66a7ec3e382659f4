"""Status page: files that wait, runs in progress, failures and remedies (as `aerodb status`)."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response

from aerodb.flows.web.console import access_of, document, page_of
from aerodb.tasks.view import status_of

router = APIRouter(tags=["work"])


@router.get("/work", include_in_schema=False)
def work_page(request: Request) -> Response:
    """The status page."""
    status = status_of(access_of(request))
    return page_of(
        request,
        "work.html",
        "Status",
        status=status,
        server=_server(status),
        reason_of=_reason_of,
    )


@router.get("/api/status", summary="What is waiting, running or failed")
def status(request: Request) -> Response:
    """The document of `aerodb status`."""
    return document(status_of(access_of(request)))


def _reason_of(entry: Mapping[str, Any]) -> str:
    """Return why a log is in quarantine, without the path in the inbox where it no longer is.

    >>> _reason_of({"name": "a.csv", "reason": "/w/inbox/glider/a.csv: no column contains numbers"})
    'no column contains numbers'
    """
    where, name, rest = entry["reason"].partition(f"{entry['name']}: ")
    return rest if name and where.endswith(("/", "\\")) else str(entry["reason"])


def _server(status: dict[str, Any]) -> str:
    """Return the URL of the Prefect server of `aerodb serve`; empty if it is not running."""
    url = str(status["serve"].get("url", ""))
    return url if status["serve"]["running"] and url.startswith(("http://", "https://")) else ""
