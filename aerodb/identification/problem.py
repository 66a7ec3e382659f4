"""Flights as methods take them, and a method's fits over all declared increments."""

from collections.abc import Sequence
from dataclasses import dataclass

from aerodb.coefficients import Coefficients, Comparison
from aerodb.estimation import Fit
from aerodb.flight import Flight
from aerodb.identification.equations import axis_equations
from aerodb.identification.methods import Method
from aerodb.increments import ModelFile
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class IdentificationFlight:
    """A consistent flight with what the methods need of it.

    Parameters
    ----------
    comparison : with the database that the increments are declared on.
    coefficients : of the flight, in the vehicle's geometry.
    windows : stretches that dynamic methods fly, from and to [s] from the first sample.
    """

    flight: Flight
    comparison: Comparison
    coefficients: Coefficients
    vehicle: Vehicle
    windows: tuple[tuple[float, float], ...]


def fits_of(
    method: Method,
    flights: Sequence[IdentificationFlight],
    model: ModelFile,
    database: AeroDatabase,
) -> list[Fit]:
    """Fits of a method over all declared increments: one per axis of equation error, or one.

    Raises InputError where the method cannot give any.
    """
    function = method.load()
    equations = axis_equations(
        [f.flight for f in flights], [f.comparison for f in flights], model, database
    )
    return [function(equation) for equation in equations]
