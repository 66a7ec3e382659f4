"""The catalogue's database, SQLite or PostgreSQL, and its transactions. What is in the tables is
not this module's business.

Writers take one lock at their first word (SQLite: BEGIN IMMEDIATE, PostgreSQL: an advisory lock): a
transaction that reads and then writes can then never fail because another one came between. Readers
see one consistent state and never wait.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError, StoreBusyError
from aerodb.storage.catalogue.schema import HEAD
from aerodb.storage.database_errors import store_error_of, translated_database_errors

#: How long [s] a writer waits for the lock, and everybody for a server that was there before.
WAIT_SECONDS: Final = 60.0
_LONGEST_PAUSE: Final = 1.0


class Database:
    """An engine with two kinds of transaction: `reading` and `writing`.

    where : for people, without secrets. reads, writes : execution options of the two. `patience` :
    how long [s] a new connection is tried for while the server is away.
    """

    def __init__(
        self, engine: sa.Engine, where: str, reads: dict[str, Any], writes: dict[str, Any]
    ) -> None:
        self.where = where
        self._readers = engine.execution_options(**reads) if reads else engine
        self._writers = engine.execution_options(**writes)
        self.patience = 0.0
        self._current: ContextVar[sa.Connection | None] = ContextVar("connection", default=None)

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """A connection with one consistent state; inside `writing` it is that transaction's, and
        sees its rows."""
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
    def writing(self) -> Iterator[sa.Connection]:
        """A transaction that alone may write. All of it happens, or nothing; nested ones are
        savepoints of the outer."""
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
                yield connection
            finally:
                self._current.reset(token)

    def _connected(self, engine: sa.Engine) -> sa.Connection:
        """A connection; a server that is started again is waited for, since nothing has happened
        yet."""
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
        """Gives the connections back; the last one out empties SQLite's write-ahead log into the
        file."""
        self._readers.dispose()


def revision_of(connection: sa.Connection) -> str | None:
    """The schema's revision that a database is at; None while it holds no catalogue."""
    if not sa.inspect(connection).has_table("alembic_version"):
        return None
    return connection.execute(sa.text("SELECT version_num FROM alembic_version")).scalar()


def stored_revision(database: Database) -> str | None:
    """The same in a transaction of its own."""
    with database.reading() as connection:
        return revision_of(connection)


def migrate(database: Database) -> None:
    """Brings a database to the newest schema; InputError for one of a newer kind."""
    # Imported here: a query on an up-to-date catalogue does not pay for alembic.
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config()
    config.set_main_option("script_location", "aerodb.storage:migrations")
    with database.writing() as connection:
        if revision_of(connection) == HEAD:  # another process was faster
            return
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            remedy = "update aerodb, or restore a backup that this one made"
            raise InputError(
                f"the catalogue is of a newer kind: {error}", database.where, remedy
            ) from error
