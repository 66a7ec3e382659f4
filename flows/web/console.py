"""What every page needs: access to the workspace, answers as page or document, and links."""

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import quote, urlencode

import jinja2
from fastapi import Query, Request
from pydantic import BeforeValidator, Field
from starlette.responses import Response, StreamingResponse

from aerodb.flows.run import run_flow
from aerodb.flows.web.guard import Guard
from aerodb.flows.web.security import REPORT_POLICY
from aerodb.flows.web.sessions import keep_session, session_of
from aerodb.report import channel_scale, for_people, page, reasons_in_units, visible
from aerodb.storage.catalogue import USER_ROLES, VersionRow
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import acts_as, user
from aerodb.tasks.references import version_of
from aerodb.tasks.view import as_json, step_words
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.units import UNIT_SYSTEMS, UnitSystem

#: Entries of a page of a list.
PER_PAGE: Final = 50
_LONGEST: Final = 300
#: Characters of a page that are sent at once while the rest is drawn.
_PARCEL: Final = 4096
#: Characters that a query may have as they are (RFC 3986), and what escapes the others.
_OF_QUERIES: Final = "%/?:@!$&'()*+,;=-._~"


def given(text: object) -> object:
    """Return None for a form field that was left empty."""
    return None if text == "" else text


#: What people and programs ask for, in the address. The bounds hold for words, and a field left
#: empty is none.
_Name = Annotated[str, Field(max_length=_LONGEST)]
Word = Annotated[_Name | None, BeforeValidator(given), Query()]
Point = Annotated[
    str,
    Query(
        max_length=2000,
        description="NAME=VALUE,... with units or in SI; inputs not given are zero.",
    ),
]
Vehicle = Annotated[
    _Name | None,
    BeforeValidator(given),
    Query(description="The vehicle; optional if there is only one."),
]
AsOf = Annotated[
    _Name | None,
    BeforeValidator(given),
    Query(description="As it was at this date (ISO 8601, UTC)."),
]
Limit = Annotated[int, Query(ge=1, le=500, description="Largest number of entries.")]


@dataclass(frozen=True)
class Console:
    """The workspace folder that is shown, and who may use it."""

    root: Path
    guard: Guard

    def access(self) -> WorkspaceAccess:
        """Access to the workspace."""
        return access_workspace(str(self.root))

    def run(self, body: Any, parameters: dict[str, Any]) -> Any:
        """Run a flow like the command line with ``--direct``: same steps, recorded in the
        catalogue."""
        workspace = Workspace.open(self.root, create=False)
        return run_flow(body, parameters, workspace, "direct", attended=True)


def console_of(request: Request) -> Console:
    """Return the console that answers a request."""
    console: Console = request.app.state.console
    return console


def access_of(request: Request) -> WorkspaceAccess:
    """Return the access to the workspace of a request."""
    return console_of(request).access()


def version_at(
    access: WorkspaceAccess, reference: str, vehicle: str | None, as_of: str | None = None
) -> VersionRow:
    """Return the version: a full id of any vehicle, or a reference as the commands take it."""
    if as_of is None and vehicle is None:
        row = access.catalogue.versions_by_id([reference]).get(reference)
        if row is not None:
            return row
    return version_of(access.catalogue, reference, vehicle, as_of)


def document(content: Any, further: str = "", status: int = 200) -> Response:
    """Return a document as JSON; further : address of the next page of a list (RFC 8288)."""
    headers = {"link": f'<{further}>; rel="next"'} if further else {}
    return Response(as_json(content), status, headers, "application/json")


def page_of(request: Request, template: str, title: str, **context: Any) -> Response:
    """Return a page from a template, with a session whose token changes can carry."""
    session, is_new = session_of(request)
    context["csrf"] = console_of(request).guard.csrf_token(session, user())
    context["here"] = request.url.path
    asked = quote(request.url.query, safe=_OF_QUERIES)
    again = quote(request.url.path, errors="replace") + (asked and f"?{asked}")
    context["again"] = again if request.method == "GET" else "/"
    context["may"] = {role: acts_as(role) for role in USER_ROLES}
    text = _engine().get_template(template).render(title=title, **context)
    response = Response(text.encode("utf-8", "replace"), media_type="text/html; charset=utf-8")
    if is_new:
        keep_session(response, session)
    return response


def report(request: Request, text: str | Iterator[str], more_policy: str = "") -> Response:
    """Return a report as a self-contained page, with the folder of the workspace for those who may
    release only; text : of the page, or its pieces, which are sent while it is drawn. more_policy :
    a directive of its own, for its script."""
    policy = f"{REPORT_POLICY}; {more_policy}" if more_policy else REPORT_POLICY
    headers = {"content-security-policy": policy}
    root = console_of(request).root
    told = str(root) if acts_as("release") else root.name
    sent = (piece.replace(str(root), told) for piece in ([text] if isinstance(text, str) else text))
    if isinstance(text, str):
        return Response(_encoded(sent), 200, headers, "text/html; charset=utf-8")
    return StreamingResponse(_parcels(sent), 200, headers, "text/html; charset=utf-8")


def _encoded(pieces: Iterable[str]) -> bytes:
    return "".join(pieces).encode("utf-8", "replace")


def _parcels(pieces: Iterable[str]) -> Iterator[bytes]:
    """Pieces of a page in parcels that are worth sending."""
    waiting, size = list[str](), 0
    for piece in pieces:
        waiting.append(piece)
        size += len(piece)
        if size >= _PARCEL:
            yield _encoded(waiting)
            waiting, size = [], 0
    yield _encoded(waiting)


def address(path: str, **asked: Any) -> str:
    """Return a path with a query; parameters that are None are left out.

    >>> address("/flights", vehicle="a b", after=None)
    '/flights?vehicle=a+b'
    """
    chosen = {name: value for name, value in asked.items() if value not in (None, "")}
    return f"{path}?{urlencode(chosen, errors='replace')}" if chosen else path


def part(text: object) -> str:
    """Return any text as one segment of a path."""
    return quote(str(text), safe="", errors="replace")


def shortened(text: object, most: int = 120) -> str:
    """Return text cut to `most` characters for a table; the full text is on the linked page."""
    shown = visible(str(text).replace("\n", "; "))
    return shown if len(shown) <= most else f"{shown[: most - 1]}…"


def in_units(value: float | None, unit: str) -> float | None:
    """Return a value in the unit that is shown to people."""
    return None if value is None else value * for_people(unit)[0]


def moment(text: str | None) -> str:
    """Return a time of a document for people."""
    return "–" if not text else f"{text[:16].replace('T', ' ')} UTC"


@functools.cache
def _engine() -> jinja2.Environment:
    engine = page.engine_of("aerodb.flows.web", "aerodb.report")
    engine.filters |= {
        "part": part,
        "reasons_in_units": reasons_in_units,
        "shortened": shortened,
        "moment": moment,
        "step_words": step_words,
    }
    engine.globals |= {
        "address": address,
        "channel_scale": channel_scale,
        "unit_of": lambda unit: for_people(unit)[1],
        "in_units": in_units,
        "sections": SECTIONS,
        "unit_systems": [UnitSystem(name) for name in UNIT_SYSTEMS],
    }
    return engine


#: The parts of the console, as the menu names them.
SECTIONS: Final[Mapping[str, str]] = {
    "/": "Overview",
    "/flights": "Flights",
    "/logs": "Logs",
    "/versions": "Versions",
    "/findings": "Findings",
    "/history": "History",
    "/work": "Status",
    "/api": "API",
}
