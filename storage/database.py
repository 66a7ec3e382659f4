"""Opening the catalogue's database, and its transactions. What is in the tables is not this module's business.

Writers take SQLite's write lock at their first word (BEGIN IMMEDIATE): a transaction that reads and then writes can
then never fail because another one came between. Readers see one consistent state and never wait.
"""

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final

import sqlalchemy as sa
from sqlalchemy.exc import DatabaseError

from aerodb.errors import InputError
from storage.schema import HEAD

_WAIT_SECONDS: Final = 60.0


class Database:
    """An engine with two kinds of transaction: `reading` and `writing`."""

    def __init__(self, engine: sa.Engine) -> None:
        self._readers = engine
        self._writers = engine.execution_options(writing=True)
        self._current: ContextVar[sa.Connection | None] = ContextVar("connection", default=None)

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """A connection with one consistent state; inside `writing` it is that transaction's, and sees its rows."""
        current = self._current.get()
        if current is not None:
            yield current
            return
        with self._readers.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[sa.Connection]:
        """A transaction that alone may write. All of it happens, or nothing; nested ones are savepoints of the outer."""
        current = self._current.get()
        if current is not None:
            with current.begin_nested():
                yield current
            return
        with self._writers.begin() as connection:
            token = self._current.set(connection)
            try:
                yield connection
            finally:
                self._current.reset(token)

    def close(self) -> None:
        """Gives the connections back; the last one out empties the write-ahead log into the file."""
        self._readers.dispose()


def open_sqlite(path: Path, create: bool = True) -> Database:
    """The database at `path`, at the newest schema; made when absent and `create`.

    Raises InputError when it is absent, not a catalogue, or made by a newer version of this product.
    """
    if not create and not path.is_file():
        raise InputError("no catalogue here", str(path), "name an existing workspace, or add a vehicle to begin one")
    if not path.parent.is_dir():
        raise InputError("the folder does not exist", str(path.parent), "make it, or name another workspace")
    engine = sa.create_engine(sa.URL.create("sqlite", database=str(path)), connect_args={"isolation_level": None})
    sa.event.listen(engine, "connect", _prepare)
    sa.event.listen(engine, "begin", _begin)
    database = Database(engine)
    try:
        with database.reading() as connection:
            stored = _revision(connection)
        if stored != HEAD:
            _migrate(database, path)
    except DatabaseError as error:
        database.close()
        raise InputError(f"not a usable catalogue: {error.orig}", str(path), "restore it from a backup") from error
    except BaseException:
        database.close()
        raise
    return database


def _prepare(connection: sqlite3.Connection, _record: Any) -> None:
    for pragma in (f"busy_timeout = {int(_WAIT_SECONDS * 1000)}", "foreign_keys = ON", "synchronous = FULL"):
        connection.execute(f"PRAGMA {pragma}")
    # SQLite does not wait (busy_timeout) for the change to WAL, which two first openers may both attempt.
    until = time.monotonic() + _WAIT_SECONDS
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


def _revision(connection: sa.Connection) -> str | None:
    if not sa.inspect(connection).has_table("alembic_version"):
        return None
    return connection.execute(sa.text("SELECT version_num FROM alembic_version")).scalar()


def _migrate(database: Database, path: Path) -> None:
    # Imported here: a query on an up-to-date catalogue does not pay for alembic.
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config()
    config.set_main_option("script_location", "storage:migrations")
    with database.writing() as connection:
        if _revision(connection) == HEAD:  # another process was faster
            return
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            remedy = "update aerodb, or restore a backup that this one made"
            raise InputError(f"the catalogue is of a newer kind: {error}", str(path), remedy) from error
