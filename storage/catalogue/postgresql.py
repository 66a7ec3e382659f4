"""The catalogue in a PostgreSQL database: the same tables, triggers and transactions as in SQLite's
file.

One catalogue stands in the first schema of the connection's search path, so that a database may
hold several.
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
#: Connections of a process that stay open while nobody uses them.
_KEPT: Final = 4
#: Beside the schema's own number in the key of the lock: nobody else's locks in the same database
#: are ours.
_KEY: Final = 0x61657264
_LOCK: Final = (
    f"SELECT pg_advisory_xact_lock(({_KEY}::bigint << 32) | oid::bigint) FROM pg_namespace WHERE"
    " nspname = current_schema()"
)
#: A server or a client that is gone without a word is noticed after a minute, and lets go of the
#: lock.
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
    """The catalogue in the database at `url`, at the newest schema; made when absent and `create`.

    Raises InputError when there is none, or one of a newer kind; StoreBusyError while the server is
    out of reach, StoreError when it lets nobody in.
    """
    where = shown(url)
    database = Database(_engine(url), where, _READS, _WRITES)
    try:
        stored = stored_revision(database)
        if stored is None and not create:
            raise InputError(
                "no catalogue here",
                where,
                "name an existing workspace, or add a vehicle to begin one",
            )
        if stored != HEAD:
            if stored is None:
                _require_usable(database)
            migrate(database)
    except DatabaseError as error:
        database.close()
        raise InputError(
            f"not a usable catalogue: {error.orig}", where, "name an empty database of its own"
        ) from None
    except BaseException:
        database.close()
        raise
    database.patience = WAIT_SECONDS  # it answered: from now on its absence is for a while
    return database


def _engine(url: str) -> sa.Engine:
    try:
        address = sa.make_url(url).set(drivername="postgresql+psycopg")
    except (sa.exc.ArgumentError, ValueError):  # which may say the address, password and all
        raise InputError(
            "cannot be read as an address", shown(url), "write odd characters as %XX"
        ) from None
    given = address.query.get("options", "")
    options = [
        *(f"-c {name}={value}" for name, value in _SERVER.items()),
        *([given] if isinstance(given, str) else given),
    ]
    address = address.update_query_dict({"options": " ".join(options).strip()})
    named = {} if "application_name" in address.query else {"application_name": "aerodb"}
    # Each connection is asked whether it still is one before it is used: a cut one costs nothing
    # then.
    engine = sa.create_engine(
        address,
        connect_args={**_CLIENT, **named},
        pool_size=_KEPT,
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
    """InputError for a database in which a catalogue could not be made, or could not hold every
    text."""
    with database.reading() as connection:
        encoding: Any = connection.exec_driver_sql("SHOW server_encoding").scalar()
        schema: Any = connection.exec_driver_sql("SELECT current_schema()").scalar()
        others = [] if schema is None else sa.inspect(connection).get_table_names()
    if encoding != "UTF8":
        remedy = "make one with: createdb --encoding UTF8 --template template0 NAME"
        raise InputError(
            f"the database is of encoding {encoding}, not UTF8", database.where, remedy
        )
    if schema is None:
        raise InputError(
            "no schema of the search path is there", database.where, "make it: CREATE SCHEMA"
        )
    if others:
        what = f"the database holds other tables already ({', '.join(sorted(others)[:3])})"
        raise InputError(what, database.where, "name an empty database of its own")
