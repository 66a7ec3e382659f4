"""The catalogue in a PostgreSQL database, with the same tables, triggers and transactions as in
SQLite.

The catalogue is in the first schema of the connection's search path, so one database can hold
several.
"""

from typing import Any, Final

import sqlalchemy as sa
from sqlalchemy.exc import DatabaseError

from aerodb.errors import InputError
from aerodb.storage.catalogue.database import WAIT_SECONDS, Database, migrate, stored_revision
from aerodb.storage.catalogue.schema import HEAD
from aerodb.storage.urls import shown

_READS: Final = {"isolation_level": "REPEATABLE READ"}
#: With the lock taken, nobody else writes: each statement sees all that was committed before it.
_WRITES: Final = {"isolation_level": "READ COMMITTED", "writing": True}
#: Idle connections that a process keeps open.
_POOL_SIZE: Final = 4
#: Part of the key of the advisory lock, besides the oid of the schema: tells it from the locks of
#: other applications.
_KEY: Final = 0x61657264
_LOCK: Final = (
    f"SELECT pg_advisory_xact_lock(({_KEY}::bigint << 32) | oid::bigint) FROM pg_namespace WHERE"
    " nspname = current_schema()"
)
#: Beginning of the comment that names a workspace.
_OWNER: Final = "aerodb workspace "
#: A server or client that disappears is detected after one minute, which releases the lock.
_SERVER: Final = {
    "lock_timeout": f"{WAIT_SECONDS:.0f}s",
    "tcp_keepalives_idle": "30",
    "tcp_keepalives_interval": "10",
    "tcp_keepalives_count": "3",
}
_CLIENT: Final = {
    "connect_timeout": 10,
    "keepalives_idle": 30,
    "keepalives_interval": 10,
    "keepalives_count": 3,
}


def open_postgresql(url: str, create: bool = True) -> Database:
    """Open the catalogue in the database at `url`, migrated to the newest schema; create it if it
    does not exist and `create`.

    Raises InputError when there is none, or one of a newer version; StoreBusyError while the server
    cannot be reached, StoreError when it refuses the login.
    """
    where = shown(url)
    database = Database(_engine(url), where, _READS, _WRITES)
    try:
        stored = stored_revision(database)
        if stored is None and not create:
            raise InputError(
                "there is no catalogue here",
                where,
                "name an existing workspace, or add a vehicle to create one",
            )
        if stored != HEAD:
            if stored is None:
                _require_usable(database)
            migrate(database)
    except DatabaseError as error:
        database.close()
        raise InputError(
            f"the catalogue cannot be used: {error.orig}", where, "name an empty, separate database"
        ) from None
    except BaseException:
        database.close()
        raise
    database.patience = WAIT_SECONDS  # it answered: a later absence is temporary
    return database


def postgresql_revision(url: str) -> str | None:
    """Return the schema revision of the database at `url`; None if it contains no catalogue,
    StoreBusyError where it cannot be reached."""
    database = Database(_engine(url), shown(url), _READS, _WRITES)
    try:
        return stored_revision(database)
    finally:
        database.close()


def owner_of(connection: sa.Connection) -> tuple[str, str] | None:
    """Return id and folder of the workspace that the catalogue belongs to; None before its first
    run."""
    query = "SELECT obj_description('runs'::regclass, 'pg_class')"
    text = connection.exec_driver_sql(query).scalar()
    id, _, folder = str(text or "").removeprefix(_OWNER).partition(" ")
    return (id, folder) if text and text.startswith(_OWNER) else None


def note_owner(connection: sa.Connection, id: str, folder: str) -> None:
    """Note the workspace that the catalogue belongs to, as a comment on the table of runs: it is no
    part of what a backup copies."""
    text = f"{_OWNER}{id} {folder}".replace("'", "''").replace("%", "%%")
    connection.exec_driver_sql(f"COMMENT ON TABLE runs IS '{text}'")


def _engine(url: str) -> sa.Engine:
    try:
        address = sa.make_url(url).set(drivername="postgresql+psycopg")
    except (sa.exc.ArgumentError, ValueError):  # may quote the address with its password
        raise InputError(
            "not a valid database address", shown(url), "write special characters as %XX"
        ) from None
    given = address.query.get("options", "")
    options = [
        *(f"-c {name}={value}" for name, value in _SERVER.items()),
        *([given] if isinstance(given, str) else given),
    ]
    address = address.update_query_dict({"options": " ".join(options).strip()})
    named = {} if "application_name" in address.query else {"application_name": "aerodb"}
    # Each connection is tested before use, so a broken one is replaced.
    engine = sa.create_engine(
        address,
        connect_args={**_CLIENT, **named},
        pool_size=_POOL_SIZE,
        max_overflow=-1,
        pool_pre_ping=True,
        hide_parameters=True,
    )
    sa.event.listen(engine, "begin", _begin)
    return engine


def _begin(connection: sa.Connection) -> None:
    if connection.get_execution_options().get("writing", False):
        connection.exec_driver_sql(_LOCK)


def _require_usable(database: Database) -> None:
    """Raise InputError for a database in which a catalogue cannot be created, or that cannot store
    every text."""
    with database.reading() as connection:
        encoding: Any = connection.exec_driver_sql("SHOW server_encoding").scalar()
        schema: Any = connection.exec_driver_sql("SELECT current_schema()").scalar()
        others = [] if schema is None else sa.inspect(connection).get_table_names()
    if encoding != "UTF8":
        remedy = "create one with: createdb --encoding UTF8 --template template0 NAME"
        raise InputError(
            f"the encoding of the database is {encoding}, not UTF8", database.where, remedy
        )
    if schema is None:
        raise InputError(
            "no schema of the search path exists", database.where, "create it: CREATE SCHEMA"
        )
    if others:
        what = f"the database already contains other tables ({', '.join(sorted(others)[:3])})"
        raise InputError(what, database.where, "name an empty, separate database")
