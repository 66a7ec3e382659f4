"""Addresses of PostgreSQL databases in settings and messages. Passwords stay in the environment."""

import os
from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import SplitResult, parse_qsl, urlsplit

from aerodb.errors import InputError

_SCHEMES: Final = ("postgresql", "postgres")
_SECRETS: Final = ("password", "passfile", "sslpassword")
_FORM: Final = (
    'write postgresql://USER@HOST:PORT/DATABASE, or "$NAME" with the name of an environment'
    " variable that holds the address"
)


def checked_url(text: Any) -> str:
    """`text` if it is allowed in a file: empty, ``$NAME``, or an address without a password.
    Otherwise InputError, whose message shows nothing of it."""
    if not isinstance(text, str):
        raise InputError("the database address is not text", remedy=_FORM)
    if not text or (text.startswith("$") and text[1:].isidentifier()):
        return text
    parts = _parts(text)
    if parts.password is not None or any(
        name in _SECRETS for name, _ in parse_qsl(parts.query, keep_blank_values=True)
    ):
        remedy = (
            'put the whole address into an environment variable and write "$NAME" here, or use'
            " ~/.pgpass"
        )
        raise InputError(
            "the database address contains a password, which does not belong in a file",
            remedy=remedy,
        )
    return text


def resolved(text: str, where: str, environment: Mapping[str, str] = os.environ) -> str:
    """Return the address that a checked setting refers to, with its password if it has one; empty
    for none. InputError, whose message shows nothing of it, when the variable is not set or is not
    an address (``postgresql://``, RFC 3986)."""
    if not text.startswith("$"):
        return text
    address = environment.get(text[1:], "")
    if not address:
        raise InputError(
            f"the environment variable {text[1:]} is not set",
            where,
            "set it to the address of the database, or change the setting",
        )
    try:
        _parts(address)
    except InputError as error:
        what = f"the environment variable {text[1:]} is not the address of a PostgreSQL database"
        raise InputError(
            what, where, "write it as postgresql://USER:PASSWORD@HOST:PORT/DATABASE"
        ) from error
    return address


def shown(url: str) -> str:
    """Return an address (RFC 3986) for messages: user, host, port and database, without password
    and options. InputError where it is none."""
    parts = _parts(url)
    user = f"{parts.username}@" if parts.username else ""
    port = f":{parts.port}" if parts.port else ""
    return f"postgresql://{user}{parts.hostname or ''}{port}{parts.path}"


def _parts(text: str) -> SplitResult:
    """The parts of an address. InputError for anything else; it quotes neither the text nor the
    parser's message."""
    try:
        parts = urlsplit(text)
        good = (
            parts.scheme in _SCHEMES
            and (parts.port or 1) > 0
            and len(parts.path) > 1
            and "@" not in parts.path
        )
    except ValueError:
        good = False
    if not good:
        raise InputError("not the address of a PostgreSQL database", remedy=_FORM) from None
    return parts
