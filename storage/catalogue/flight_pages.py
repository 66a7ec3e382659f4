"""Keyset pagination of the list of flights, newest first: each page continues where the previous
one ended.

A search by verdict or text uses the same order and examines a limited number of flights per page,
so the cost of a page is bounded; a page with few hits says where to continue.
"""

from dataclasses import dataclass
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.rows import FlightRow

#: Flights examined for one page of a search.
LOOKED_THROUGH: Final = 4000

#: Filter value in addition to the verdicts.
RETRACTED: Final = "retracted"

_Cursor = tuple[str, str]  # when a flight was added, and its id


@dataclass(frozen=True)
class FlightFilter:
    """Filter of a list of flights: vehicle, verdict (or ``retracted``), text in the name, in the
    name of the log or in the id."""

    vehicle: str | None = None
    verdict: str | None = None
    text: str = ""

    @property
    def searches(self) -> bool:
        """Whether flights must be examined one by one."""
        return self.verdict is not None or bool(self.text)


@dataclass(frozen=True)
class FlightPage:
    """Flights, newest first; `further` is the cursor of the next page, empty at the end."""

    rows: tuple[FlightRow, ...]
    further: str


def page_of_ids(
    connection: sa.Connection, wanted: FlightFilter, limit: int, after: str
) -> tuple[list[str], str]:
    """Return the ids of a page of flights, and the cursor of the next page (empty at the end).
    Raises InputError for a cursor that `page_of_ids` did not give."""
    names = (
        connection.scalars(sa.select(s.vehicles.c.name)).all()
        if wanted.vehicle is None
        else [wanted.vehicle]
    )
    start = _cursor(after) if after else None
    most = max(limit + 1, LOOKED_THROUGH // max(1, len(names))) if wanted.searches else limit + 1
    matching: list[_Cursor] = []
    horizons: list[_Cursor] = []
    for name in names:
        window = _window(name, start, most)
        matching += _matching(connection, window, wanted, limit + 1)
        last = _last(connection, name, start, most)
        if last is not None:
            horizons.append(last)
    # The search reaches a different time for each vehicle: results are complete only down to the
    # newest of these times.
    horizon = min(horizons, key=_order, default=None)
    whole = sorted(
        (p for p in matching if horizon is None or _order(p) <= _order(horizon)), key=_order
    )
    page = whole[:limit]
    further = page[-1] if len(whole) > limit else horizon
    named = _named(connection, wanted) if wanted.text and not after else []
    ids = list(dict.fromkeys([*named, *(id for _, id in page)]))
    return ids, "" if further is None else "~".join(further)


def _order(place: _Cursor) -> tuple[Any, ...]:
    """Sort key: newest first, then ids in ascending order. A time is a text of digits; each digit
    is inverted."""
    return tuple(-ord(digit) for digit in place[0]), place[1]


def _cursor(text: str) -> _Cursor:
    moment, sign, id = text.partition("~")
    if (
        not sign
        or not enc.FLIGHT_ID.fullmatch(id)
        or len(moment) > 40
        or not moment.isascii()
        or not moment.isprintable()
    ):
        raise InputError("not a position in this list", "after", "omit it for the first page")
    return moment, id


def _window(vehicle: str, start: _Cursor | None, most: int) -> sa.Select[Any]:
    """The next `most` flights of a vehicle; an index contains them in this order."""
    c = s.flights.c
    query = sa.select(c.id, c.name, c.log_sha256, c.added_utc).where(c.vehicle == vehicle)
    if start is not None:
        query = query.where(c.added_utc <= start[0], (c.added_utc < start[0]) | (c.id > start[1]))
    return query.order_by(c.added_utc.desc(), c.id).limit(most)


def _last(
    connection: sa.Connection, vehicle: str, start: _Cursor | None, most: int
) -> _Cursor | None:
    """The last flight of a window; None if the list ends within the window."""
    row = connection.execute(_window(vehicle, start, most).offset(most - 1).limit(1)).one_or_none()
    return None if row is None else (row.added_utc, row.id)


def _matching(
    connection: sa.Connection, window: sa.Select[Any], wanted: FlightFilter, most: int
) -> list[_Cursor]:
    """The first `most` flights of a window that match the filter."""
    w = window.subquery()
    query = sa.select(w.c.added_utc, w.c.id).order_by(w.c.added_utc.desc(), w.c.id).limit(most)
    if wanted.text:
        log = (
            sa.select(s.log_files.c.name)
            .where(s.log_files.c.sha256 == w.c.log_sha256)
            .scalar_subquery()
        )
        columns = (w.c.name, w.c.id, log)
        text = enc.plain_text(wanted.text)  # as names are stored
        query = query.where(
            sa.or_(*(column.icontains(text, autoescape=True) for column in columns))
        )
    if wanted.verdict is not None:
        query = query.where(_judged(w.c.id, wanted.verdict))
    return [(row.added_utc, row.id) for row in connection.execute(query)]


def _judged(flight: sa.ColumnElement[str], verdict: str) -> sa.ColumnElement[bool]:
    """Return whether a flight has this newest verdict, or was retracted."""
    e = s.flight_events.c
    if verdict == RETRACTED:
        return sa.exists().where(e.flight == flight, e.kind == "retracted")
    newest = (
        sa.select(e.verdict)
        .where(e.flight == flight, e.kind == "verdict")
        .order_by(e.sequence.desc())
        .limit(1)
    )
    return sa.func.coalesce(newest.scalar_subquery(), "unchecked") == verdict


def _named(connection: sa.Connection, wanted: FlightFilter) -> list[str]:
    """Flights whose name is the text, or whose id begins with it, anywhere in the list; both are
    indexed."""
    c, text = s.flights.c, wanted.text
    if not enc.REFERENCE.fullmatch(text):
        return []
    within = sa.true() if wanted.vehicle is None else c.vehicle == wanted.vehicle
    after = text[:-1] + chr(ord(text[-1]) + 1)
    ids: list[str] = []
    for condition in (c.name == text, (c.id >= text) & (c.id < after)):
        query = sa.select(c.id).where(within, condition)
        query = query if wanted.verdict is None else query.where(_judged(c.id, wanted.verdict))
        ids += connection.scalars(query.order_by(c.id).limit(5)).all()
    return ids
