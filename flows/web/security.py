"""Access control of the console: host name, token, origin of changes, and browser policies.

A page of another site can make a browser send requests to the console. It cannot read the answers
(no CORS), use a name of its own (the Host header must be the console's, against DNS rebinding), or
change anything (a change carries a token that only the console's pages have).
"""

import base64
import binascii
import hashlib
import hmac
import ipaddress
import os
import secrets
import socket
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodb.errors import AeroError, InputError
from aerodb.flows.web.access_log import AccessLog
from aerodb.storage.workspace_settings import TOKEN_VARIABLE, ServeSettings, checked_token

COOKIE: Final = "aerodb_session"
HEADER: Final = "x-csrf-token"
#: A change is a reason and a few names.
LARGEST_BODY: Final = 64 << 10
#: Requests that are answered at a time, waiting for a thread included.
MOST_AT_WORK: Final = 128
_POLICY: Final = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action"
    " 'self'; frame-ancestors 'none'"
)
#: Reports bring their styles and pictures with them, and need nothing else.
REPORT_POLICY: Final = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; frame-ancestors"
    " 'none'"
)
_ALWAYS: Final = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


class ForbiddenError(AeroError, PermissionError):
    """A change that was not sent from a page of this console."""


@dataclass(frozen=True)
class Guard:
    """Rules for access.

    names : host names of the console. any_address : whether any IP address of the machine is
    accepted as well. token : that requests must carry (empty: none). key : signs the tokens of
    changes.
    """

    names: frozenset[str]
    any_address: bool
    token: str
    key: bytes

    def knows(self, host: str) -> bool:
        """Return whether a Host header names this console, whatever its port."""
        name = _name_of(host)
        if name in self.names:
            return True
        try:
            return self.any_address and bool(ipaddress.ip_address(name))
        except ValueError:
            return False

    def admits(self, presented: str) -> bool:
        """Return whether an Authorization header holds the token: as bearer, or as anyone's
        password."""
        if not self.token:
            return True
        scheme, _, rest = presented.partition(" ")
        given = rest.strip()
        if scheme.lower() == "basic":
            try:
                given = base64.b64decode(given, validate=True).decode("utf-8").partition(":")[2]
            except (binascii.Error, UnicodeDecodeError):
                return False
        return scheme.lower() in ("basic", "bearer") and hmac.compare_digest(
            given.encode(), self.token.encode()
        )

    def csrf_token(self, session: str) -> str:
        """Return the token of changes for a session."""
        return hmac.new(self.key, session.encode("utf-8", "replace"), hashlib.sha256).hexdigest()


def guard_of(
    host: str, port: int, known_as: Iterable[str] = (), environment: Mapping[str, str] | None = None
) -> Guard:
    """Return the guard for `host`; InputError if others can reach it and no token is set."""
    serve = ServeSettings(host=host, port=port)
    try:
        token = checked_token(serve, dict(os.environ if environment is None else environment))
    except InputError as error:
        raise InputError(
            error.what, "aerodb web --host", error.remedy.replace("serve.host", "--host")
        ) from error
    names = {
        "localhost",
        "127.0.0.1",
        "::1",
        _name_of(host),
        *(_name_of(name) for name in known_as),
    }
    if not serve.loopback:
        names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
    return Guard(frozenset(names - {""}), host in ("0.0.0.0", "::"), token, secrets.token_bytes(32))


def _name_of(host: str) -> str:
    """Return the name or address in a Host header, without its port; empty if it is invalid."""
    if any(c in host for c in "/@\\ "):
        return ""
    text = f"[{host}]" if host.count(":") > 1 and not host.startswith("[") else host
    try:
        return (urlsplit(f"//{text}").hostname or "").rstrip(".").lower()
    except ValueError:
        return ""


class Secured:
    """Middleware that passes admitted requests only, adds the security headers to every answer,
    and writes the access log."""

    def __init__(self, app: ASGIApp, guard: Guard, log: AccessLog) -> None:
        self._app, self._guard, self._log = app, guard, log
        self._at_work = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        status, began = 0, time.monotonic()

        async def marked(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                for name, value in _ALWAYS.items():
                    headers[name] = value
                headers.setdefault("content-security-policy", _POLICY)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        refusal = self._refusal(scope)
        try:
            if refusal is None:
                refusal = await self._answered(scope, receive, marked)
            if refusal is not None:
                await refusal(scope, receive, marked)
        finally:
            self._log.write(
                refusal is None,
                address=(scope.get("client") or ("",))[0],
                method=scope["method"],
                path=scope["path"],
                status=status,
                seconds=round(time.monotonic() - began, 3),
            )

    async def _answered(self, scope: Scope, receive: Receive, send: Send) -> Response | None:
        """Let the application answer; return the answer instead if the body is too large, or too
        many requests are at work."""
        try:
            body = await _whole_body(receive)
        except _DisconnectedError:
            return None
        if body is None:
            return PlainTextResponse(
                f"aerodb: the request is larger than {LARGEST_BODY} bytes\n", 413
            )
        if self._at_work >= MOST_AT_WORK:
            return PlainTextResponse(
                f"aerodb: {MOST_AT_WORK} requests are being answered; try again soon\n",
                503,
                {"retry-after": "1"},
            )
        self._at_work += 1
        try:
            await self._app(scope, _replayed(body, receive), send)
        finally:
            self._at_work -= 1
        return None

    def _refusal(self, scope: Scope) -> Response | None:
        """Return the answer to a request that is not admitted."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._guard.knows(hosts[0]):
            return PlainTextResponse(
                "aerodb: unknown host name for this console; see aerodb web --known-as\n", 421
            )
        if not self._guard.admits(headers.get("authorization", "")):
            ask = {"www-authenticate": 'Basic realm="aerodb", charset="UTF-8"'}
            return PlainTextResponse(
                f"aerodb: enter any user name; the password is the token, ${TOKEN_VARIABLE}\n",
                401,
                ask,
            )
        if scope["method"] not in ("GET", "HEAD", "OPTIONS") and not _same_origin(
            headers, hosts[0]
        ):
            return PlainTextResponse(
                "aerodb: changes are accepted only from pages of this console\n", 403
            )
        if (
            int(length if (length := headers.get("content-length", "0")).isdecimal() else 0)
            > LARGEST_BODY
        ):
            return PlainTextResponse(
                f"aerodb: the request is larger than {LARGEST_BODY} bytes\n", 413
            )
        return None


def _same_origin(headers: Headers, host: str) -> bool:
    """Return False if the browser says that the request comes from another origin."""
    if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        return False
    origin = headers.get("origin")
    try:
        return origin is None or urlsplit(origin).netloc.lower() == host.lower()
    except ValueError:
        return False


class _DisconnectedError(Exception):
    """The client went away before it had sent its request."""


async def _whole_body(receive: Receive) -> bytes | None:
    """Return the body of a request, however it was sent; None if it is too large."""
    body = b""
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise _DisconnectedError
        body += message.get("body", b"")
        if len(body) > LARGEST_BODY:
            return None
        if not message.get("more_body", False):
            return body


def _replayed(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives the body that was received, then what comes after it."""
    given = False

    async def replayed() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replayed


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
        given.encode("utf-8", "replace"), guard.csrf_token(session).encode()
    ):
        raise ForbiddenError(
            "the form does not belong to this session",
            "a change",
            "reload its page, then submit it again",
        )
