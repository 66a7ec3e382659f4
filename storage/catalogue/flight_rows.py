"""Flights in the catalogue: adding them, recording verdicts and retractions, and queries."""

import re
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.remarks import Remark
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.flight_pages import FlightFilter, FlightPage, page_of_ids
from aerodb.storage.catalogue.ledger import NAMES_COMPARED, Ledger, in_parts
from aerodb.storage.catalogue.rows import FlightRow, Verdict

#: A flight as lists show it: the file of its log, its start, or the file and its day.
_FILE_AND_TIME: Final = re.compile(
    r"(?P<time>\d{4}-\d\d-\d\d(?:[ T]\d\d(?::\d\d){0,2})?)"
    r"|(?P<file>[^\x00-\x1f\x7f]{1,200}?)(?: \((?P<day>\d{4}-\d\d-\d\d)\))?"
)
#: Most flights that are named to choose from.
_TOLD: Final = 6


class FlightLedger(Ledger):
    """Catalogue queries about flights."""

    def add_flight(
        self,
        id: str,
        *,
        vehicle: str,
        log_sha256: str,
        mapping: str,
        start_utc: datetime | None,
        duration: float,
        samples: int,
        step: float,
        name: str | None = None,
    ) -> FlightRow:
        """Store a flight of a stored log; `duration` and `step` in s. The same flight again changes
        nothing.

        Processing a flight again with another outcome (a better mapping) adds a record; the newest
        record counts. InputError when the id belongs to another vehicle, log or name, or the name
        to another flight of the vehicle.
        """
        enc.checked(id, enc.FLIGHT_ID, "the id of a flight")
        if name is not None:
            enc.checked(name, enc.FLIGHT_NAME, "the name of a flight")
        start = enc.time_text(start_utc) if start_utc is not None else None
        record = {
            "mapping": mapping,
            "start_utc": start,
            "duration": float(duration),
            "samples": samples,
            "step": float(step),
        }
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            at = self._stamp(connection, s.flights.c.added_utc, s.flights.c.vehicle == vehicle)
            identity = {"id": id, "vehicle": vehicle, "name": name, "log_sha256": log_sha256}
            if self._is_new(connection, identity):
                connection.execute(sa.insert(s.flights).values({**identity, "added_utc": at}))
            newest = connection.execute(
                sa.select(*(s.flight_records.c[k] for k in record))
                .where(s.flight_records.c.flight == id)
                .order_by(s.flight_records.c.sequence.desc())
                .limit(1)
            ).one_or_none()
            if newest is None or dict(newest._mapping) != record:
                connection.execute(
                    sa.insert(s.flight_records).values({"flight": id, "added_utc": at, **record})
                )
            return _rows(connection, s.flights.c.id == id)[0]

    @staticmethod
    def _is_new(connection: sa.Connection, identity: dict[str, str | None]) -> bool:
        c = s.flights.c
        log = connection.execute(
            sa.select(s.log_files.c.status).where(s.log_files.c.sha256 == identity["log_sha256"])
        ).scalar()
        if log is None or log == "quarantined":
            raise InputError(
                "its log is not stored", f"flight {identity['id']}", "add the log first"
            )
        stored = connection.execute(
            sa.select(c.id, c.vehicle, c.name, c.log_sha256).where(c.id == identity["id"])
        ).one_or_none()
        if stored is not None:
            # A log that comes again without a name is still the flight that was named before.
            expected = {
                key: value for key, value in identity.items() if key != "name" or value is not None
            }
            if any(stored._mapping[key] != value for key, value in expected.items()):
                what = (
                    f"already stored for vehicle '{stored.vehicle}' as"
                    f" '{stored.name or stored.id[:12]}'"
                )
                raise InputError(
                    what, f"flight {identity['id']}", "use that flight, or give this one another id"
                )
            return False
        if identity["name"] is None:
            return True
        taken = connection.execute(
            sa.select(c.id).where(c.vehicle == identity["vehicle"], c.name == identity["name"])
        ).scalar()
        if taken is not None:
            what = (
                f"vehicle '{identity['vehicle']}' already has a flight named '{identity['name']}'"
                f" ({taken[:12]})"
            )
            raise InputError(what, f"flight {identity['id']}", "choose another name")
        return True

    def judge_flight(self, id: str, verdict: Verdict, remarks: Iterable[Remark] = ()) -> None:
        """Record the verdict on a flight (its id). The newest verdict counts; the same verdict
        again changes nothing. UnknownNameError for an unknown flight; tables `flight_events` and
        `verdict_remarks`."""
        remarks = tuple(remarks)
        with self._database.writing() as connection:
            self._require_flight(connection, id)
            text = enc.to_json([enc.plain_text(remark.sentence) for remark in remarks])
            data = enc.remarks_to_json(remarks)
            row = _rows(connection, s.flights.c.id == id)[0]
            known = (row.verdict, enc.to_json(list(row.reasons)), enc.remarks_to_json(row.remarks))
            if known != (verdict, text, data):
                event = self._add_event(
                    connection, id, kind="verdict", verdict=verdict, reasons=text
                )
                if remarks:
                    connection.execute(
                        sa.insert(s.verdict_remarks).values(event=event, remarks=data)
                    )

    def retract_flight(self, id: str, reason: str, *, user: str = "") -> FlightRow:
        """Retract a flight (its id) for a reason: every version that depends on it becomes stale. A
        second retraction changes nothing. InputError without a reason, UnknownNameError for an
        unknown flight; table `flight_events`."""
        if not reason.strip():
            raise InputError(
                "a retraction requires a reason", f"flight {enc.shown(id)}", "add --reason TEXT"
            )
        with self._database.writing() as connection:
            self._require_flight(connection, id)
            if _rows(connection, s.flights.c.id == id)[0].retracted_utc is None:
                self._add_event(
                    connection,
                    id,
                    kind="retracted",
                    verdict=None,
                    reasons=enc.to_json([enc.plain_text(reason)]),
                    user=enc.plain_text(user),
                )
            return _rows(connection, s.flights.c.id == id)[0]

    @staticmethod
    def _add_event(connection: sa.Connection, flight: str, **values: str | None) -> int:
        event = {"flight": flight, "at_utc": enc.time_text(enc.now()), **values}
        key = connection.execute(sa.insert(s.flight_events).values(event)).inserted_primary_key
        assert key is not None
        return int(key[0])

    def flight(self, ref: str, vehicle: str | None = None) -> FlightRow:
        """The flight referred to by `ref`: an exact id, a name (of `vehicle`, when given), a unique
        prefix of an id; else the file of its log, with or without suffix, or the start of its
        time (UTC), as lists show both.

        UnknownNameError, with the nearest name, when there is no such flight or several.
        """
        c = s.flights.c
        within = sa.true() if vehicle is None else c.vehicle == vehicle
        with self._database.reading() as connection:
            if vehicle is not None:
                self._require_vehicle(connection, vehicle)
            if enc.REFERENCE.fullmatch(ref):
                rows = _rows(connection, within & (c.id == ref)) or _rows(
                    connection, within & (c.name == ref)
                )
                if len(rows) > 1:
                    remedy = f"choose one: --vehicle {' or '.join(row.vehicle for row in rows)}"
                    raise UnknownNameError(
                        f"{enc.shown(ref)} names a flight of several vehicles", remedy=remedy
                    )
                id = rows[0].id if rows else self._by_prefix(connection, c.id, ref, within)
                if id is not None:
                    return rows[0] if rows else _rows(connection, c.id == id)[0]
            if (shown := _as_lists_show(connection, ref, within)) is not None:
                return shown
            known = connection.scalars(sa.select(c.id).where(within).limit(NAMES_COMPARED)).all()
        labels = self.flight_labels(known)
        remedy = nearest(ref[:128], labels.values()) if known else "ingest a log first"
        raise UnknownNameError(
            f"unknown flight {enc.shown(ref)}", f"vehicle {vehicle}" if vehicle else "", remedy
        )

    def flights_by_id(self, ids: Iterable[str]) -> dict[str, FlightRow]:
        """Return id -> flight, for those of `ids` that exist; no error for the others."""
        with self._database.reading() as connection:
            return {
                row.id: row
                for part in in_parts(set(ids))
                for row in _rows(connection, s.flights.c.id.in_(part))
            }

    def newest_flights(self, vehicle: str, limit: int) -> tuple[FlightRow, ...]:
        """Return the flights of a vehicle that were added last, at most `limit`, newest first; no
        others are read. UnknownNameError for an unknown vehicle."""
        c = s.flights.c
        query = (
            sa.select(c.id)
            .where(c.vehicle == vehicle)
            .order_by(c.added_utc.desc(), c.id)
            .limit(limit)
        )
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            ids = connection.scalars(query).all()
        rows = self.flights_by_id(ids)
        return tuple(rows[id] for id in ids)

    def flight_page(self, wanted: FlightFilter, limit: int, after: str = "") -> FlightPage:
        """The flights that were added last, newest first: at most `limit` that match `wanted`.

        after : the `further` of the previous page. The cost does not grow with the number of stored
        flights: a search examines a limited number per page, so a page may have fewer hits than
        exist. InputError if `after` is not a position in the list.
        """
        with self._database.reading() as connection:
            if wanted.vehicle is not None:
                self._require_vehicle(connection, wanted.vehicle)
            ids, further = page_of_ids(connection, wanted, limit, after)
        rows = self.flights_by_id(ids)
        return FlightPage(tuple(rows[id] for id in ids), further)

    def log_names(self, hashes: Iterable[str]) -> dict[str, str]:
        """Return sha256 -> name of the log's file (table `log_files`), for those that are known; no
        error for the others."""
        c = s.log_files.c
        with self._database.reading() as connection:
            queries = [
                sa.select(c.sha256, c.name).where(c.sha256.in_(part))
                for part in in_parts(set(hashes))
            ]
            return {name: file for q in queries for name, file in connection.execute(q).all()}

    def flight_labels(self, ids: Iterable[str]) -> dict[str, str]:
        """Return id -> name of the flight for people: its own, else the file of its log and the day
        that it was flown (where the log knows it); the first digits of its id where neither is
        known."""
        rows = self.flights_by_id(ids)
        hashes = {row.log_sha256 for row in rows.values() if row.name is None}
        files = self.log_names(hashes)
        return {id: _shown(row, files) for id, row in rows.items()}

    def flights(
        self, vehicle: str | None = None, log_sha256: str | None = None
    ) -> tuple[FlightRow, ...]:
        """Return all flights, or those of a vehicle or a log, by start time (by time of addition if
        the start is unknown). Times are UTC; UnknownNameError for an unknown vehicle. See
        `FlightRow`."""
        where: sa.ColumnElement[bool] = sa.true()
        with self._database.reading() as connection:
            if vehicle is not None:
                self._require_vehicle(connection, vehicle)
                where = where & (s.flights.c.vehicle == vehicle)
            if log_sha256 is not None:
                where = where & (s.flights.c.log_sha256 == log_sha256)
            rows = _rows(connection, where)
        return tuple(sorted(rows, key=lambda row: (row.start_utc or row.added_utc, row.id)))


def _as_lists_show(
    connection: sa.Connection, ref: str, within: sa.ColumnElement[bool]
) -> FlightRow | None:
    """The flight of a log's file, of a time, or of both; None when there is none, UnknownNameError
    when there are several."""
    found = _FILE_AND_TIME.fullmatch(ref)
    if found is None or not ref.isprintable():
        return None
    f, log, record = s.flights.c, s.log_files.c, s.flight_records.c
    file, time = found["file"], (found["day"] or found["time"] or "").replace(" ", "T")
    query = sa.select(f.id).where(within)
    if file:
        of_file = (log.name == file) | log.name.startswith(f"{file}.", autoescape=True)
        query = query.join(s.log_files, log.sha256 == f.log_sha256).where(of_file)
    if time:
        started = record.start_utc.startswith(time, autoescape=True)
        query = query.where(f.id.in_(sa.select(record.flight).where(started)))
    ids = connection.scalars(query.order_by(f.id).limit(NAMES_COMPARED)).all()
    rows = _rows(connection, f.id.in_(ids)) if ids else []
    if time:  # by the newest record alone
        rows = [r for r in rows if r.start_utc and enc.time_text(r.start_utc).startswith(time)]
    if len(rows) > 1:
        ids = sorted(row.id[:12] for row in rows)[:_TOLD]
        raise UnknownNameError(
            f"{enc.shown(ref)} names several flights", remedy=f"choose one: {' or '.join(ids)}"
        )
    return rows[0] if rows else None


def _shown(row: FlightRow, files: Mapping[str, str]) -> str:
    file = files.get(row.log_sha256)
    if row.name is not None or file is None:
        return row.label
    return file if row.start_utc is None else f"{file} ({row.start_utc:%Y-%m-%d})"


def _newest(table: sa.Table, *where: sa.ColumnElement[bool]) -> sa.Subquery:
    """Sequence of the newest row per flight."""
    query = sa.select(table.c.flight, sa.func.max(table.c.sequence).label("sequence")).where(*where)
    return query.group_by(table.c.flight).subquery()


def _rows(connection: sa.Connection, where: sa.ColumnElement[bool]) -> list[FlightRow]:
    """Flights with their newest record, newest verdict and retraction."""
    chosen = sa.select(s.flights.c.id).where(where).scalar_subquery()
    f, r = s.flights, s.flight_records
    verdicts, retractions = s.flight_events.alias("verdicts"), s.flight_events.alias("retractions")
    record = _newest(r, r.c.flight.in_(chosen))
    event = s.flight_events.c
    verdict = _newest(s.flight_events, event.flight.in_(chosen), event.kind == "verdict")
    retraction = _newest(s.flight_events, event.flight.in_(chosen), event.kind == "retracted")
    query = (
        sa.select(
            *(f.c[k] for k in ("id", "vehicle", "name", "log_sha256", "added_utc")),
            *(r.c[k] for k in ("mapping", "start_utc", "duration", "samples", "step")),
            verdicts.c.verdict,
            verdicts.c.reasons,
            s.verdict_remarks.c.remarks,
            retractions.c.at_utc.label("retracted_utc"),
            retractions.c.reasons.label("retract_reasons"),
            retractions.c.user.label("retracted_by"),
        )
        .join(record, record.c.flight == f.c.id)
        .join(r, r.c.sequence == record.c.sequence)
        .outerjoin(verdict, verdict.c.flight == f.c.id)
        .outerjoin(verdicts, verdicts.c.sequence == verdict.c.sequence)
        .outerjoin(s.verdict_remarks, s.verdict_remarks.c.event == verdict.c.sequence)
        .outerjoin(retraction, retraction.c.flight == f.c.id)
        .outerjoin(retractions, retractions.c.sequence == retraction.c.sequence)
        .where(where)
    )
    found = connection.execute(query)
    keys = tuple(found.keys())
    return [_flight(dict(zip(keys, row, strict=True))) for row in found.all()]


def _flight(values: dict[str, Any]) -> FlightRow:
    retracted = values.pop("retract_reasons")
    for name in ("start_utc", "added_utc", "retracted_utc"):
        values[name] = enc.time_of(values[name]) if values[name] else None
    values["retracted_by"] = values["retracted_by"] or ""
    values["verdict"] = values["verdict"] or "unchecked"
    for name, read in (("reasons", enc.from_json), ("remarks", enc.remarks_from_json)):
        text = values[name]  # most flights have none of either
        values[name] = () if text in (None, "[]") else tuple(read(text))
    return FlightRow(**values, retract_reason=enc.from_json(retracted)[0] if retracted else "")
