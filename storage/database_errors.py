"""What a database says when it cannot be used now: what that means, and what to do about it."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from sqlalchemy.exc import DBAPIError

from aerodb.errors import StoreBusyError, StoreError

_AGAIN: Final = "run again: what is stored stays as it is"
_FULL: Final = ("the disk is full", "make room, then run again: what is stored stays readable")
_READ_ONLY: Final = (
    "the catalogue can only be read now: its disk is full or read-only",
    "make room or make it writable, then run again",
)
_LOCKED: Final = (
    "another process holds the catalogue for more than a minute",
    "see what runs, then run again",
)
_AWAY: Final = (
    "the catalogue's database cannot be reached now",
    f"see that the server runs, then {_AGAIN}",
)
_BUSY: Final = ("the catalogue's database is too busy now", f"see what runs there, then {_AGAIN}")
_REFUSED: Final = (
    "the catalogue's database lets nobody in like this",
    "check user, password and pg_hba.conf of the server",
)
_RIGHTS: Final = (
    "may not do this in the catalogue's database",
    "make aerodb's user the owner of the database",
)

#: What SQLite says, and what PostgreSQL's server says while no connection is there yet.
_SAID: Final = (
    ("database or disk is full", _FULL),
    ("readonly", _READ_ONLY),
    ("is locked", _LOCKED),
    (
        "locking protocol",
        (
            (
                "the catalogue cannot be opened now: many open it at once, or its disk is read-only"
                " since a process was ended there"
            ),
            "make the disk writable, then run again: nothing is lost",
        ),
    ),
    (
        "disk i/o error",
        (
            "the disk does not take or give what the catalogue needs",
            "check the disk and its room, then run again",
        ),
    ),
    (
        "unable to open",
        (
            "the catalogue cannot be opened now",
            "check the disk and the rights on its folder, then run again",
        ),
    ),
    ("authentication failed", _REFUSED),
    ("no password supplied", _REFUSED),
    ("no pg_hba.conf entry", _REFUSED),
    ("too many", _BUSY),
    ("remaining connection slots", _BUSY),
)
#: What PostgreSQL says by the beginning of an SQLSTATE: class or whole code.
_STATES: Final = (
    ("53100", _FULL),
    ("53", _BUSY),
    ("25006", _READ_ONLY),
    ("55P03", _LOCKED),
    ("40", _BUSY),
    ("08", _AWAY),
    ("57P", _AWAY),
    ("57014", _BUSY),
    ("28", _REFUSED),
    ("42501", _RIGHTS),
    (
        "58",
        (
            "the catalogue's database reports a fault of its disk",
            "look at the log of the server, then run again",
        ),
    ),
)
#: Those that may pass by themselves.
_PASSING: Final = (
    *("is locked", "locking protocol", "disk i/o error", "too many", "remaining connection slots"),
    *("53", "55P03", "40", "08", "57P", "57014", "58"),
)


@contextmanager
def translated_database_errors(where: str) -> Iterator[None]:
    """Turns what a database says of a disk, a lock or a connection into a StoreError that says what
    to do; anything else passes. `where` holds no password."""
    try:
        yield
    except (DBAPIError, sqlite3.OperationalError) as error:
        raised = store_error_of(error, where)
        if raised is None:
            raise
        raise raised from error


def store_error_of(error: Exception, where: str) -> StoreError | None:
    """What an error of a database means for who uses it; None when it is no fault of disk, lock or
    connection."""
    cause = getattr(error, "orig", None) or error
    state, said = getattr(cause, "sqlstate", None), str(cause)
    known = _STATES if state else _SAID
    for key, (what, remedy) in known:
        if state.startswith(key) if state else _is_operational(cause) and key in said.lower():
            kind = StoreBusyError if key in _PASSING else StoreError
            return kind(what, where, remedy)
    if not state and type(cause).__module__.startswith("psycopg") and _is_operational(cause):
        # Without a connection there is no code, and the words are of any language: they are passed
        # on.
        return StoreBusyError(f"{_AWAY[0]}: {next(iter(said.splitlines()), '')}", where, _AWAY[1])
    return None


def _is_operational(cause: BaseException) -> bool:
    return any(kind.__name__ == "OperationalError" for kind in type(cause).__mro__)
