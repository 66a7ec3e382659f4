"""Bodies of requests: their largest size, and those that are logs."""

import re
from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.types import Message, Receive

from aerodb.errors import InputError

#: Largest body of a request that is no log [bytes]: a change is a reason and a few names.
LARGEST_BODY: Final = 64 << 10
#: Most fields of a form: a version seldom has more than a few reasons to accept.
MOST_FIELDS: Final = 200
_UPLOAD: Final = re.compile(r"/api/(vehicles/[^/]+|looked-at|drafted)/logs")


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


async def form_of(request: Request) -> dict[str, str]:
    """Return the fields of a posted form; InputError for another kind of body."""
    if (
        request.headers.get("content-type", "").partition(";")[0].strip()
        != "application/x-www-form-urlencoded"
    ):
        raise InputError("not a form", "a change", "submit it from its page")
    text = (await request.body()).decode("utf-8", "replace")
    try:
        fields = parse_qs(text, keep_blank_values=True, max_num_fields=MOST_FIELDS)
        return {name: values[-1] for name, values in fields.items()}
    except ValueError as error:
        raise InputError(f"not a form: {error}", "a change", "submit it from its page") from error
