"""A source of flights that stand in no store, for the closed loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.coefficients import Coefficients, total_coefficients
from aerodb.coefficients.comparison import Comparison, compare
from aerodb.conditioning.segmentation import Segment, segments
from aerodb.flight import Flight
from aerodb.loop import Library, ReconstructionErrors, WithoutStore
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle
from tests.support import effect_flights
from tests.support.tracing_flights import FLOOR, coloured


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


def noisy_flights(
    seeds: range, truth: AeroDatabase, rng: np.random.Generator, noise: float = 1.0
) -> FlightsInMemory:
    """Flights of an aircraft, one per seed, side by side; coloured and white noise on all
    coefficients, `noise` times as large as usual."""
    vehicle, flown = effect_flights.vehicle(), {}
    for flight in effect_flights.flown_together(seeds, truth, vehicle):
        made = total_coefficients(flight, vehicle, angular_acceleration="logged")
        n = len(flight.time)
        noisy = {
            axis: values
            + noise * FLOOR[axis] * (coloured(rng, n, step=flight.step) + rng.standard_normal(n))
            for axis, values in made.values.items()
        }
        flown[flight.id] = (flight, replace(made, values=noisy))
    return FlightsInMemory(vehicle, flown)
