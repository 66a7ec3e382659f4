"""The catalogue as it was before a migration: kept, so that the version of aerodb that wrote it can
go on from there."""

import logging
import os
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import sqlalchemy as sa

from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors

_LOG: Final = logging.getLogger(__name__)
#: Beginning of the names of tables that are kept in PostgreSQL.
FORMER: Final = "former_"


def keep_former(connection: sa.Connection, revision: str) -> str:
    """Keep the catalogue of a writing transaction as it is, before its schema changes.

    SQLite: in a file next to it; PostgreSQL: in tables next to its own (`FORMER`), which a
    rollback removes. Returns where. Raises StoreError when the disk has no room for the copy:
    nothing changes then.
    """
    if connection.dialect.name == "sqlite":
        return str(_copied_file(Path(str(connection.engine.url.database)), revision))
    quote = connection.dialect.identifier_preparer.quote
    for table in sa.inspect(connection).get_table_names():
        if not table.startswith(FORMER):
            kept = quote(f"{FORMER}{revision}_{table}")
            connection.exec_driver_sql(f"DROP TABLE IF EXISTS {kept}")
            connection.exec_driver_sql(f"CREATE TABLE {kept} AS TABLE {quote(table)}")
    return f"its tables {FORMER}{revision}_*"


def forget_former(kept: str) -> None:
    """Remove a copy whose migration did not happen; tables are gone with the transaction."""
    path = Path(kept)
    if path.suffix == ".sqlite" and path.is_file():
        remove(path)


def say_what_happened(where: str, before: str, after: str, kept: str) -> None:
    """Tell in the log (standard error where nothing else is set) that a catalogue was migrated."""
    _LOG.warning(
        "aerodb: %s: changed from schema %s to %s; the former catalogue is kept in %s. The version"
        " of aerodb that wrote it goes on from there, once it is put back in its place.",
        where,
        before,
        after,
        kept,
    )


def _copied_file(path: Path, revision: str) -> Path:
    now = datetime.now(UTC)
    kept = path.with_name(f"{path.stem}-{revision}-{now:%Y%m%dT%H%M%S}{path.suffix}")
    with translated_disk_errors(kept):
        temporary = temporary_beside(kept)
        try:
            # A connection of its own: it sees what is committed, which is all there is before the
            # first change of the transaction that holds the lock.
            with (
                closing(sqlite3.connect(path)) as source,
                closing(sqlite3.connect(temporary)) as target,
            ):
                source.backup(target)
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            temporary.replace(kept)
        except BaseException:
            remove(temporary)
            raise
    return kept
