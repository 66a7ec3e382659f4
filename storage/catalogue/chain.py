"""Chain of hashes over all events: what was decided, by whom and when is not rewritten unnoticed.

Every row of a table with a `sequence` has a link, which holds the hash of the row's content and of
the link before. Links are made at the end of the transaction that adds the rows, under the lock
that all writers take, so the chain has one order. Rows that came in another way have no link.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any, Final

import sqlalchemy as sa

from aerodb.storage.catalogue import schema as s

#: The tables whose rows are links of the chain, in a fixed order.
CHAINED: Final = tuple(
    table.name for table in s.metadata.sorted_tables if "sequence" in table.columns
)
_AT_ONCE: Final = 1000


def link_of(before: str, table: str, row: sa.RowMapping) -> str:
    """Return the hash (sha256) of a row behind the hash `before`.

    Columns without a value are left out: a column that a later schema adds changes no hash. Hashed
    is ASCII JSON with sorted keys; TypeError for a value that JSON does not have.
    """
    content = {name: value for name, value in row.items() if value is not None}
    text = json.dumps([before, table, content], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def ends_of_tables(connection: sa.Connection) -> dict[str, int]:
    """Return table -> newest sequence, 0 for an empty one."""
    queries = [
        sa.select(
            sa.literal_column(f"'{name}'"),
            sa.func.coalesce(sa.func.max(s.metadata.tables[name].c.sequence), 0),
        )
        for name in CHAINED
    ]
    return {name: int(end) for name, end in connection.execute(sa.union_all(*queries))}


def link(connection: sa.Connection, before: Mapping[str, int]) -> None:
    """Link the rows that are newer than `before` (table -> sequence) and have no link yet."""
    for name, end in ends_of_tables(connection).items():
        if end > before[name]:
            link_rows(connection, s.metadata.tables[name], before[name])


def link_rows(connection: sa.Connection, table: sa.Table, after: int) -> None:
    """Link the rows of a table whose sequence is above `after` and that have no link yet."""
    c = s.chain.c
    last = connection.execute(
        sa.select(c.number, c.sha256).order_by(c.number.desc()).limit(1)
    ).one_or_none()
    number, sha256 = (0, "") if last is None else tuple(last)
    unlinked = _without_link(table)
    while rows := (
        connection.execute(
            sa.select(table)
            .where(table.c.sequence > after, unlinked)
            .order_by(table.c.sequence)
            .limit(_AT_ONCE)
        )
        .mappings()
        .all()
    ):
        links = []
        for row in rows:
            number, sha256 = number + 1, link_of(sha256, table.name, row)
            links.append(
                {
                    "number": number,
                    "of_table": table.name,
                    "of_sequence": row["sequence"],
                    "sha256": sha256,
                }
            )
        connection.execute(sa.insert(s.chain), links)
        after = rows[-1]["sequence"]


def _without_link(table: sa.Table) -> sa.ColumnElement[bool]:
    c = s.chain.c
    return ~sa.exists().where(c.of_table == table.name, c.of_sequence == table.c.sequence)


def newest_link(connection: sa.Connection) -> tuple[int, str]:
    """Return number and hash of the newest link: whoever notes the hash elsewhere can later tell
    whether anything before it was changed."""
    c = s.chain.c
    row = connection.execute(
        sa.select(c.number, c.sha256).order_by(c.number.desc()).limit(1)
    ).one_or_none()
    return (0, "") if row is None else (row.number, row.sha256)


def has_link(connection: sa.Connection, sha256: str) -> bool:
    """Return whether a hash that was noted is still in the chain."""
    there = sa.select(s.chain.c.number).where(s.chain.c.sha256 == sha256).limit(1)
    return connection.execute(there).scalar() is not None


def broken_links(connection: sa.Connection) -> Iterator[tuple[str, str]]:
    """Yield what is wrong and where, in the order of the chain; then rows that have no link."""
    c = s.chain.c
    number, sha256 = 0, ""
    while part := connection.execute(
        sa.select(s.chain).where(c.number > number).order_by(c.number).limit(_AT_ONCE)
    ).all():
        rows = _rows_of(connection, part)
        for each in part:
            if each.number != number + 1:
                yield f"links {number + 1} to {each.number - 1} are missing", "table chain"
            where = f"table {each.of_table}, row {each.of_sequence}"
            row = rows.get((each.of_table, each.of_sequence))
            if row is None:
                yield "the row was deleted", where
            elif link_of(sha256, each.of_table, row) != each.sha256:
                yield "the row, or a link of the chain at it, was changed", where
            number, sha256 = each.number, each.sha256
    for name in CHAINED:
        table = s.metadata.tables[name]
        query = sa.select(table.c.sequence).where(_without_link(table)).order_by(table.c.sequence)
        for sequence in connection.scalars(query):
            yield "the row was added by other means than aerodb", f"table {name}, row {sequence}"


def _rows_of(connection: sa.Connection, links: Any) -> dict[tuple[str, int], sa.RowMapping]:
    sequences: dict[str, list[int]] = {}
    for each in links:
        sequences.setdefault(each.of_table, []).append(each.of_sequence)
    rows: dict[tuple[str, int], sa.RowMapping] = {}
    for name in sequences.keys() & set(CHAINED):
        table = s.metadata.tables[name]
        query = sa.select(table).where(table.c.sequence.in_(sequences[name]))
        for row in connection.execute(query).mappings():
            rows[name, row["sequence"]] = row
    return rows
