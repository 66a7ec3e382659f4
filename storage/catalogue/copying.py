"""Copy of all rows of a catalogue into an empty one, between SQLite and PostgreSQL; used by backup
and restore."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger

#: Rows in memory at once; rows of versions and calibrations contain whole documents.
_ROWS: Final = 1000
_DOCUMENTS: Final = 10


def copy_catalogue(source: Ledger, target: Ledger) -> None:
    """Copy all rows of one consistent state of `source` in one transaction of `target`; others may
    write to `source` meanwhile.

    Raises InputError when `target` is not empty.
    """
    with source._database.reading() as reading, target._database.writing() as writing:
        for table in s.metadata.sorted_tables:
            if (
                writing.execute(sa.select(sa.literal(1)).select_from(table).limit(1)).first()
                is not None
            ):
                remedy = "name an empty database: aerodb restore --settings FILE"
                raise InputError(
                    "the target database already contains a catalogue",
                    target._database.where,
                    remedy,
                )
            _copy_table(table, reading, writing)


def _copy_table(table: sa.Table, reading: sa.Connection, writing: sa.Connection) -> None:
    # Numbers first: a version comes after its parent.
    order = [*(c for c in table.columns if c.name == "number"), *table.primary_key.columns]
    at_once = _DOCUMENTS if "content" in table.c else _ROWS
    rows = reading.execute(sa.select(table).order_by(*order).execution_options(yield_per=at_once))
    if writing.dialect.name == "postgresql":
        return _stream(table, rows, writing)
    for part in rows.mappings().partitions():
        writing.execute(sa.insert(table), [dict(row) for row in part])


def _stream(table: sa.Table, rows: Iterable[Sequence[Any]], writing: sa.Connection) -> None:
    """Write rows into a PostgreSQL table with COPY, which is much faster than inserts, and advance
    its sequence."""
    import psycopg

    columns = ", ".join(f'"{column.name}"' for column in table.columns)
    try:
        raw: Any = writing.connection.driver_connection
        with (
            raw.cursor() as cursor,
            cursor.copy(f"COPY {table.name} ({columns}) FROM STDIN") as copy,
        ):
            for row in rows:
                copy.write_row(row)
    except psycopg.Error as error:
        raise sa.exc.DBAPIError.instance(f"COPY {table.name}", {}, error, psycopg.Error) from error
    if "sequence" in table.c:
        newest = sa.select(sa.func.coalesce(sa.func.max(table.c.sequence), 0) + 1).scalar_subquery()
        writing.execute(
            sa.select(
                sa.func.setval(
                    sa.func.pg_get_serial_sequence(table.name, "sequence"), newest, False
                )
            )
        )
