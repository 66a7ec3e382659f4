"""Sessions of browsers, and the tokens of changes: another site's page has none."""

import hmac
import secrets
from pathlib import Path
from typing import Any, Final

from starlette.requests import HTTPConnection
from starlette.responses import Response

from aerodb.errors import AeroError
from aerodb.flows.web.guard import Guard
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.actors import user
from aerodb.units import SI, UNIT_SYSTEMS, UnitSystem

COOKIE: Final = "aerodb_session"
_UNITS_COOKIE: Final = "aerodb_units"
_YEAR: Final = 365 * 86_400  # s


class ForbiddenError(AeroError, PermissionError):
    """A change that was not sent from a page of this console."""


def session_of(request: HTTPConnection) -> tuple[str, bool]:
    """Return the session of a browser, or a new one, and whether it is new."""
    presented = request.cookies.get(COOKIE, "")
    known = len(presented) == 64 and presented.isalnum() and presented.isascii()
    return (presented, False) if known else (secrets.token_hex(32), True)


def keep_session(response: Response, session: str) -> None:
    """Set the session's cookie, which no script can read."""
    response.set_cookie(COOKIE, session, httponly=True, samesite="strict", path="/")


def units_of(request: HTTPConnection, root: Path) -> UnitSystem:
    """Return the units in which whoever sent a request is shown quantities: as chosen on a page,
    else by the settings of the workspace folder `root`."""
    chosen = request.cookies.get(_UNITS_COOKIE, "")
    if chosen in UNIT_SYSTEMS:
        return UnitSystem(chosen)
    try:
        return UnitSystem(load_settings(root).show.units)
    except AeroError:  # a page is shown all the same: Status says what is wrong
        return SI


def keep_units(response: Response, units: UnitSystem) -> None:
    """Set the cookie of the units that a user has chosen for a year."""
    response.set_cookie(
        _UNITS_COOKIE, units.name, _YEAR, httponly=True, samesite="strict", path="/"
    )


def check_csrf(request: HTTPConnection, guard: Guard, presented: Any) -> None:
    """Raise ForbiddenError unless a change carries the token of its session."""
    session, is_new = session_of(request)
    given = presented if isinstance(presented, str) else ""
    if is_new or not hmac.compare_digest(
        given.encode("utf-8", "replace"), guard.csrf_token(session, user()).encode()
    ):
        raise ForbiddenError(
            "the form does not belong to this session",
            "a change",
            "reload its page, then submit it again",
        )
