"""A flight as the methods take it."""

from dataclasses import dataclass

from aerodb.coefficients import Coefficients, Comparison
from aerodb.flight import Flight
from aerodb.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class IdentificationFlight:
    """A consistent flight with what the methods need of it.

    Parameters
    ----------
    comparison : with the database that the increments are declared on.
    coefficients : of the flight, in the vehicle's geometry.
    windows : stretches that dynamic methods fly, from and to [s] from the first sample.
    estimated : channels that no sensor measured but an estimator made.
    """

    flight: Flight
    comparison: Comparison
    coefficients: Coefficients
    vehicle: Vehicle
    windows: tuple[tuple[float, float], ...]
    estimated: frozenset[str] = frozenset()
