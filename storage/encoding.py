"""Encoding of values as catalogue columns: times, JSON, damage reports, names. No SQL here."""

import json
import re
from collections.abc import Iterable
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.recording import Damage
from aerodb.remarks import Remark
from aerodb.remarks import from_document as remark_from
from aerodb.support import canonical_json

VEHICLE_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")
FLIGHT_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,62}")
FLIGHT_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
VERSION_NAME: Final = re.compile(r"(?!v[0-9]+$)[a-z][a-z0-9_-]{0,62}")  # v0007 is a label
USER_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.@-]{0,62}")
WORD: Final = re.compile(r"[A-Za-z][A-Za-z0-9_.:-]{0,62}")
KEY: Final = re.compile(r"[0-9a-f]{64}")
RUN_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9-]{0,63}")
REFERENCE: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
LABEL: Final = re.compile(r"v([0-9]{1,9})")
#: Resolution of times in the catalogue.
_MOMENT: Final = timedelta(microseconds=1)


def checked(name: str, pattern: re.Pattern[str], what: str) -> str:
    """`name` if it matches `pattern`; otherwise InputError that calls it `what`."""
    if not pattern.fullmatch(name):
        raise InputError(
            f"{shown(name)} is not allowed as {what}", remedy="use letters, digits, '-' and '_'"
        )
    return name


def checked_key(key: str, what: str) -> str:
    """`key` if it is a sha256 in hexadecimal digits; otherwise InputError that calls it `what`."""
    if not KEY.fullmatch(key):
        raise InputError(
            f"{shown(key)} is not {what}", remedy="it must be a sha256: 64 hexadecimal digits"
        )
    return key


def shown(text: str) -> str:
    """`text` for messages: quoted, control characters escaped, at most 60 characters."""
    return ascii(text if len(text) <= 60 else text[:57] + "...")


def plain_text(text: str) -> str:
    """`text` as any database can store it: NUL and characters that UTF-8 cannot encode become
    escape sequences."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("\0", "\\x00")


def to_json(value: Any) -> str:
    """Return `value` as canonical JSON text (RFC 8785); ValueError for nan or infinity."""
    return canonical_json(value).decode("utf-8")


def from_json(text: str) -> Any:
    """Return the value of a JSON text, as `to_json` writes it; raises ValueError for another
    text."""
    return json.loads(text)


def damage_to_json(damage: Iterable[Damage]) -> str:
    """Return damage reports as canonical JSON (RFC 8785), times [s] and sizes [bytes]."""
    return to_json(
        [{**asdict(d), "what": plain_text(d.what), "topic": plain_text(d.topic)} for d in damage]
    )


def damage_from_json(text: str) -> tuple[Damage, ...]:
    """Return damage reports from their JSON, as `damage_to_json` writes it; ValueError for another
    text."""
    return tuple(Damage(**d) for d in json.loads(text))


def remarks_to_json(remarks: Iterable[Remark]) -> str:
    """Return remarks as canonical JSON (RFC 8785), values with their units."""
    plain = (replace(remark, text=plain_text(remark.text)) for remark in remarks)
    return to_json([remark.document() for remark in plain])


def remarks_from_json(text: str) -> tuple[Remark, ...]:
    """Return remarks from their JSON, as `remarks_to_json` writes it; ValueError for another
    text."""
    return tuple(remark_from(each) for each in json.loads(text))


def now() -> datetime:
    """The current time, UTC."""
    return datetime.now(UTC)


def after(*times: datetime | None) -> datetime:
    """The current time, or one microsecond after the latest of `times` if the clock was set back:
    lists ordered by time stay in the order of events.

    >>> after(datetime(9999, 1, 2, tzinfo=UTC)).isoformat()
    '9999-01-02T00:00:00.000001+00:00'
    """
    return max([now(), *(time + _MOMENT for time in times if time is not None)])


def time_text(time: datetime) -> str:
    """UTC with microseconds as text that sorts chronologically; InputError for a naive time.

    >>> time_text(datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))
    '2026-01-02T03:04:05.000000Z'
    """
    if time.tzinfo is None:
        raise InputError(
            f"time {time.isoformat()} has no time zone", remedy="add an offset, or Z for UTC"
        )
    return time.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ").zfill(27)


def time_of(text: str) -> datetime:
    """Return the UTC time (aware) of a stored text (ISO 8601, microseconds); ValueError for another
    text."""
    return datetime.fromisoformat(text)
