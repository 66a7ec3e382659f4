"""Access control of the console: host name, tokens and roles, origin of changes, and browser
policies.

Every request carries a token: the console's own, or that of a user of the workspace. Wrong ones are
counted for each address, and no longer checked after a few in a minute.

A page of another site can make a browser send requests to the console. It cannot read the answers
(no CORS), use a name of its own (the Host header must be the console's, against DNS rebinding), or
change anything (a change carries a token that only the console's pages have).
"""

import base64
import binascii
import hashlib
import hmac
import ipaddress
import logging
import os
import re
import secrets
import socket
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeVar
from urllib.parse import urlsplit

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodb.errors import AeroError, InputError
from aerodb.flows.web.access_log import AccessLog
from aerodb.storage.workspace_settings import TOKEN_VARIABLE, ServeSettings, checked_token
from aerodb.tasks.actors import Actor, acting_as, hash_of_token, new_token, system_user, user

COOKIE: Final = "aerodb_session"
HEADER: Final = "x-csrf-token"
#: A change is a reason and a few names.
LARGEST_BODY: Final = 64 << 10
#: Wrong tokens of an address in a minute; further ones are not checked.
MOST_WRONG: Final = 10
_REMEMBERED: Final = 10_000
#: Logs that are received at a time; their bodies are streamed to the disk.
MOST_UPLOADS: Final = 4
_UPLOAD: Final = re.compile(r"/api/vehicles/[^/]+/logs")
_logger: Final = logging.getLogger(__name__)
#: Returns the user whose token has a hash, or None.
UserOf = Callable[[str], Actor | None]
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
    accepted as well. token : that admits to everything (empty: only tokens of users count).
    is_made : whether it was made for this console, and nobody knows it yet. key : signs the tokens
    of changes.
    """

    names: frozenset[str]
    any_address: bool
    token: str
    is_made: bool
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
        """Return whether a presented token is that of this console."""
        return bool(self.token) and hmac.compare_digest(
            presented.encode("utf-8", "replace"), self.token.encode()
        )

    def csrf_token(self, session: str, name: str) -> str:
        """Return the token of changes for a session of the user `name`: no other user's fits."""
        signed = f"{session}\0{name}".encode("utf-8", "replace")
        return hmac.new(self.key, signed, hashlib.sha256).hexdigest()


def guard_of(
    host: str,
    port: int,
    known_as: Iterable[str] = (),
    environment: Mapping[str, str] | None = None,
    has_users: bool = False,
) -> Guard:
    """Return the guard for `host`, with a token of its own if there are neither one of the
    environment nor users; InputError if others can reach it then."""
    serve = ServeSettings(host=host, port=port)
    variables = dict(os.environ if environment is None else environment)
    try:
        has_token = bool(variables.get(TOKEN_VARIABLE)) or not has_users
        token = checked_token(serve, variables) if has_token else ""
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
    is_made = not (token or has_users)
    token = new_token() if is_made else token
    any_address, key = host in ("0.0.0.0", "::"), secrets.token_bytes(32)
    return Guard(frozenset(names - {""}), any_address, token, is_made, key)


def presented_token(header: str) -> str | None:
    """Return the token in an Authorization header: as bearer, or as anyone's password; None if
    there is none."""
    scheme, _, rest = header.partition(" ")
    given = rest.strip(" \t")
    if scheme.lower() == "bearer":
        return given or None
    if scheme.lower() != "basic":
        return None
    try:
        return base64.b64decode(given, validate=True).decode("utf-8").partition(":")[2] or None
    except (binascii.Error, UnicodeDecodeError):
        return None


class Attempts:
    """Wrong tokens of each address. Whoever has presented `MOST_WRONG` of them in a minute waits
    for its end before a further one is checked; tokens that were right before are not held up."""

    def __init__(self) -> None:
        self._wrong: OrderedDict[str, tuple[int, int]] = OrderedDict()
        self._right: OrderedDict[str, None] = OrderedDict()

    def may_try(self, address: str, hashed: str) -> bool:
        """Return whether a token is to be checked."""
        minute, wrong = self._wrong.get(_network(address), (0, 0))
        return hashed in self._right or minute != _minute() or wrong < MOST_WRONG

    def note(self, address: str, hashed: str, is_right: bool) -> None:
        """Note how a check ended."""
        if is_right:
            _remember(self._right, hashed, None)
            return
        self._right.pop(hashed, None)
        network = _network(address)
        minute, wrong = self._wrong.get(network, (0, 0))
        wrong = 1 if minute != _minute() else wrong + 1
        _remember(self._wrong, network, (_minute(), wrong))
        if wrong == MOST_WRONG:
            _logger.warning(
                "%d wrong tokens from %s within a minute: further ones wait", wrong, network
            )


_Value = TypeVar("_Value")


def _remember(where: OrderedDict[str, _Value], name: str, value: _Value) -> None:
    where[name] = value
    where.move_to_end(name)
    if len(where) > _REMEMBERED:
        where.popitem(last=False)


def _minute() -> int:
    return int(time.monotonic() // 60)


def _network(address: str) -> str:
    """Return an address; of IPv6 its network, within which one client has any number of them."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return str(parsed) if parsed.version == 4 else str(ipaddress.ip_network((parsed, 64), False))


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

    def __init__(self, app: ASGIApp, guard: Guard, log: AccessLog, user_of: UserOf) -> None:
        self._app, self._guard, self._log, self._user_of = app, guard, log, user_of
        self._attempts = Attempts()
        self._at_work = self._uploads = 0

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

        address = (scope.get("client") or ("",))[0]
        visitor: Actor | None = None
        refusal: Response | None = None
        try:
            found = await self._admitted(scope, address)
            if isinstance(found, Actor):
                visitor = found
                with acting_as(visitor):
                    refusal = await self._answered(scope, receive, marked)
            else:
                refusal = found
            if refusal is not None:
                await refusal(scope, receive, marked)
        finally:
            self._log.write(
                visitor is not None,
                address=address,
                user=visitor.name if visitor else "",
                role=visitor.role if visitor else "",
                method=scope["method"],
                path=scope["path"],
                status=status,
                seconds=round(time.monotonic() - began, 3),
            )

    async def _answered(self, scope: Scope, receive: Receive, send: Send) -> Response | None:
        """Let the application answer; return the answer instead if the body is too large, or too
        many requests are at work."""
        if is_upload(scope):
            return await self._uploaded(scope, receive, send)
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

    async def _uploaded(self, scope: Scope, receive: Receive, send: Send) -> Response | None:
        """Let the application receive a log, whose body it reads itself; return the answer instead
        if too many are being received."""
        if self._uploads >= MOST_UPLOADS:
            return PlainTextResponse(
                f"aerodb: {MOST_UPLOADS} logs are being received; try again soon\n",
                503,
                {"retry-after": "5"},
            )
        self._uploads += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._uploads -= 1
        return None

    async def _admitted(self, scope: Scope, address: str) -> Actor | Response:
        """Return who sent a request, or the answer to one that is not admitted."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._guard.knows(hosts[0]):
            return PlainTextResponse(
                "aerodb: unknown host name for this console; see aerodb web --known-as\n", 421
            )
        if "transfer-encoding" in headers and "content-length" in headers:
            # A proxy may take the one and this server the other (RFC 9112, 6.3).
            return PlainTextResponse(
                "aerodb: the request states its length twice\n", 400, {"connection": "close"}
            )
        tokens = headers.getlist("authorization")
        visitor = await self._visitor(tokens[0] if len(tokens) == 1 else "", address)
        if not isinstance(visitor, Actor):
            return visitor
        if scope["method"] not in ("GET", "HEAD", "OPTIONS") and not _same_origin(
            headers, hosts[0]
        ):
            return PlainTextResponse(
                "aerodb: changes are accepted only from pages of this console\n", 403
            )
        if not is_upload(scope) and (
            int(length if (length := headers.get("content-length", "0")).isdecimal() else 0)
            > LARGEST_BODY
        ):
            return PlainTextResponse(
                f"aerodb: the request is larger than {LARGEST_BODY} bytes\n", 413
            )
        return visitor

    async def _visitor(self, authorization: str, address: str) -> Actor | Response:
        """Return whose token a request carries, or the answer to one without a right one."""
        ask = {"www-authenticate": 'Basic realm="aerodb", charset="UTF-8"'}
        refusal = PlainTextResponse(
            "aerodb: enter any user name; the password is your token: of aerodb user, of"
            f" ${TOKEN_VARIABLE}, or as aerodb web said when it started\n",
            401,
            ask,
        )
        presented = presented_token(authorization)
        if presented is None:
            return refusal
        hashed = hash_of_token(presented)
        if not self._attempts.may_try(address, hashed):
            return PlainTextResponse(
                "aerodb: too many wrong tokens; try again in a minute\n", 429, {"retry-after": "60"}
            )
        visitor = (
            Actor(f"{system_user()} (token of the console)", "release")
            if self._guard.admits(presented)
            else await run_in_threadpool(self._user_of, hashed)
        )
        self._attempts.note(address, hashed, visitor is not None)
        return visitor or refusal


def is_upload(scope: Mapping[str, Any]) -> bool:
    """Return whether a request brings a log, which may be larger than other bodies."""
    return scope["method"] == "POST" and _UPLOAD.fullmatch(scope["path"]) is not None


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
        given.encode("utf-8", "replace"), guard.csrf_token(session, user()).encode()
    ):
        raise ForbiddenError(
            "the form does not belong to this session",
            "a change",
            "reload its page, then submit it again",
        )
