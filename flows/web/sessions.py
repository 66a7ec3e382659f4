"""Sessions of browsers, and the tokens of changes: another site's page has none."""

import hmac
import secrets
from typing import Any, Final

from starlette.requests import HTTPConnection
from starlette.responses import Response

from aerodb.errors import AeroError
from aerodb.flows.web.guard import Guard
from aerodb.tasks.actors import user

COOKIE: Final = "aerodb_session"


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
