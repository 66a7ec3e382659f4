"""Hashes of all rows that are not events: what a version is made of, settings of results and
flights are not rewritten unnoticed.

The rows of a table form groups (a version's flights, a result's inputs, mostly one row). Each group
that a transaction adds to gets a link with the hash of its content and of the link before; the
newest link of a group counts. Events, whose tables have a `sequence`, are in `chain`.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import sqlalchemy as sa

from aerodb.storage.catalogue import schema as s

#: Tables of large groups, and the columns that the rows of a group share; else each row is one.
_GROUPED: Final = {
    "flight_fingerprints": ("flight",),
    "result_inputs": ("key",),
    "version_inputs": ("version",),
    "version_flights": ("version",),
}
#: Records of how runs and the reading of logs went, which decide nothing; and the links themselves.
_WITHOUT: Final = ("runs", "run_results", "run_versions", "log_files", "chain", "row_links")
#: The tables whose rows are linked here, in a fixed order -> the columns that name a group.
LINKED: Final[Mapping[str, tuple[str, ...]]] = {
    table.name: _GROUPED.get(table.name, tuple(table.primary_key.columns.keys()))
    for table in s.metadata.sorted_tables
    if "sequence" not in table.columns and table.name not in _WITHOUT
}
_AT_ONCE: Final = 500

#: A group: its table, and the values of the columns that name it.
Group = tuple[str, tuple[Any, ...]]


class Touched:
    """The groups to which a transaction adds rows."""

    def __init__(self) -> None:
        self._groups: dict[Group, None] = {}
        self._copies = False

    def listen(self, connection: sa.Connection) -> None:
        """Note what the statements of a connection's transaction insert."""
        sa.event.listen(connection, "after_execute", self._note)

    def forget(self, connection: sa.Connection) -> None:
        """Note no more."""
        sa.event.remove(connection, "after_execute", self._note)

    def _note(
        self,
        _connection: Any,
        statement: Any,
        _multi: Any,
        _single: Any,
        _options: Any,
        result: sa.CursorResult[Any],
    ) -> None:
        if not isinstance(statement, sa.Insert):  # linked rows are never updated
            return
        table = str(statement.table.name)
        self._copies = self._copies or table == s.row_links.name
        for given in result.context.compiled_parameters if table in LINKED else ():
            self._groups[table, tuple(given[c] for c in LINKED[table])] = None

    def link(self, connection: sa.Connection) -> None:
        """Link these groups; rows that were copied together with their links are linked already."""
        if self._groups and not self._copies:
            link_groups(connection, list(self._groups))


def link_groups(connection: sa.Connection, groups: Sequence[Group]) -> None:
    """Add links of groups; those without a row, whose savepoint was rolled back, get none."""
    number, before = _newest(connection)
    links = []
    for table, values in groups:
        content = content_of(connection, s.metadata.tables[table], values)
        if content:
            number, before = number + 1, _link(before, table, values, content)
            links.append(
                {
                    "number": number,
                    "of_table": table,
                    "of_group": _text(values),
                    "content_sha256": content,
                    "sha256": before,
                }
            )
    if links:
        connection.execute(sa.insert(s.row_links), links)


def link_stored_rows(connection: sa.Connection, table: sa.Table) -> None:
    """Link all groups of a table that has no links yet; used by a migration."""
    columns = [table.c[name] for name in LINKED[table.name]]
    rows = connection.execute(sa.select(*columns).distinct().order_by(*columns)).all()
    for first in range(0, len(rows), _AT_ONCE):
        part = rows[first : first + _AT_ONCE]
        link_groups(connection, [(table.name, tuple(row)) for row in part])


def content_of(connection: sa.Connection, table: sa.Table, values: Sequence[Any]) -> str:
    """Return the hash (sha256) of a group's rows; empty without a row.

    Columns without a value are left out: a column that a later schema adds changes no hash.
    KeyError for a table that is not in `LINKED`.
    """
    where = [table.c[c] == value for c, value in zip(LINKED[table.name], values, strict=True)]
    rows = connection.execute(sa.select(table).where(*where)).mappings()
    texts = sorted(_row_text(row) for row in rows)
    return hashlib.sha256("\n".join(texts).encode("ascii")).hexdigest() if texts else ""


def _row_text(row: Mapping[Any, Any]) -> str:
    content = {str(name): value for name, value in row.items() if value is not None}
    return json.dumps(content, sort_keys=True, separators=(",", ":"))


def _text(values: Sequence[Any]) -> str:
    return json.dumps(list(values), separators=(",", ":"))


def _link(before: str, table: str, values: Sequence[Any], content: str) -> str:
    text = json.dumps([before, table, list(values), content], separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _newest(connection: sa.Connection) -> tuple[int, str]:
    c = s.row_links.c
    newest = sa.select(c.number, c.sha256).order_by(c.number.desc()).limit(1)
    row = connection.execute(newest).one_or_none()
    return (0, "") if row is None else (row.number, row.sha256)


def broken_rows(connection: sa.Connection) -> Iterator[tuple[str, str]]:
    """Yield what is wrong and where: links that do not follow from the one before, then rows that
    differ from the newest link of their group, are missing, or have none."""
    newest: dict[tuple[str, str], str] = {}
    number, before = 0, ""
    for link in connection.execute(sa.select(s.row_links).order_by(s.row_links.c.number)):
        if link.number != number + 1:
            yield f"links {number + 1} to {link.number - 1} are missing", "table row_links"
        try:
            expected = _link(before, link.of_table, json.loads(link.of_group), link.content_sha256)
        except (TypeError, ValueError):
            expected = ""
        if expected != link.sha256:
            yield "a link was changed", f"table row_links, row {link.number}"
        number, before = link.number, link.sha256
        newest[link.of_table, link.of_group] = link.content_sha256
    for name, columns in LINKED.items():
        for group, content in _contents(connection, s.metadata.tables[name], columns):
            linked = newest.pop((name, group), None)
            if linked is None:
                yield "the row was added by other means than aerodb", f"table {name}, {group}"
            elif linked != content:
                yield "the row was changed", f"table {name}, {group}"
    for name, group in newest:
        yield "the row was deleted", f"table {name}, {group}"


def _contents(
    connection: sa.Connection, table: sa.Table, columns: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield each group and the hash of its content; rows are read in order, a group at a time."""
    order = [table.c[name] for name in columns]
    group, texts = "", list[str]()
    for row in connection.execute(sa.select(table).order_by(*order)).mappings():
        of = _text([row[name] for name in columns])
        if texts and of != group:
            yield group, hashlib.sha256("\n".join(sorted(texts)).encode("ascii")).hexdigest()
            texts = []
        group = of
        texts.append(_row_text(row))
    if texts:
        yield group, hashlib.sha256("\n".join(sorted(texts)).encode("ascii")).hexdigest()
