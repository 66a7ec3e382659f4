"""Bodies of requests: their largest size, and those that are logs."""

import re
from collections.abc import Mapping
from typing import Any, Final

from starlette.types import Message, Receive

#: Largest body of a request that is no log [bytes]: a change is a reason and a few names.
LARGEST_BODY: Final = 64 << 10
_UPLOAD: Final = re.compile(r"/api/(vehicles/[^/]+|looked-at)/logs")


def is_upload(scope: Mapping[str, Any]) -> bool:
    """Return whether a request brings a log, which may be larger than other bodies."""
    return scope["method"] == "POST" and _UPLOAD.fullmatch(scope["path"]) is not None


class DisconnectedError(Exception):
    """The client went away before it had sent its request."""


async def whole_body(receive: Receive) -> bytes | None:
    """Return the body of a request, however it was sent; None if it is too large."""
    body = b""
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise DisconnectedError
        body += message.get("body", b"")
        if len(body) > LARGEST_BODY:
            return None
        if not message.get("more_body", False):
            return body


def replayed_body(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives the body that was received, then what comes after it."""
    given = False

    async def replayed() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replayed
