"""Names of versions: ``released``, ``candidate`` and user-defined ones.

A name is a series of move events; it points to the version of the last one. The caller decides
whether a move is allowed (the gate); this module ensures that the name still points where the
caller saw it (compare and swap).
"""

from collections.abc import Iterable

import sqlalchemy as sa

from aerodb.errors import GateRefusal, InputError
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger, in_parts
from aerodb.storage.catalogue.rows import NameEvent
from aerodb.storage.catalogue.version_queries import (
    event_of,
    header,
    last_event,
    names_of,
    no_version,
)


class NameMovedError(GateRefusal):
    """Another run has moved the name in the meantime."""


class NameLedger(Ledger):
    """Catalogue queries about names of versions."""

    def move_name(
        self, vehicle: str, name: str, version: str, *, user: str, reason: str, expected: str | None
    ) -> NameEvent:
        """Move `name` to `version` (its id) if it points to `expected` (an id; None: to nothing).

        Compare and swap in one write transaction: raises NameMovedError when the name points
        elsewhere. Moving it to its current version changes nothing and gives the last event.
        """
        enc.checked(name, enc.VERSION_NAME, "a name for versions")
        if not reason.strip():
            raise InputError(
                "moving a name requires a reason",
                f"'{name}' of vehicle {vehicle}",
                "add --reason TEXT",
            )
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            row = header(
                connection, (s.versions.c.vehicle == vehicle) & (s.versions.c.id == version)
            )
            if row is None:
                raise no_version(version, vehicle)
            last = last_event(connection, vehicle, name)
            current = last.version if last else None
            if current != expected:
                what = (
                    f"'{name}' points to {_short(current)}, not to {_short(expected)}: it was moved"
                    " in the meantime"
                )
                raise NameMovedError(
                    (what,),
                    f"vehicle {vehicle}",
                    "check the history of the name, then try again from its current version",
                )
            if last is not None and version == current:
                return last
            # A clock that was set back must not reorder the history.
            at = enc.after(row.created_utc, last.at_utc if last else None)
            values = {
                "vehicle": vehicle,
                "name": name,
                "step": last.step + 1 if last else 1,
                "version": version,
                "previous": current,
                "at_utc": enc.time_text(at),
                "user": enc.plain_text(user),
                "reason": enc.plain_text(reason),
            }
            connection.execute(sa.insert(s.name_events).values(values))
            event = last_event(connection, vehicle, name)
        assert event is not None
        return event

    def name_history(
        self,
        vehicle: str,
        name: str | None = None,
        limit: int | None = None,
        before: int | None = None,
    ) -> tuple[NameEvent, ...]:
        """Return all moves of a name (or of all names) of a vehicle, or the newest `limit` of them;
        oldest first.

        before : only moves with a smaller `sequence`. UnknownNameError for an unknown vehicle,
        InputError for a name that is not allowed.
        """
        if name is not None:
            enc.checked(name, enc.VERSION_NAME, "a name for versions")
        c = s.name_events.c
        query = sa.select(s.name_events).where(c.vehicle == vehicle)
        query = query if before is None else query.where(c.sequence < before)
        # The moves of one name are in order by their steps, which an index holds.
        query = (
            query.order_by(c.sequence.desc())
            if name is None
            else query.where(c.name == name).order_by(c.step.desc())
        )
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            rows = connection.execute(query.limit(limit)).all()
        return tuple(event_of(row) for row in reversed(rows))

    def moves_to(self, vehicle: str, versions: Iterable[str]) -> tuple[NameEvent, ...]:
        """Return all moves of names of a vehicle to any of `versions` (their ids), oldest first; no
        error for unknown ones."""
        c = s.name_events.c
        with self._database.reading() as connection:
            queries = [
                sa.select(s.name_events).where(c.vehicle == vehicle, c.version.in_(part))
                for part in in_parts(versions)
            ]
            rows = [row for query in queries for row in connection.execute(query)]
        return tuple(sorted((event_of(row) for row in rows), key=lambda event: event.sequence))

    def named(self, vehicle: str, name: str) -> NameEvent | None:
        """Return the newest move of a name (`NameEvent`): where it points now; None while it points
        nowhere. InputError for a name that is not allowed."""
        enc.checked(name, enc.VERSION_NAME, "a name for versions")
        with self._database.reading() as connection:
            return last_event(connection, vehicle, name)

    def names(self, vehicle: str) -> dict[str, str]:
        """Return name -> id of the version at which it points now (`NameEvent`); UnknownNameError
        for an unknown vehicle."""
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            events = [
                last_event(connection, vehicle, name) for name in names_of(connection, vehicle)
            ]
        return {event.name: event.version for event in events if event is not None}


def standing_moves(history: tuple[NameEvent, ...]) -> tuple[NameEvent, ...]:
    """Return the moves of one name's whole `history` that have not been taken back, oldest first;
    the last says where it points.

    A move back to where the name pointed before the last standing move takes that move back: so two
    rollbacks go back by two versions, and not there and forth.
    """
    standing: list[NameEvent] = []
    for event in history:
        if len(standing) > 1 and event.version == standing[-2].version:
            standing.pop()
        else:
            standing.append(event)
    return tuple(standing)


def _short(id: str | None) -> str:
    return id[:12] if id is not None else "nothing"
