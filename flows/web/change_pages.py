"""Changes: promote a version and roll back a name, with a page to decide on and the gate's
answer."""

from typing import Annotated, Any, get_args

from fastapi import APIRouter, Header, Request
from pydantic import BaseModel, Field
from starlette.concurrency import run_in_threadpool
from starlette.responses import RedirectResponse, Response

from aerodb.errors import GateRefusal, InputError
from aerodb.flows.release import gate_flow, promote_flow, roll_back_flow
from aerodb.flows.web.bodies import form_of
from aerodb.flows.web.console import (
    Vehicle,
    Word,
    access_of,
    console_of,
    document,
    page_of,
    version_at,
)
from aerodb.flows.web.models import CONFLICTS
from aerodb.flows.web.sessions import check_csrf
from aerodb.report import beyond_data, gate_rows, release_lines
from aerodb.storage.catalogue import NoteKind, standing_moves
from aerodb.tasks.actors import require_role
from aerodb.tasks.references import vehicle_of
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.steps import dismiss, known_responses, note_version
from aerodb.tasks.view import trim_changes

router = APIRouter(tags=["changes"])
Token = Annotated[
    str,
    Header(
        alias="X-CSRF-Token",
        max_length=200,
        description="The token from GET /api/session; send its cookie, too.",
    ),
]
_NOWHERE = "nothing"
#: Prefix of the fields of a form that say what a person accepts.
_ACCEPT = "accept."
_KINDS: dict[str, NoteKind] = {kind: kind for kind in get_args(NoteKind)}


class Promotion(BaseModel):
    """A name to point at a version, and why; `accept`: what the gate refuses and a person
    accepts."""

    reason: str = Field(max_length=2000)
    name: str = Field(default=RELEASED, max_length=63)
    accept: list[Annotated[str, Field(max_length=300)]] = Field(default=[], max_length=100)


class RollBack(BaseModel):
    """A vehicle's name whose last move is to be undone, and why."""

    reason: str = Field(max_length=2000)
    name: str = Field(default=RELEASED, max_length=63)
    vehicle: str | None = Field(default=None, max_length=63)


class Note(BaseModel):
    """A comment on a version, or a tag that it gets or loses."""

    kind: NoteKind
    text: str = Field(max_length=2000)


class Dismissal(BaseModel):
    """Why a failed run needs nothing more."""

    reason: str = Field(max_length=2000)


@router.get("/versions/{version}/promote", include_in_schema=False)
def promotion_page(
    request: Request, version: str, vehicle: Vehicle = None, name: Word = None
) -> Response:
    """Show what to decide on: what changes, the gate with numbers and limits, responses, what is
    open, curves; then ask for the reason."""
    access = access_of(request)
    require_role(access.workspace, access.catalogue, "release", "promoting a version")
    row = version_at(access, version, vehicle)
    moved = access.line_name(name or RELEASED, row.id)
    event = access.catalogue.named(row.vehicle, moved)
    now = access.catalogue.version_of_id(event.version) if event is not None else None
    own = access.line_name(RELEASED, row.id)
    guarded = moved == own and (now is None or now.id != row.id)
    gate = console_of(request).run(gate_flow, {"version": row.id}) if guarded else None
    report = access.catalogue.version_documents(row.id).report
    responses = known_responses(access, row, now.id if now else None)
    trim = trim_changes(access, now, row) if guarded and now else []
    return page_of(
        request,
        "promote.html",
        f"Promote {row.label} of {row.vehicle}",
        row=row,
        name=moved,
        now=now,
        since=event.at_utc.isoformat() if event is not None else None,
        by=event.user if event is not None else "",
        stale=access.catalogue.stale(row.id),
        gate=gate,
        rows=gate_rows(gate["checks"]) if gate else [],
        summary=release_lines(gate, report, responses, trim),
        responses=responses,
        report=report,
        beyond=beyond_data(access.database(now.id), access.database(row.id)) if now else [],
    )


@router.post("/versions/{version}/promote", include_in_schema=False)
async def promote_from_page(request: Request, version: str) -> Response:
    """Move the name, and show the gate's answer."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    return await run_in_threadpool(_promote, request, version, fields)


def _promote(request: Request, version: str, fields: dict[str, str]) -> Response:
    row = version_at(access_of(request), version, None)
    name = fields.get("name", RELEASED)
    _check_seen(request, row.vehicle, name, fields.get("seen"))
    parameters = {
        "version": row.id,
        "name": name,
        "reason": fields.get("reason", ""),
        "accept": [field.removeprefix(_ACCEPT) for field in fields if field.startswith(_ACCEPT)],
    }
    outcome = _moved(request, promote_flow, parameters)
    return _shown(request, f"Promote {row.label} of {row.vehicle}", outcome, f"/versions/{row.id}")


@router.get("/rollback", include_in_schema=False)
def rollback_page(request: Request, vehicle: Vehicle = None, name: Word = None) -> Response:
    """Show where the name would go back to, and ask for the reason."""
    access = access_of(request)
    require_role(access.workspace, access.catalogue, "release", "rolling back a name")
    owner, moved = vehicle_of(access.catalogue, vehicle), name or RELEASED
    standing = standing_moves(access.catalogue.name_history(owner, moved))
    ids = [event.version for event in standing[-2:]]
    rows = access.catalogue.versions_by_id(ids)
    now, back = (rows[ids[-1]] if ids else None), (rows[ids[0]] if len(ids) > 1 else None)
    stale = access.catalogue.stale(back.id) if back else ()
    title = f"Roll back '{moved}' of {owner}"
    return page_of(
        request, "rollback.html", title, vehicle=owner, name=moved, now=now, back=back, stale=stale
    )


@router.post("/rollback", include_in_schema=False)
async def roll_back_from_page(request: Request) -> Response:
    """Move the name back."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    return await run_in_threadpool(_roll_back, request, fields)


def _roll_back(request: Request, fields: dict[str, str]) -> Response:
    owner = vehicle_of(access_of(request).catalogue, fields.get("vehicle"))
    name = fields.get("name", RELEASED)
    _check_seen(request, owner, name, fields.get("seen"))
    outcome = _moved(
        request,
        roll_back_flow,
        {"vehicle": owner, "name": name, "reason": fields.get("reason", "")},
    )
    return _shown(request, f"Roll back '{name}' of {owner}", outcome, f"/history?vehicle={owner}")


@router.post(
    "/api/versions/{version}/promote", summary="Point a name at a version", responses=CONFLICTS
)
def promote(
    request: Request, version: str, promotion: Promotion, vehicle: Vehicle = None, token: Token = ""
) -> Response:
    """The document of `aerodb version promote`; 409 with the reasons if the gate refuses."""
    check_csrf(request, console_of(request).guard, token)
    row = version_at(access_of(request), version, vehicle)
    parameters = {"version": row.id, **promotion.model_dump()}
    return document(console_of(request).run(promote_flow, parameters))


@router.post("/api/rollback", summary="Undo the last move of a name", responses=CONFLICTS)
def roll_back(request: Request, reversal: RollBack, token: Token = "") -> Response:
    """The document of `aerodb version rollback`."""
    check_csrf(request, console_of(request).guard, token)
    owner = vehicle_of(access_of(request).catalogue, reversal.vehicle)
    return document(
        console_of(request).run(
            roll_back_flow, {"vehicle": owner, "name": reversal.name, "reason": reversal.reason}
        )
    )


@router.post("/versions/{version}/notes", include_in_schema=False)
async def note_from_page(request: Request, version: str) -> Response:
    """Add a note, and show the version again."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    kind = _KINDS.get(fields.get("kind", "comment"))
    if kind is None:
        raise InputError("no kind of note", "kind", "comment, tag or untag")
    row = version_at(access_of(request), version, None)
    await run_in_threadpool(note_version, access_of(request), row, kind, fields.get("text", ""))
    return RedirectResponse(f"/versions/{row.id}", 303)


@router.post("/api/versions/{version}/notes", summary="Comment on a version, or tag it")
def note(
    request: Request, version: str, note: Note, vehicle: Vehicle = None, token: Token = ""
) -> Response:
    """The document of `aerodb version comment` and `aerodb version tag`."""
    check_csrf(request, console_of(request).guard, token)
    row = version_at(access_of(request), version, vehicle)
    return document(note_version(access_of(request), row, note.kind, note.text))


@router.post("/work/{run}/dismiss", include_in_schema=False)
async def dismiss_from_page(request: Request, run: str) -> Response:
    """Dismiss a failed run, and show the status again."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    await run_in_threadpool(dismiss, access_of(request), run, fields.get("reason", ""))
    return RedirectResponse("/work", 303)


@router.post("/api/runs/{run}/dismiss", summary="Dismiss a failed run")
def dismiss_run(request: Request, run: str, dismissal: Dismissal, token: Token = "") -> Response:
    """The document of `aerodb dismiss`."""
    check_csrf(request, console_of(request).guard, token)
    return document(dismiss(access_of(request), run, dismissal.reason))


def _check_seen(request: Request, vehicle: str, name: str, shown: str | None) -> None:
    """Raise GateRefusal if a name was moved since its page was shown."""
    event = access_of(request).catalogue.named(vehicle, name)
    if shown != (event.version if event is not None else _NOWHERE):
        what = f"'{name}' was moved after this page was shown"
        raise GateRefusal((what,), f"vehicle {vehicle}", "check its history, then decide again")


def _moved(request: Request, flow: Any, parameters: dict[str, Any]) -> dict[str, Any] | GateRefusal:
    try:
        outcome: dict[str, Any] = console_of(request).run(flow, parameters)
    except GateRefusal as refusal:
        return refusal
    return outcome


def _shown(
    request: Request, title: str, outcome: dict[str, Any] | GateRefusal, back: str
) -> Response:
    if isinstance(outcome, GateRefusal):
        page = page_of(request, "moved.html", title, outcome=None, refusal=outcome, back=back)
        page.status_code = 409
        return page
    return page_of(request, "moved.html", title, outcome=outcome, refusal=None, back=back)
