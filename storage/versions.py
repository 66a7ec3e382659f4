"""Database versions in the catalogue: adding, finding, naming them, and asking what rests on what.

Versions never change. A name such as ``released`` is a series of events, and points where its last event says. Whether a
name *may* move is the gate's decision, made by the caller; that it moves from where the caller saw it is ensured here.
"""

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from aerodb.errors import GateRefusal, InputError, UnknownNameError, nearest
from storage import encoding as enc
from storage import schema as s
from storage.ledger import Ledger
from storage.rows import FlightRole, Impact, Lineage, NameEvent, Role, VersionDocuments, VersionRow

_HEADER = tuple(s.versions.c[k] for k in ("id", "vehicle", "number", "parent", "content_sha256", "run", "created_utc"))
#: A flight used in several ways along a line counts as the first of these.
_STRONGEST: tuple[Role, ...] = ("identified", "held_out", "excluded")

#: Values bound in one statement; SQLite allows 32766.
_BOUND_VALUES = 10_000


class NameMovedError(GateRefusal):
    """Another run moved the name first; look again before you try again."""


class VersionLedger(Ledger):
    """The part of the catalogue about versions."""

    def add_version(
        self,
        id: str,
        *,
        vehicle: str,
        parent: str | None,
        content: str,
        content_sha256: str,
        settings: Mapping[str, Any],
        report: Mapping[str, Any],
        flights: Iterable[FlightRole] = (),
        inputs: Iterable[str] = (),
        run: str | None = None,
    ) -> VersionRow:
        """Stores a version under the vehicle's next label; the same id again changes nothing and gives the stored row.

        content : the database document, JSON text. inputs : keys of the results (or hashes of the files) it was made from.
        Raises InputError when a flight belongs to another vehicle, or when its role breaks the hold-out rule: one that
        identified an ancestor never validates a descendant, and one held out by an ancestor is not used up later.
        """
        enc.checked_key(id, "the id of a version")
        uses = list(flights)
        row = {
            "id": id,
            "vehicle": vehicle,
            "parent": parent,
            "content": content,
            "content_sha256": enc.checked_key(content_sha256, "the hash of a content"),
            "settings": enc.to_json(dict(settings)),
            "report": enc.to_json(dict(report)),
            "run": run,
        }
        edges = [{"version": id, "input_key": enc.checked_key(i, "the hash of an input")} for i in sorted(set(inputs))]
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            stored = _headers(connection, s.versions.c.id == id)
            if not stored:
                _check_parent(connection, vehicle, parent)
                _check_uses(connection, vehicle, uses, _roles(connection, parent))
                last = connection.execute(
                    sa.select(sa.func.max(s.versions.c.number)).where(s.versions.c.vehicle == vehicle)
                ).scalar()
                values = {**row, "number": (last or 0) + 1, "created_utc": enc.time_text(enc.now())}
                connection.execute(sa.insert(s.versions).values(values))
                if uses:
                    used = [{"version": id, "flight": u.flight, "role": u.role, "reason": enc.plain_text(u.reason)} for u in uses]
                    connection.execute(sa.insert(s.version_flights), used)
                if edges:
                    connection.execute(sa.insert(s.version_inputs), edges)
                stored = _headers(connection, s.versions.c.id == id)
            if run is not None:
                self._note_run(connection, s.run_versions, run, {"version": id})
            return stored[0]

    def version(self, vehicle: str, ref: str, as_of: datetime | None = None) -> VersionRow:
        """The version that `ref` means: an id, a name such as ``released``, a label (``v0007``) or a unique prefix of an id.

        as_of : where the name pointed, and what existed, at that time. UnknownNameError with the nearest name otherwise.
        """
        c = s.versions.c
        mine = c.vehicle == vehicle
        if as_of is not None:
            mine = mine & (c.created_utc <= enc.time_text(as_of))
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            if enc.REFERENCE.fullmatch(ref):
                label = enc.LABEL.fullmatch(ref)
                number = int(label[1]) if label else -1
                event = _last_event(connection, vehicle, ref, as_of)
                named = event.version if event else ref
                found = _headers(connection, mine & ((c.id == named) | (c.number == number)))
                if not found and event is None:
                    id = self._by_prefix(connection, c.id, ref, mine)
                    found = _headers(connection, c.id == id) if id is not None else []
                if found:
                    return found[0]
            labels = [row.label for row in _headers(connection, mine)]
            names = connection.scalars(sa.select(s.name_events.c.name).where(s.name_events.c.vehicle == vehicle).distinct()).all()
        remedy = nearest(ref[:128], [*names, *labels]) if labels else "import a database first: aerodb database import"
        when = f" as of {enc.time_text(as_of)}" if as_of is not None else ""
        raise UnknownNameError(f"no version {enc.shown(ref)}{when}", f"vehicle {vehicle}", remedy)

    def versions(self, vehicle: str) -> tuple[VersionRow, ...]:
        """All versions of a vehicle, oldest first."""
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            return tuple(_headers(connection, s.versions.c.vehicle == vehicle))

    def version_documents(self, id: str) -> VersionDocuments:
        """Content, settings and report of a version (its id)."""
        c = s.versions.c
        with self._database.reading() as connection:
            row = connection.execute(sa.select(c.content, c.settings, c.report).where(c.id == id)).one_or_none()
        if row is None:
            raise _no_version(id)
        return VersionDocuments(row.content, enc.from_json(row.settings), enc.from_json(row.report))

    # Names

    def move_name(self, vehicle: str, name: str, version: str, *, user: str, reason: str, expected: str | None) -> NameEvent:
        """Points `name` at `version` (its id), provided that it points at `expected` (an id; None: nowhere yet) now.

        Raises NameMovedError when it points elsewhere meanwhile: compare and swap, in one write transaction. To move it to
        where it stands already changes nothing and gives the last event.
        """
        enc.checked(name, enc.VERSION_NAME, "a name for versions")
        if not reason.strip():
            raise InputError("moving a name needs a reason", f"'{name}' of vehicle {vehicle}", "say why: --reason TEXT")
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            if not _headers(connection, (s.versions.c.vehicle == vehicle) & (s.versions.c.id == version)):
                raise _no_version(version, vehicle)
            last = _last_event(connection, vehicle, name)
            current = last.version if last else None
            if current != expected:
                what = f"'{name}' points at {_short(current)}, not at {_short(expected)}: it was moved meanwhile"
                raise NameMovedError(what, f"vehicle {vehicle}", "look at the history, then try again from where it stands")
            if last is not None and version == current:
                return last
            # A clock that was set back must not reorder the history.
            at = max(enc.now(), last.at_utc) if last else enc.now()
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
            event = _last_event(connection, vehicle, name)
        assert event is not None
        return event

    def name_history(self, vehicle: str, name: str | None = None) -> tuple[NameEvent, ...]:
        """All moves of a name (or of all names) of a vehicle, oldest first."""
        c = s.name_events.c
        where = c.vehicle == vehicle if name is None else (c.vehicle == vehicle) & (c.name == name)
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            rows = connection.execute(sa.select(s.name_events).where(where).order_by(c.sequence))
            return tuple(_event(row) for row in rows)

    # What rests on what

    def version_flights(self, version: str) -> tuple[FlightRole, ...]:
        """What each flight did for this version itself (not for its ancestors), by flight id."""
        c = s.version_flights.c
        with self._database.reading() as connection:
            rows = connection.execute(sa.select(c.flight, c.role, c.reason).where(c.version == version).order_by(c.flight))
            return tuple(FlightRole(*row) for row in rows)

    def roles_in_line(self, version: str | None) -> dict[str, Role]:
        """Flight -> role over `version` (its id) and all its ancestors; empty for None. The strongest role counts."""
        with self._database.reading() as connection:
            return _roles(connection, version)

    def impact(self, flight: str) -> tuple[Impact, ...]:
        """Versions that rest on a flight (its id): that used it to identify or to validate, and all their descendants."""
        rests = s.version_flights.c.role != "excluded"
        with self._database.reading() as connection:
            self._require_flight(connection, flight)
            uses = connection.execute(
                sa.select(s.version_flights.c.version, s.version_flights.c.role).where(
                    s.version_flights.c.flight == flight, rests
                )
            ).all()
            found: dict[str, Impact] = {}
            for use in sorted(uses, key=lambda use: _STRONGEST.index(use.role)):
                for row in _headers(connection, s.versions.c.id.in_(_line(use.version, down=True))):
                    if row.id not in found or row.id == use.version:
                        found[row.id] = Impact(row, use.role, use.version)
        return tuple(sorted(found.values(), key=lambda i: (i.version.vehicle, i.version.number)))

    def lineage(self, version: str) -> Lineage:
        """Ancestors, flights, log hashes, inputs and runs behind a version (its id)."""
        v, e = s.versions.c, s.version_inputs.c
        line = _line(version)
        with self._database.reading() as connection:
            rows = _headers(connection, v.id.in_(line))
            if not rows:
                raise _no_version(version)
            roles = _roles(connection, version)
            logs = connection.execute(
                sa.select(s.flights.c.id, s.flights.c.log_sha256).where(s.flights.c.id.in_(_flights_of(line)))
            )
            inputs: dict[str, list[str]] = {}
            for edge in connection.execute(sa.select(e.version, e.input_key).where(e.version.in_(line)).order_by(e.input_key)):
                inputs.setdefault(edge.version, []).append(edge.input_key)
            noted = sa.select(s.run_versions.c.run).where(s.run_versions.c.version.in_(line))
            runs = connection.execute(sa.select(s.runs).where(s.runs.c.id.in_(noted)).order_by(s.runs.c.started_utc))
            return Lineage(
                version=next(row for row in rows if row.id == version),
                line=tuple(reversed(rows)),
                roles=roles,
                logs={row.id: row.log_sha256 for row in logs},
                inputs={key: tuple(values) for key, values in inputs.items()},
                runs=tuple(self._run_row(row) for row in runs),
            )

    def stale(self, version: str) -> tuple[str, ...]:
        """Why a version (its id) no longer stands: one sentence per retracted flight that it or an ancestor used; else empty."""
        c = s.flight_events.c
        with self._database.reading() as connection:
            roles = _roles(connection, version)
            query = sa.select(c.flight, c.at_utc, c.reasons, s.flights.c.name).join(s.flights, s.flights.c.id == c.flight)
            used = c.flight.in_(_flights_of(_line(version)))
            rows = connection.execute(query.where(c.kind == "retracted", used).order_by(c.sequence)).all()
        return tuple(
            f"flight {row.name or row.flight[:12]} ({roles[row.flight].replace('_', ' ')}) was retracted on {row.at_utc[:10]}: "
            f"{enc.from_json(row.reasons)[0]}"
            for row in rows
            if roles[row.flight] != "excluded"
        )


def _headers(connection: sa.Connection, where: sa.ColumnElement[bool]) -> list[VersionRow]:
    rows = connection.execute(sa.select(*_HEADER).where(where).order_by(s.versions.c.vehicle, s.versions.c.number))
    return [VersionRow(**{**row._mapping, "created_utc": enc.time_of(row.created_utc)}) for row in rows]


def _event(row: sa.Row[Any]) -> NameEvent:
    return NameEvent(**{**row._mapping, "at_utc": enc.time_of(row.at_utc)})


def _last_event(connection: sa.Connection, vehicle: str, name: str, as_of: datetime | None = None) -> NameEvent | None:
    c = s.name_events.c
    query = sa.select(s.name_events).where(c.vehicle == vehicle, c.name == name).order_by(c.step.desc()).limit(1)
    if as_of is not None:
        query = query.where(c.at_utc <= enc.time_text(as_of))
    row = connection.execute(query).one_or_none()
    return _event(row) if row is not None else None


def _line(version: str, down: bool = False) -> sa.Select[Any]:
    """Ids of a version and its ancestors (or, `down`, its descendants): a recursive common table expression."""
    v = s.versions.c
    line = sa.select(v.id, v.parent).where(v.id == version).cte("line", recursive=True)
    further = v.parent == line.c.id if down else v.id == line.c.parent
    line = line.union(sa.select(v.id, v.parent).where(further))
    return sa.select(line.c.id)


def _flights_of(line: sa.Select[Any]) -> sa.Select[Any]:
    return sa.select(s.version_flights.c.flight).where(s.version_flights.c.version.in_(line))


def _roles(connection: sa.Connection, version: str | None) -> dict[str, Role]:
    if version is None:
        return {}
    c = s.version_flights.c
    rows = connection.execute(sa.select(c.flight, c.role).where(c.version.in_(_line(version))).order_by(c.flight)).all()
    used = {(row.flight, row.role) for row in rows}
    return {row.flight: next(role for role in _STRONGEST if (row.flight, role) in used) for row in rows}


def _check_parent(connection: sa.Connection, vehicle: str, parent: str | None) -> None:
    if parent is not None and not _headers(connection, (s.versions.c.vehicle == vehicle) & (s.versions.c.id == parent)):
        raise _no_version(parent, vehicle)


def _check_uses(connection: sa.Connection, vehicle: str, uses: list[FlightRole], before: Mapping[str, Role]) -> None:
    c = s.flights.c
    ids = [use.flight for use in uses]
    known: set[str] = set()
    for start in range(0, len(ids), _BOUND_VALUES):
        part = ids[start : start + _BOUND_VALUES]
        known.update(connection.scalars(sa.select(c.id).where(c.vehicle == vehicle, c.id.in_(part))))
    for use in uses:
        if use.flight not in known:
            raise InputError(f"no flight with id {enc.shown(use.flight)}", f"vehicle {vehicle}", "add the flight first")
        earlier = before.get(use.flight, "excluded")
        if "excluded" not in (use.role, earlier) and use.role != earlier:
            what = (
                f"flight {use.flight[:12]} cannot be {use.role.replace('_', ' ')}: an ancestor has it {earlier.replace('_', ' ')}"
            )
            raise InputError(what, f"vehicle {vehicle}", "a flight keeps its role along a line: take it as before, or exclude it")


def _no_version(id: str, vehicle: str = "") -> UnknownNameError:
    where = f"vehicle {vehicle}" if vehicle else ""
    return UnknownNameError(f"no version with id {enc.shown(id)}", where, "list them: aerodb version list")


def _short(id: str | None) -> str:
    return id[:12] if id is not None else "nothing"
