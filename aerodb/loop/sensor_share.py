"""What sensors and vehicle data that were found to be wrong leave in a comparison.

It is no error of the database: what is judged by the size of an error, a constant or the gain of an
increment model, is judged without it. docs/method/tracing.md, sections 13 and 27.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from aerodb.coefficients import Comparison
from aerodb.conditioning import Segment
from aerodb.effects import with_wind
from aerodb.flight import Flight
from aerodb.loop.flight_source import FlightSource, ReconstructionErrors, on_each
from aerodb.loop.frozen_library import Library
from aerodb.loop.without_store import WithoutStore
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tracing import Finding
from aerodb.vehicle import Vehicle


def found_sensors(findings: Collection[Finding]) -> dict[str, float]:
    """Return the ids of the sensors that were found to be wrong, and by how much, in the unit of
    each hypothesis (SI)."""
    return {each.hypothesis: each.value for each in findings if each.verdict == "sensor"}


def beside_sensors(
    source: FlightSource,
    flights: Collection[str],
    database: AeroDatabase,
    library: Library,
    sensors: Mapping[str, float],
) -> FlightSource:
    """Return these flights (ids) without what sensors that were found to be wrong (id -> error, SI)
    leave in them; the source itself without any.

    database : of the comparison in which this is told. Raises InputError where a flight lacks what
    is needed.
    """
    if not sensors:
        return source
    return _BesideSensors(source, _shares(source, flights, database, library, sensors))


@dataclass(frozen=True, eq=False)
class _BesideSensors(WithoutStore):
    """Flights of another source, without shares (flight -> axis -> (n,)) of their measured
    coefficients."""

    source: FlightSource
    shares: Mapping[str, Mapping[str, Array]]

    @property
    def vehicle(self) -> Vehicle:
        return self.source.vehicle

    def flight(self, flight: str) -> Flight:
        return self.source.flight(flight)

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        return self.source.reconstruction(flight)

    def segments(self, flight: str) -> tuple[Segment, ...]:
        return self.source.segments(flight)

    def comparison(self, flight: str, database: AeroDatabase) -> Comparison:
        return _less_share(self.source.comparison(flight, database), self.shares[flight])


def compared_with(
    source: FlightSource, flights: Collection[str], database: AeroDatabase
) -> dict[str, Comparison]:
    """Return flight (id) -> its comparison with a database.

    Coefficients are (n,), dimensionless.
    """
    return {id: source.comparison(id, database) for id in flights}


def _shares(
    source: FlightSource,
    flights: Collection[str],
    database: AeroDatabase,
    library: Library,
    sensors: Mapping[str, float],
) -> dict[str, Mapping[str, Array]]:
    """Return flight (id) -> axis -> what these sensors (id -> error, SI) add to the measured
    coefficients (n,): of the loads as measured, so that what the database lacks is no part of it.

    Raises InputError where a flight lacks what is needed.
    """
    found = [(each, sensors[each.id]) for each in library.hypotheses if each.id in sensors]

    def one(flight: str) -> Mapping[str, Array]:
        share = dict[str, Array]()
        if found:
            view = source.view(flight, database).as_measured()
            for hypothesis, value in found:
                for axis, column in with_wind(view, hypothesis.columns(view)).items():
                    share[axis] = share.get(axis, 0.0) + value * column
        return share

    return dict(zip(flights, on_each(source, tuple(flights), one), strict=True))


def _less_share(compared: Comparison, share: Mapping[str, Array]) -> Comparison:
    """Return a comparison without a share (axis -> (n,)) of the measured coefficients."""
    if not share:
        return compared
    measured = {
        axis: values - share[axis] if axis in share else values
        for axis, values in compared.measured.items()
    }
    return replace(compared, measured=measured)
