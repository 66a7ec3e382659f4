"""The catalogue in a file: SQLite, opened so that writers wait for each other and a full disk does
not keep readers out."""

import sqlite3
import time
from pathlib import Path
from typing import Any, Final

import sqlalchemy as sa
from sqlalchemy.exc import DatabaseError

from aerodb.errors import InputError, StoreError
from aerodb.storage.catalogue.database import WAIT_SECONDS, Database, migrate, stored_revision
from aerodb.storage.catalogue.schema import HEAD

_WRITES: Final = {"writing": True}


def open_sqlite(path: Path, create: bool = True) -> Database:
    """The database at `path`, at the newest schema; made when absent and `create`.

    On a disk that is full or read-only, where SQLite cannot make the files that writers and readers
    share, it can be read all the same. Raises InputError when it is absent, not a catalogue, or
    made by a newer version of this product; StoreError when the disk does not allow to open it.
    """
    if not create and not path.is_file():
        raise InputError(
            "no catalogue here",
            str(path),
            "name an existing workspace, or add a vehicle to begin one",
        )
    if not path.parent.is_dir():
        raise InputError(
            "the folder does not exist", str(path.parent), "make it, or name another workspace"
        )
    database = _database(sa.URL.create("sqlite", database=str(path)), path)
    try:
        try:
            stored = stored_revision(database)
        except StoreError:
            database.close()
            if not _is_settled(path):
                raise
            # Nobody can write there now, so that nothing changes while it is read.
            unchanging = {"immutable": "1", "uri": "true"}
            database = _database(
                sa.URL.create("sqlite", database=path.absolute().as_uri(), query=unchanging), path
            )
            stored = stored_revision(database)
        if stored != HEAD:
            migrate(database)
    except DatabaseError as error:
        database.close()
        raise InputError(
            f"not a usable catalogue: {error.orig}", str(path), "restore it from a backup"
        ) from error
    except BaseException:
        database.close()
        raise
    return database


def _database(url: sa.URL, path: Path) -> Database:
    # Without a limit: as many connections as there are threads that work at once, which somebody
    # else limits.
    engine = sa.create_engine(url, connect_args={"isolation_level": None}, pool_size=0)
    sa.event.listen(engine, "connect", _prepare)
    sa.event.listen(engine, "begin", _begin)
    return Database(engine, str(path), {}, _WRITES)


def _is_settled(path: Path) -> bool:
    """Whether all that was written stands in the file itself, none of it in a write-ahead log
    beside it."""
    log = path.with_name(f"{path.name}-wal")
    return (
        path.is_file()
        and path.stat().st_size > 0
        and not (log.is_file() and log.stat().st_size > 0)
    )


def _prepare(connection: sqlite3.Connection, _record: Any) -> None:
    for pragma in (
        f"busy_timeout = {int(WAIT_SECONDS * 1000)}",
        "foreign_keys = ON",
        "synchronous = FULL",
    ):
        connection.execute(f"PRAGMA {pragma}")
    # SQLite does not wait (busy_timeout) for the change to WAL, which two first openers may both
    # attempt.
    until = time.monotonic() + WAIT_SECONDS
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL").fetchone()
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > until:
                raise
            time.sleep(0.01)


def _begin(connection: sa.Connection) -> None:
    writing = connection.get_execution_options().get("writing", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")
