"""Logs that are dropped onto a page: received into the inbox and ingested by its rules, or only
looked at."""

import secrets
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect
from starlette.responses import Response

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.web import models
from aerodb.flows.web.change_pages import Token
from aerodb.flows.web.console import access_of, console_of, document, page_of, report
from aerodb.flows.web.models import CONFLICTS, answers
from aerodb.flows.web.sessions import check_csrf
from aerodb.report import script_source
from aerodb.storage.inbox import Upload, receiving
from aerodb.storage.limits import Limits
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.actors import require_role
from aerodb.tasks.view import LogsPage, logs_page

router = APIRouter(tags=["changes"])
#: Bytes that are written at a time.
_PART = 1 << 20
T = TypeVar("T")
#: Pages and drafts of logs that are kept, and the longest page [characters].
_KEPT = 8
_LARGEST_PAGE = 32_000_000


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
    workspace = access_of(request).workspace
    finished = await _with_log(
        request, vehicle, name, token, lambda log: log.finish(workspace, vehicle)
    )
    if finished is None:
        return Response(status_code=400)
    path, sha256 = finished
    relative = path.relative_to(workspace.inbox).as_posix()
    return document(await run_in_threadpool(_ended, request, vehicle, relative, sha256))


@router.get("/logs", include_in_schema=False)
def logs_page_to_drop_on(request: Request) -> Response:
    """The page onto which logs are dropped that are only looked at."""
    return page_of(request, "logs.html", "Look at logs")


@router.post("/api/looked-at/logs", summary="Look at a log", responses=answers(models.LookedAt))
async def look(
    request: Request,
    name: Annotated[str, Query(max_length=200, description="The file's name.")],
    token: Token = "",
) -> Response:
    """Receive a log as the body of the request, and answer the address of its page: plots, track,
    what can be learnt from it, parameters and messages. No vehicle is needed; nothing is stored,
    and the page is kept until a few newer ones have come."""
    page = await made_of_log(request, name, token, _looked_at)
    if page is None:
        return Response(status_code=400)
    key = keep(request.app.state.looked_at, page.html)
    return document({"page": f"/logs/{key}", "log": page.documents[0]})


@router.get("/logs/{key}", include_in_schema=False)
def looked_at(request: Request, key: str) -> Response:
    """The page of a log that was looked at."""
    kept: OrderedDict[str, str] = request.app.state.looked_at
    if key not in kept:
        raise UnknownNameError("this page is no longer kept", "/logs", "drop the log once more")
    return report(request, kept[key], script_source())


def _looked_at(log: Path, root: Path, name: str) -> LogsPage:
    """Return the page of a received log."""
    page = logs_page([log], root, names=[name])
    if len(page.html) > _LARGEST_PAGE:
        raise InputError(f"its page has {len(page.html) / 1e6:.0f} MB", name, "use aerodb log show")
    page.documents[0]["source"] = name
    return page


def permitted(request: Request, vehicle: str | None) -> Limits:
    """Return the limits of a log; NotAllowedError or UnknownNameError if none may come."""
    access = access_of(request)
    require_role(access.workspace, access.catalogue, "ingest", "ingesting a log")
    if vehicle is not None:
        access.catalogue.vehicle(vehicle)
    return load_settings(access.workspace.root).limits


async def made_of_log(
    request: Request, name: str, token: str, make: Callable[[Path, Path, str], T]
) -> T | None:
    """Receive a log as the body of a request, and return what is made of it (its path, the folder
    of the workspace, its name); it is not kept. None where the sender left.

    Errors name the log as its sender does.
    """
    root = access_of(request).workspace.root

    def made(log: Upload) -> T:
        path = log.whole()
        try:
            return make(path, root, name)
        except InputError as error:
            what = error.what.replace(str(path), name)
            raise InputError(what, name, error.remedy.replace(str(path), name)) from error

    return await _with_log(request, None, name, token, made)


async def _with_log(
    request: Request, vehicle: str | None, name: str, token: str, make: Callable[[Upload], T]
) -> T | None:
    """Return what `make` makes of a received log; None where the sender left."""
    check_csrf(request, console_of(request).guard, token)
    limits = await run_in_threadpool(permitted, request, vehicle)
    workspace = access_of(request).workspace
    size = request.headers.get("content-length", "0")
    with receiving(workspace, vehicle, name, int(size) if size.isdecimal() else 0, limits) as log:
        try:
            await _received(request, log)
        except ClientDisconnect:
            return None
        return await run_in_threadpool(make, log)


def keep(kept: OrderedDict[str, T], value: T) -> str:
    """Keep a value until `_KEPT` newer ones have come, and return its key."""
    key = secrets.token_urlsafe(12)
    kept[key] = value
    while len(kept) > _KEPT:
        kept.popitem(last=False)
    return key


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
