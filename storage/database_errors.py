"""Translation of database errors (disk, lock, connection) into `StoreError` with a remedy."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from sqlalchemy.exc import DBAPIError

from aerodb.errors import StoreBusyError, StoreError

_AGAIN: Final = "run again: stored data are unchanged"
_FULL: Final = ("the disk is full", "free disk space, then run again: stored data remain readable")
_READ_ONLY: Final = (
    "the catalogue is read-only now: its disk is full or read-only",
    "free disk space or make the disk writable, then run again",
)
_LOCKED: Final = (
    "another process has locked the catalogue for more than a minute",
    "check which processes use it, then run again",
)
_AWAY: Final = (
    "the catalogue database cannot be reached",
    f"check that the server is running, then {_AGAIN}",
)
_BUSY: Final = (
    "the catalogue database is too busy",
    f"check the load of the server, then {_AGAIN}",
)
_REFUSED: Final = (
    "the catalogue database refuses the login",
    "check user, password and pg_hba.conf of the server",
)
_RIGHTS: Final = (
    "no permission for this operation in the catalogue database",
    "make aerodb's user the owner of the database",
)

#: By text of the message: SQLite, and PostgreSQL before a connection exists.
_BY_MESSAGE: Final = (
    ("database or disk is full", _FULL),
    ("readonly", _READ_ONLY),
    ("is locked", _LOCKED),
    (
        "locking protocol",
        (
            (
                "the catalogue cannot be opened: many processes open it at once, or its disk became"
                " read-only while a process was using it"
            ),
            "make the disk writable, then run again: no data are lost",
        ),
    ),
    (
        "disk i/o error",
        (
            "the disk reports an input/output error in the catalogue",
            "check the disk and its free space, then run again",
        ),
    ),
    (
        "unable to open",
        (
            "the catalogue cannot be opened",
            "check the disk and the permissions of its folder, then run again",
        ),
    ),
    ("authentication failed", _REFUSED),
    ("no password supplied", _REFUSED),
    ("no pg_hba.conf entry", _REFUSED),
    ("too many", _BUSY),
    ("remaining connection slots", _BUSY),
)
#: By SQLSTATE of PostgreSQL: class (first two characters) or whole code.
_BY_STATE: Final = (
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
            "the catalogue database reports a disk error",
            "check the log of the server, then run again",
        ),
    ),
)
#: Keys of conditions that may be transient.
_TRANSIENT: Final = (
    *("is locked", "locking protocol", "disk i/o error", "too many", "remaining connection slots"),
    *("53", "55P03", "40", "08", "57P", "57014", "58"),
)


@contextmanager
def translated_database_errors(where: str) -> Iterator[None]:
    """Context manager that raises database errors about disk, lock or connection as StoreError with
    a remedy; other errors pass unchanged. `where` must not contain a password."""
    try:
        yield
    except (DBAPIError, sqlite3.OperationalError) as error:
        raised = store_error_of(error, where)
        if raised is None:
            raise
        raise raised from error


def store_error_of(error: Exception, where: str) -> StoreError | None:
    """Return the StoreError for a database error, a StoreBusyError where it passes; None when it is
    not about disk, lock or connection. By SQLSTATE of PostgreSQL, else by the message of SQLite
    (`_BY_STATE`, `_BY_MESSAGE`)."""
    cause = getattr(error, "orig", None) or error
    state, message = getattr(cause, "sqlstate", None), str(cause)
    known = _BY_STATE if state else _BY_MESSAGE
    for key, (what, remedy) in known:
        if state.startswith(key) if state else _is_operational(cause) and key in message.lower():
            kind = StoreBusyError if key in _TRANSIENT else StoreError
            return kind(what, where, remedy)
    if not state and type(cause).__module__.startswith("psycopg") and _is_operational(cause):
        # Without a connection there is no SQLSTATE, and the message may be in any language: it is
        # quoted.
        return StoreBusyError(
            f"{_AWAY[0]}: {next(iter(message.splitlines()), '')}", where, _AWAY[1]
        )
    return None


def _is_operational(cause: BaseException) -> bool:
    return any(kind.__name__ == "OperationalError" for kind in type(cause).__mro__)
