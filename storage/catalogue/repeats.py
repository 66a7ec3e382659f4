"""Fingerprint marks of flights in the catalogue, and flights that repeat samples of others.

A new flight looks up its own marks, so the cost does not depend on the number of stored flights.
"""

from collections.abc import Iterable
from dataclasses import asdict

import sqlalchemy as sa

from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger, in_parts
from aerodb.storage.catalogue.rows import RepeatedStretch, RepeatRow


class RepeatLedger(Ledger):
    """Catalogue queries about flights that share samples."""

    def add_marks(self, flight: str, marks: Iterable[int]) -> None:
        """Store the marks (whole numbers below 2^63) of a flight (its id), in addition to those
        that it has: table `flight_fingerprints`. UnknownNameError for an unknown flight."""
        c = s.flight_fingerprints.c
        with self._database.writing() as connection:
            self._require_flight(connection, flight)
            for part in in_parts(set(marks)):
                known = connection.scalars(
                    sa.select(c.mark).where(c.mark.in_(part), c.flight == flight)
                ).all()
                rows = [{"mark": mark, "flight": flight} for mark in sorted(set(part) - set(known))]
                if rows:
                    connection.execute(sa.insert(s.flight_fingerprints), rows)

    def flights_with_marks(self, marks: Iterable[int], vehicle: str) -> dict[str, int]:
        """Return id -> how many of `marks` it has, for flights of a vehicle that have any."""
        f = s.flight_fingerprints.c
        counts: dict[str, int] = {}
        with self._database.reading() as connection:
            for part in in_parts(set(marks)):
                query = (
                    sa.select(f.flight, sa.func.count().label("marks"))
                    .where(f.mark.in_(part))
                    .group_by(f.flight)
                )
                for row in connection.execute(query):
                    counts[row.flight] = counts.get(row.flight, 0) + row.marks
            flown = {
                id
                for ids in in_parts(counts)
                for id in connection.scalars(
                    sa.select(s.flights.c.id).where(
                        s.flights.c.vehicle == vehicle, s.flights.c.id.in_(ids)
                    )
                )
            }
        return {flight: count for flight, count in counts.items() if flight in flown}

    def add_repeat(self, repeat: RepeatRow) -> None:
        """Record that a flight repeats samples of another. The newest record of a pair counts; the
        same record again changes nothing. Shares are dimensionless, stretches in [s];
        UnknownNameError for an unknown flight."""
        text = enc.to_json([asdict(stretch) for stretch in repeat.stretches])
        values = {
            "flight": repeat.flight,
            "original": repeat.original,
            "share": float(repeat.share),
            "stretches": text,
        }
        with self._database.writing() as connection:
            for id in (repeat.flight, repeat.original):
                self._require_flight(connection, id)
            if repeat not in self.repeats([repeat.flight]):
                connection.execute(
                    sa.insert(s.flight_repeats).values(
                        {**values, "at_utc": enc.time_text(enc.now())}
                    )
                )

    def repeats(
        self, flights: Iterable[str] | None = None, vehicle: str | None = None
    ) -> tuple[RepeatRow, ...]:
        """Return repetitions: of these flights (ids), or of all of a vehicle, in the order in which
        they were found. See `RepeatRow`: shares dimensionless, stretches [s]."""
        c = s.flight_repeats.c
        query = sa.select(c.flight, c.original, c.share, c.stretches).order_by(c.sequence)
        if vehicle is not None:
            query = query.join(s.flights, s.flights.c.id == c.flight).where(
                s.flights.c.vehicle == vehicle
            )
        with self._database.reading() as connection:
            queries = (
                [query]
                if flights is None
                else [query.where(c.flight.in_(part)) for part in in_parts(set(flights))]
            )
            rows = [row for one in queries for row in connection.execute(one)]
        newest = {(row.flight, row.original): row for row in rows}
        return tuple(
            _repeat(row.flight, row.original, row.share, row.stretches) for row in newest.values()
        )


def _repeat(flight: str, original: str, share: float, stretches: str) -> RepeatRow:
    return RepeatRow(
        flight,
        original,
        share,
        tuple(RepeatedStretch(**entry) for entry in enc.from_json(stretches)),
    )
