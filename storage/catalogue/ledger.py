"""Base class of the catalogue's parts: the database, existence checks and shared queries."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import sqlalchemy as sa

from aerodb.errors import UnknownNameError, nearest
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.database import Database
from aerodb.storage.catalogue.rows import RunRow

#: Maximum number of names compared for a suggestion; comparing a million would take minutes.
NAMES_COMPARED = 2000


#: Values bound in one statement; SQLite allows 32766.
_BOUND_VALUES = 10_000


_Value = TypeVar("_Value")


def in_parts(values: Iterable[_Value]) -> Iterator[list[_Value]]:
    """`values` in batches that one SQL statement can bind."""
    listed = list(values)
    for start in range(0, len(listed), _BOUND_VALUES):
        yield listed[start : start + _BOUND_VALUES]


class Ledger:
    """Base of the catalogue's parts."""

    def __init__(self, database: Database) -> None:
        self._database = database

    @staticmethod
    def _require_vehicle(connection: sa.Connection, name: str) -> None:
        query = sa.select(s.vehicles.c.name).where(s.vehicles.c.name == name)
        if not enc.VEHICLE_NAME.fullmatch(name) or connection.execute(query).scalar() is None:
            known = connection.scalars(sa.select(s.vehicles.c.name).limit(NAMES_COMPARED)).all()
            remedy = (
                nearest(name[:128], known)
                if known
                else "add a vehicle first: aerodb vehicle add FILE.toml"
            )
            raise UnknownNameError(f"unknown vehicle {enc.shown(name)}", remedy=remedy)

    @staticmethod
    def _require_flight(connection: sa.Connection, id: str) -> None:
        if (
            connection.execute(sa.select(s.flights.c.id).where(s.flights.c.id == id)).scalar()
            is None
        ):
            raise UnknownNameError(
                f"unknown flight id {enc.shown(id)}", remedy="add the flight first"
            )

    @staticmethod
    def _stamp(
        connection: sa.Connection, column: sa.Column[str], *among: sa.ColumnElement[bool]
    ) -> str:
        """The time of a new row in a list ordered by `column`: later than all existing rows that
        satisfy `among`."""
        newest = connection.execute(sa.select(sa.func.max(column)).where(*among)).scalar()
        return enc.time_text(enc.after(enc.time_of(newest) if newest else None))

    @staticmethod
    def _note_run(
        connection: sa.Connection, edges: sa.Table, run: str, target: Mapping[str, str]
    ) -> None:
        """Record once that a run created or used something."""
        if connection.execute(sa.select(s.runs.c.id).where(s.runs.c.id == run)).scalar() is None:
            raise UnknownNameError(f"unknown run {enc.shown(run)}", remedy="start the run first")
        row = {"run": run, **target}
        same = sa.and_(*(edges.c[name] == value for name, value in row.items()))
        if connection.execute(sa.select(edges.c.run).where(same)).scalar() is None:
            connection.execute(sa.insert(edges).values(row))

    @staticmethod
    def _by_prefix(
        connection: sa.Connection,
        column: sa.Column[str],
        prefix: str,
        where: sa.ColumnElement[bool],
    ) -> str | None:
        """The id that starts with `prefix`; None when there is none, UnknownNameError when there
        are several."""
        if len(prefix) < _SHORTEST_PREFIX:
            return None
        after = prefix[:-1] + chr(ord(prefix[-1]) + 1)
        query = (
            sa.select(column)
            .where(where, column >= prefix, column < after)
            .order_by(column)
            .limit(3)
        )
        ids = connection.scalars(query).all()
        if len(ids) > 1:
            remedy = f"give more digits: {', '.join(f'{id[: len(prefix) + 8]}...' for id in ids)}"
            raise UnknownNameError(f"{enc.shown(prefix)} is not unique", remedy=remedy)
        return ids[0] if ids else None

    @staticmethod
    def _run_row(row: sa.Row[Any]) -> RunRow:
        values = {
            **row._mapping,
            "started_utc": enc.time_of(row.started_utc),
            "ended_utc": enc.time_of(row.ended_utc) if row.ended_utc else None,
            "parameters": enc.from_json(row.parameters),
        }
        return RunRow(**values)


#: A shorter prefix is more likely a mistyped name than the start of a hash.
_SHORTEST_PREFIX = 4
