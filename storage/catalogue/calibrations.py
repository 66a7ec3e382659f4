"""Calibrations in the catalogue: immutable versions of a vehicle's sensor parameters, and the
calibration that each flight is bound to."""

from collections.abc import Iterable, Mapping
from typing import Any

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import NAMES_COMPARED, Ledger
from aerodb.storage.catalogue.rows import CalibrationRow


class CalibrationLedger(Ledger):
    """Catalogue queries about calibrations."""

    def add_calibration(
        self,
        id: str,
        *,
        vehicle: str,
        content: Mapping[str, Any],
        reason: str,
        run: str | None = None,
    ) -> CalibrationRow:
        """Store a calibration under the vehicle's next label, with the newest one as its parent.

        An id that is stored already changes nothing and gives the stored row. InputError without a
        reason, UnknownNameError for the vehicle; values in `content` are in SI units.
        """
        enc.checked_key(id, "the id of a calibration")
        if not reason.strip():
            raise InputError(
                "a calibration requires a reason", f"vehicle {vehicle}", "add --reason TEXT"
            )
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            stored = _rows(connection, s.calibrations.c.id == id)
            if not stored:
                before = _rows(connection, s.calibrations.c.vehicle == vehicle)
                values = {
                    "id": id,
                    "vehicle": vehicle,
                    "number": before[-1].number + 1 if before else 1,
                    "parent": before[-1].id if before else None,
                    "content": enc.to_json(dict(content)),
                    "created_utc": enc.time_text(enc.now()),
                    "run": run,
                    "reason": enc.plain_text(reason),
                }
                connection.execute(sa.insert(s.calibrations).values(values))
                stored = _rows(connection, s.calibrations.c.id == id)
            return stored[0]

    def calibrations(self, vehicle: str) -> tuple[CalibrationRow, ...]:
        """Return all calibrations of a vehicle, oldest first, values in SI units; UnknownNameError
        where it is not known."""
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            return tuple(_rows(connection, s.calibrations.c.vehicle == vehicle))

    def calibration(self, vehicle: str, ref: str) -> CalibrationRow:
        """Return the calibration referred to by `ref`: its id, its label (``c0003``) or a unique
        prefix of its id. UnknownNameError where there is none, or several."""
        rows = self.calibrations(vehicle)
        exact = [row for row in rows if ref in (row.id, row.label)]
        if exact:
            return exact[0]
        mine = s.calibrations.c.vehicle == vehicle
        with self._database.reading() as connection:
            id = (
                self._by_prefix(connection, s.calibrations.c.id, ref, mine)
                if enc.REFERENCE.fullmatch(ref)
                else None
            )
        for row in rows:
            if row.id == id:
                return row
        labels = [row.label for row in rows[-NAMES_COMPARED:]]
        remedy = (
            nearest(ref[:128], labels)
            if labels
            else f"create one: aerodb recalibrate --vehicle {vehicle} --reason TEXT"
        )
        raise UnknownNameError(
            f"unknown calibration {enc.shown(ref)}", f"vehicle {vehicle}", remedy
        )

    def bind_flight(self, flight: str, calibration: str, run: str | None = None) -> None:
        """Bind a flight (its id) to a calibration (its id); the same binding again changes nothing.

        UnknownNameError for the flight. InputError when the calibration does not belong to the
        flight's vehicle. Table `flight_calibrations`.
        """
        with self._database.writing() as connection:
            self._require_flight(connection, flight)
            owner = connection.execute(
                sa.select(s.flights.c.vehicle).where(s.flights.c.id == flight)
            ).scalar()
            named = _rows(connection, s.calibrations.c.id == calibration)
            if not named or named[0].vehicle != owner:
                raise InputError(
                    f"calibration {enc.shown(calibration)} does not belong to vehicle '{owner}'",
                    f"flight {flight[:12]}",
                )
            if _bound(connection, flight) != calibration:
                values = {
                    "flight": flight,
                    "calibration": calibration,
                    "at_utc": enc.time_text(enc.now()),
                    "run": run,
                }
                connection.execute(sa.insert(s.flight_calibrations).values(values))

    def calibration_of(self, flight: str) -> CalibrationRow | None:
        """Return the calibration that a flight (its id) is bound to; None when it was processed
        without one."""
        with self._database.reading() as connection:
            bound = _bound(connection, flight)
            return None if bound is None else _rows(connection, s.calibrations.c.id == bound)[0]

    def flights_bound_to(self, calibration: str) -> tuple[str, ...]:
        """Return the ids of the flights that are bound to a calibration (its id) now, by
        `flight_calibrations`; StoreBusyError while the catalogue is locked."""
        c = s.flight_calibrations.c
        newest = sa.select(sa.func.max(c.sequence)).group_by(c.flight).scalar_subquery()
        query = (
            sa.select(c.flight)
            .where(c.calibration == calibration, c.sequence.in_(newest))
            .order_by(c.sequence)
        )
        with self._database.reading() as connection:
            return tuple(connection.scalars(query))


def _bound(connection: sa.Connection, flight: str) -> str | None:
    c = s.flight_calibrations.c
    return connection.execute(
        sa.select(c.calibration).where(c.flight == flight).order_by(c.sequence.desc()).limit(1)
    ).scalar()


def _rows(connection: sa.Connection, where: sa.ColumnElement[bool]) -> list[CalibrationRow]:
    rows: Iterable[Any] = connection.execute(
        sa.select(s.calibrations).where(where).order_by(s.calibrations.c.number)
    )
    return [_row(row) for row in rows]


def _row(row: Any) -> CalibrationRow:
    values = {
        **row._mapping,
        "content": enc.from_json(row.content),
        "created_utc": enc.time_of(row.created_utc),
    }
    return CalibrationRow(**values)
