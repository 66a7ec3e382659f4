"""Logs that are dropped onto a page: received into the inbox, and ingested by its rules."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect
from starlette.responses import Response

from aerodb.flows.inbox import sweep_flow
from aerodb.flows.web import models
from aerodb.flows.web.change_pages import Token
from aerodb.flows.web.console import access_of, console_of, document
from aerodb.flows.web.models import CONFLICTS
from aerodb.flows.web.sessions import check_csrf
from aerodb.storage.inbox import Upload, receiving
from aerodb.storage.limits import Limits
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.actors import require_role

router = APIRouter(tags=["changes"])
#: Bytes that are written at a time.
_PART = 1 << 20


@router.post(
    "/api/vehicles/{vehicle}/logs",
    summary="Ingest a log",
    responses=CONFLICTS | {200: {"model": models.Ending}},
)
async def upload(
    request: Request,
    vehicle: str,
    name: Annotated[str, Query(max_length=200, description="The file's name.")],
    token: Token = "",
) -> Response:
    """Receive a log as the body of the request, and ingest it as one that waits in the inbox.

    Answers how it ended: stored, duplicate, quarantined with the reason, or failed.
    """
    check_csrf(request, console_of(request).guard, token)
    limits = await run_in_threadpool(_permitted, request, vehicle)
    workspace = access_of(request).workspace
    size = request.headers.get("content-length", "0")
    with receiving(workspace, vehicle, name, int(size) if size.isdecimal() else 0, limits) as log:
        try:
            await _received(request, log)
        except ClientDisconnect:
            return Response(status_code=400)
        path, sha256 = await run_in_threadpool(log.finish, workspace, vehicle)
    relative = path.relative_to(workspace.inbox).as_posix()
    return document(await run_in_threadpool(_ended, request, vehicle, relative, sha256))


def _permitted(request: Request, vehicle: str) -> Limits:
    """Return the limits of a log; NotAllowedError or UnknownNameError if none may come."""
    access = access_of(request)
    require_role(access.workspace, access.catalogue, "ingest", "ingesting a log")
    access.catalogue.vehicle(vehicle)
    return load_settings(access.workspace.root).limits


async def _received(request: Request, log: Upload) -> None:
    parts = bytearray()
    async for chunk in request.stream():
        parts += chunk
        if len(parts) >= _PART:
            await run_in_threadpool(log.take, bytes(parts))
            parts.clear()
    await run_in_threadpool(log.take, bytes(parts))


def _ended(request: Request, vehicle: str, relative: str, sha256: str) -> dict[str, Any]:
    """Ingest a received log, and return how it ended: here, or in a sweep that was faster."""
    swept = console_of(request).run(sweep_flow, {"vehicle": vehicle, "file": relative})
    for ending in swept["files"]:
        return {**ending, "sha256": sha256}
    events = access_of(request).catalogue.inbox_events(sha256=sha256)
    waiting = [entry["reason"] for entry in swept["waiting"]]
    last = events[0] if events else None
    return {
        "file": relative,
        "vehicle": vehicle,
        "kind": last.kind if last else "waiting",
        "flight": sha256 if last and last.kind in ("stored", "duplicate") else None,
        "reason": last.reason if last else "; ".join(waiting),
        "verdict": None,
        "sha256": sha256,
    }
