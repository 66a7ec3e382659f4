"""Access control of the console: host name, tokens and roles, origin of changes, and browser
policies.

Every request carries a token: the console's own, or that of a user of the workspace. Wrong ones are
counted for each address, and no longer checked after a few in a minute.

A page of another site can make a browser send requests to the console. It cannot read the answers
(no CORS), use a name of its own (the Host header must be the console's, against DNS rebinding), or
change anything (a change carries a token that only the console's pages have).

`guard` holds the names and the console's own token, `tokens` what is presented, `bodies` what may
be sent, `sessions` the tokens of changes; here they meet.
"""

import time
from collections.abc import Callable
from typing import Final
from urllib.parse import urlsplit

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodb.flows.web.access_log import AccessLog
from aerodb.flows.web.bodies import (
    LARGEST_BODY,
    DisconnectedError,
    is_upload,
    replayed_body,
    whole_body,
)
from aerodb.flows.web.guard import Guard
from aerodb.flows.web.tokens import Attempts, presented_token
from aerodb.storage.workspace_settings import TOKEN_VARIABLE
from aerodb.tasks.actors import Actor, acting_as, hash_of_token, system_user
from aerodb.units import UnitSystem, shown_in

#: Logs that are received at a time; their bodies are streamed to the disk.
MOST_UPLOADS: Final = 4
#: Returns the user whose token has a hash, or None.
UserOf = Callable[[str], Actor | None]
#: Returns the units in which whoever sent a request is shown quantities.
UnitsOf = Callable[[Scope], UnitSystem]
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


class Secured:
    """Middleware that passes admitted requests only, adds the security headers to every answer,
    and writes the access log."""

    def __init__(
        self, app: ASGIApp, guard: Guard, log: AccessLog, user_of: UserOf, units_of: UnitsOf
    ) -> None:
        self._app, self._guard, self._log, self._user_of = app, guard, log, user_of
        self._units_of = units_of
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
                with acting_as(visitor), shown_in(self._units_of(scope)):
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
            body = await whole_body(receive)
        except DisconnectedError:
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
            await self._app(scope, replayed_body(body, receive), send)
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


def _same_origin(headers: Headers, host: str) -> bool:
    """Return False if the browser says that the request comes from another origin."""
    if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        return False
    origin = headers.get("origin")
    try:
        return origin is None or urlsplit(origin).netloc.lower() == host.lower()
    except ValueError:
        return False
