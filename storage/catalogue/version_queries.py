"""Queries shared by the catalogue's modules about versions: headers, ancestry, names, roles.

Lists read headers from a covering index, because the documents of a version may take megabytes.
"""

from collections.abc import Iterable
from datetime import datetime
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import UnknownNameError
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.rows import NameEvent, Role, VersionRow

_HEADER = tuple(
    s.versions.c[k]
    for k in ("id", "vehicle", "number", "parent", "content_sha256", "run", "created_utc")
)
#: A flight used in several ways along a line counts as the first of these.
STRONGEST: Final[tuple[Role, ...]] = ("identified", "held_out", "excluded")


def headers(connection: sa.Connection, where: sa.ColumnElement[bool]) -> list[VersionRow]:
    """Versions without their documents, oldest first."""
    rows = connection.execute(
        sa.select(*_HEADER).where(where).order_by(s.versions.c.vehicle, s.versions.c.number)
    )
    return [_header(row) for row in rows]


def newest_headers(
    connection: sa.Connection, vehicle: str, limit: int | None, before: int | None = None
) -> list[VersionRow]:
    """The newest `limit` versions of a vehicle (None: all), of those with a number below `before`;
    oldest first."""
    c = s.versions.c
    mine = c.vehicle == vehicle if before is None else (c.vehicle == vehicle) & (c.number < before)
    rows = connection.execute(
        sa.select(*_HEADER).where(mine).order_by(c.number.desc()).limit(limit)
    ).all()
    return [_header(row) for row in reversed(rows)]


def header(connection: sa.Connection, where: sa.ColumnElement[bool]) -> VersionRow | None:
    """The one version for which `where` holds, or None."""
    rows = headers(connection, where)
    return rows[0] if rows else None


def _header(row: sa.Row[Any]) -> VersionRow:
    return VersionRow(**{**row._mapping, "created_utc": enc.time_of(row.created_utc)})


def event_of(row: sa.Row[Any]) -> NameEvent:
    """A move of a name, from its row."""
    return NameEvent(**{**row._mapping, "at_utc": enc.time_of(row.at_utc)})


def last_event(
    connection: sa.Connection, vehicle: str, name: str, as_of: datetime | None = None
) -> NameEvent | None:
    """Return the newest move of a name (until `as_of`, UTC), or None; table `name_events`."""
    c = s.name_events.c
    query = (
        sa.select(s.name_events)
        .where(c.vehicle == vehicle, c.name == name)
        .order_by(c.step.desc())
        .limit(1)
    )
    if as_of is not None:
        query = query.where(c.at_utc <= enc.time_text(as_of))
    row = connection.execute(query).one_or_none()
    return event_of(row) if row is not None else None


def names_of(connection: sa.Connection, vehicle: str) -> list[str]:
    """Names that versions of a vehicle have had, sorted; each query skips to the next name without
    reading the events."""
    c, names = s.name_events.c, [""]
    while True:
        query = (
            sa.select(c.name)
            .where(c.vehicle == vehicle, c.name > names[-1])
            .order_by(c.name)
            .limit(1)
        )
        name = connection.execute(query).scalar()
        if name is None:
            return names[1:]
        names.append(name)


def line(versions: Iterable[str], down: bool = False) -> sa.Select[Any]:
    """Ids of versions and their ancestors (or, `down`, their descendants): a recursive common table
    expression."""
    v = s.versions.c
    ancestry = sa.select(v.id, v.parent).where(v.id.in_(list(versions))).cte("line", recursive=True)
    further = v.parent == ancestry.c.id if down else v.id == ancestry.c.parent
    ancestry = ancestry.union(sa.select(v.id, v.parent).where(further))
    return sa.select(ancestry.c.id)


def flights_of(versions: sa.Select[Any]) -> sa.Select[Any]:
    """Flights that any of `versions` used."""
    return sa.select(s.version_flights.c.flight).where(s.version_flights.c.version.in_(versions))


def roles_of(connection: sa.Connection, version: str | None) -> dict[str, Role]:
    """Return flight -> strongest role (`STRONGEST`) over a version and its ancestors; empty, and no
    error, for an unknown one."""
    if version is None:
        return {}
    c = s.version_flights.c
    rows = connection.execute(
        sa.select(c.flight, c.role).where(c.version.in_(line([version]))).order_by(c.flight)
    ).all()
    used = {(row.flight, row.role) for row in rows}
    return {
        row.flight: next(role for role in STRONGEST if (row.flight, role) in used) for row in rows
    }


def no_version(id: str, vehicle: str = "") -> UnknownNameError:
    """Return the UnknownNameError for an unknown version id, naming `aerodb version list`."""
    where = f"vehicle {vehicle}" if vehicle else ""
    return UnknownNameError(
        f"unknown version id {enc.shown(id)}", where, "list them: aerodb version list"
    )
