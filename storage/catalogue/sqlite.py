"""The catalogue in an SQLite file. Writers wait for each other; it can be read even when the disk
is full or read-only."""

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
    """Open the database at `path`, migrated to the newest schema; create it if it does not exist
    and `create`.

    On a full or read-only disk, where SQLite cannot create its shared files, the database is opened
    as immutable. Raises InputError when it does not exist, is not a catalogue, or was written by a
    newer version; StoreError when the disk does not allow opening it.
    """
    if not create and not path.is_file():
        raise InputError(
            "there is no catalogue here",
            str(path),
            "name an existing workspace, or add a vehicle to create one",
        )
    if not path.parent.is_dir():
        raise InputError(
            "the folder does not exist", str(path.parent), "create it, or name another workspace"
        )
    database = _database(sa.URL.create("sqlite", database=str(path)), path)
    try:
        try:
            stored = stored_revision(database)
        except StoreError:
            database.close()
            if not _is_settled(path):
                raise
            # Nothing can be written there now, so the file does not change while it is read.
            unchanging = {"immutable": "1", "uri": "true"}
            database = _database(
                sa.URL.create("sqlite", database=path.absolute().as_uri(), query=unchanging), path
            )
            stored = stored_revision(database)
        if stored != HEAD:
            migrate(database)
    except (DatabaseError, UnicodeDecodeError) as error:  # the latter: a damaged error message
        database.close()
        what = getattr(error, "orig", error)
        raise InputError(
            f"the catalogue cannot be used: {what}", str(path), "restore it from a backup"
        ) from error
    except BaseException:
        database.close()
        raise
    return database


def connected_to_read(path: Path) -> sqlite3.Connection:
    """Connect to the database at `path` without writing to it, also where its disk is full or
    read-only. Raises sqlite3.OperationalError where it cannot be opened."""
    address = f"{path.absolute().as_uri()}?mode=ro"
    connection = sqlite3.connect(address, uri=True)
    try:
        connection.execute("PRAGMA schema_version").fetchone()
    except sqlite3.OperationalError:  # SQLite cannot create its shared files
        connection.close()
        if not _is_settled(path):
            raise
        # Nothing can be written there now, so the file does not change while it is read.
        connection = sqlite3.connect(f"{address}&immutable=1", uri=True)
    return connection


def sqlite_revision(path: Path) -> str | None:
    """Return the schema revision of the database at `path`; None if it contains no catalogue,
    StoreError where it cannot be read."""
    database = _database(sa.URL.create("sqlite", database=str(path)), path)
    try:
        return stored_revision(database)
    finally:
        database.close()


def _database(url: sa.URL, path: Path) -> Database:
    # No limit: one connection per working thread, and the number of threads is limited elsewhere.
    engine = sa.create_engine(url, connect_args={"isolation_level": None}, pool_size=0)
    sa.event.listen(engine, "connect", _prepare)
    sa.event.listen(engine, "begin", _begin)
    return Database(engine, str(path), {}, _WRITES, path)


def _is_settled(path: Path) -> bool:
    """Return whether the file is complete, without a write-ahead log next to it."""
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
