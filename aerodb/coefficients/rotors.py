"""What the rotors of a flight say beside a database: the flight's coefficients, compared."""

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.suspicions import rotor_suspicions
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle


def rotors_beside(
    flight: Flight, vehicle: Vehicle, database: AeroDatabase
) -> tuple[Suspicion, ...]:
    """Return the answer of `rotor_suspicions` for a flight that has its mass channels.

    Raises InputError as `total_coefficients` and `compare` do.
    """
    coefficients = total_coefficients(flight, vehicle)
    compared = compare(flight, coefficients, database, vehicle.reference)
    return rotor_suspicions(*compared.beside(flight, database))
