"""Connections and transactions of the catalogue's database, SQLite or PostgreSQL.

A writing transaction takes one lock at its beginning (SQLite: BEGIN IMMEDIATE, PostgreSQL: an
advisory lock), so a transaction that reads and then writes never fails because of a concurrent one.
Readers see one consistent state and never wait.
"""

import atexit
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError, StoreBusyError
from aerodb.storage.catalogue.chain import ends_of_tables, link
from aerodb.storage.catalogue.former_catalogue import forget_former, keep_former, say_what_happened
from aerodb.storage.catalogue.row_links import Touched
from aerodb.storage.catalogue.schema import HEAD
from aerodb.storage.catalogue.seal import break_seal, seal
from aerodb.storage.database_errors import store_error_of, translated_database_errors

if TYPE_CHECKING:
    from alembic.config import Config

#: Maximum waiting time [s] of writers for the lock, and of all for a server that was up before.
WAIT_SECONDS: Final = 60.0
_LONGEST_PAUSE: Final = 1.0


class Database:
    """An engine with two kinds of transaction: `reading` and `writing`.

    where : address for messages, without secrets. reads, writes : execution options of the two
    kinds. file : of SQLite, which has a seal (`aerodb.storage.catalogue.seal`). `patience` : time
    [s] for which a new connection is retried while the server is down.
    """

    def __init__(
        self,
        engine: sa.Engine,
        where: str,
        reads: dict[str, Any],
        writes: dict[str, Any],
        file: Path | None = None,
    ) -> None:
        self.where = where
        self._readers = engine.execution_options(**reads) if reads else engine
        self._writers = engine.execution_options(**writes)
        self.patience = 0.0
        self.file, self._wrote_in = file, 0
        self._current: ContextVar[sa.Connection | None] = ContextVar("connection", default=None)

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """Give a connection that sees one consistent state; inside `writing`, the connection of
        that transaction. Raises StoreError, or StoreBusyError while it is locked."""
        current = self._current.get()
        if current is not None:
            yield current
            return
        with (
            translated_database_errors(self.where),
            self._connected(self._readers) as connection,
            connection.begin(),
        ):
            yield connection

    @contextmanager
    def writing(self, linked: bool = True) -> Iterator[sa.Connection]:
        """Give an exclusive, atomic write transaction; nested ones are savepoints of the outer one.

        linked : whether new events and rows are linked (`aerodb.storage.catalogue.chain`,
        `row_links`). Raises StoreError (full or read-only disk), or StoreBusyError while another
        writes.
        """
        current = self._current.get()
        if current is not None:
            with current.begin_nested():
                yield current
            return
        with (
            translated_database_errors(self.where),
            self._connected(self._writers) as connection,
            connection.begin(),
        ):
            token = self._current.set(connection)
            try:
                self._break_seal(connection)
                if not linked:
                    yield connection
                    return
                before, touched = ends_of_tables(connection), Touched()
                touched.listen(connection)
                try:
                    yield connection
                finally:
                    touched.forget(connection)
                touched.link(connection)
                link(connection, before)
            finally:
                self._current.reset(token)

    def _break_seal(self, connection: sa.Connection) -> None:
        if self.file is None:
            return
        raw = connection.connection.driver_connection
        assert isinstance(raw, sqlite3.Connection)
        break_seal(self.file, raw)
        if self._wrote_in != os.getpid():
            self._wrote_in = os.getpid()
            atexit.register(self._at_exit)

    def _at_exit(self) -> None:
        """Close what this process wrote; a forked process inherits this call, but no connection."""
        if self._wrote_in == os.getpid():
            self.close()

    def _connected(self, engine: sa.Engine) -> sa.Connection:
        """A new connection; retries while the server restarts, which is safe before the
        transaction begins."""
        until, pause = time.monotonic() + self.patience, 0.05
        while True:
            try:
                return engine.connect()
            except sa.exc.DBAPIError as error:
                if time.monotonic() > until or not isinstance(
                    store_error_of(error, self.where), StoreBusyError
                ):
                    raise
            time.sleep(pause)
            pause = min(2 * pause, _LONGEST_PAUSE)

    def close(self) -> None:
        """Close all connections, and seal SQLite's file if this process wrote to it."""
        self._readers.dispose()
        if self.file is not None and self._wrote_in == os.getpid():
            self._wrote_in = 0
            atexit.unregister(self._at_exit)
            seal(self.file)


def revision_of(connection: sa.Connection) -> str | None:
    """Return the schema revision (`alembic_version`) of a database; None if it contains no
    catalogue, errors of SQLAlchemy as they are."""
    if not sa.inspect(connection).has_table("alembic_version"):
        return None
    return connection.execute(sa.text("SELECT version_num FROM alembic_version")).scalar()


def stored_revision(database: Database) -> str | None:
    """Return the schema revision (`revision_of`), read in a transaction of its own; StoreError
    where it cannot be read."""
    with database.reading() as connection:
        return revision_of(connection)


def migrate(database: Database) -> None:
    """Migrate a database to the newest schema, and keep the former one (`former_catalogue`);
    InputError if its schema is newer than this version."""
    before, kept = None, ""
    try:
        with database.writing(linked=False) as connection:
            before = revision_of(connection)
            if before == HEAD:  # another process was faster
                return
            if before is not None:
                _require_known(before, database.where)
                kept = keep_former(connection, before)
            upgrade(connection)
    except BaseException:
        forget_former(kept)
        raise
    if before is not None:
        say_what_happened(database.where, before, HEAD, kept)


def upgrade(connection: sa.Connection) -> None:
    """Run the migrations that a database does not have yet, in the transaction of `connection`;
    errors of SQLAlchemy as they are, see `migrate`."""
    from alembic import command

    config = _alembic()
    config.attributes["connection"] = connection
    command.upgrade(config, "head")


def _alembic() -> "Config":
    # Imported here: a query on an up-to-date catalogue does not pay for alembic.
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "aerodb.storage:migrations")
    return config


def _require_known(revision: str, where: str) -> None:
    """Raise InputError for a revision that this version does not have."""
    from alembic.script import ScriptDirectory
    from alembic.util import CommandError

    try:
        ScriptDirectory.from_config(_alembic()).get_revision(revision)
    except CommandError as error:
        remedy = "update aerodb, or restore a backup made by this version"
        raise InputError(
            f"the catalogue was written by a newer version of aerodb: {error}", where, remedy
        ) from error
