"""What sources of flights that stand in no store have in common."""

from collections.abc import Mapping, Sequence

from aerodb.effects import FlightView, view_of
from aerodb.increments import NoiseFloor
from aerodb.loop.evidence import normal_equations_beside
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.noise_floor import noise_floors_of
from aerodb.tables import AeroDatabase
from aerodb.tracing import FlightNormalEquations, thinned


class WithoutStore:
    """The part of a `FlightSource` that follows from its other methods where nothing is kept; for a
    class to inherit."""

    def view(
        self: FlightSource, flight: str, database: AeroDatabase, bandwidth: float | None = None
    ) -> FlightView:
        """Return a flight compared with a database, at the rate that tracing at `bandwidth` [Hz]
        needs."""
        given = self.flight(flight), self.comparison(flight, database)
        if bandwidth is not None:
            given = thinned(*given, bandwidth)
        return view_of(*given, database, self.vehicle)

    def noise_floors(
        self: FlightSource, flights: Sequence[str], database: AeroDatabase
    ) -> dict[str, Mapping[str, NoiseFloor]]:
        """Return flight (id) -> axis -> error that remains if a database is right,
        dimensionless."""
        return noise_floors_of(self, flights, database)

    def normal_equations(
        self: FlightSource, flights: Sequence[str], database: AeroDatabase, library: Library
    ) -> list[FlightNormalEquations]:
        """Return the normal equations of flights compared with a database: `matrix` (k, k),
        whitened. Raises InputError where no axis is usable."""
        return normal_equations_beside(self, flights, database, library)

    def looked_before(self, flights: Sequence[str], library: Library) -> frozenset[str] | None:
        """Return None: flights of which nothing is kept were not traced before."""
        return None
