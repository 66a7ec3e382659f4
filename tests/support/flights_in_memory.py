"""A source of flights that stand in no store, for the closed loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from aerodb.coefficients import Coefficients
from aerodb.coefficients.comparison import Comparison, compare
from aerodb.conditioning.segmentation import Segment, segments
from aerodb.flight import Flight
from aerodb.loop import Library, ReconstructionErrors, WithoutStore
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class FlightsInMemory(WithoutStore):
    """Flights and their coefficients, by id; implements `FlightSource`. known : what earlier looks
    had, as `looked_before`."""

    vehicle: Vehicle
    flown: Mapping[str, tuple[Flight, Coefficients]]
    known: frozenset[str] | None = None

    def flight(self, flight: str) -> Flight:
        return self.flown[flight][0]

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        return ReconstructionErrors()

    def segments(self, flight: str) -> tuple[Segment, ...]:
        return segments(self.flown[flight][0])

    def comparison(self, flight: str, database: AeroDatabase) -> Comparison:
        channels, coefficients = self.flown[flight]
        return compare(channels, coefficients, database, self.vehicle.reference)

    def looked_before(self, flights: Sequence[str], library: Library) -> frozenset[str] | None:
        return self.known
