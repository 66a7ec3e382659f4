"""A flight with the reconstruction's own state error added once more: what that error does to estimates (SIMEX)."""

import numpy as np

from aerodb.coefficients import total_coefficients
from aerodb.comparison import Comparison, compare
from aerodb.consistency.state_noise import StateNoise
from aerodb.flight import Array, Flight
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle


def noisy_copies(
    flight: Flight, noise: StateNoise, database: AeroDatabase, vehicle: Vehicle, copies: int
) -> list[tuple[Flight, Comparison]]:
    """`copies` of a consistent flight, each with one more realisation of its states' error, beside the database.

    Where the states are wrong twice as much, estimates are off twice as much (Cook & Stefanski, JASA 89, 1994). The error runs
    through the whole chain, coefficients and prediction alike; draws are seeded by the flight, so that they are the same on
    every machine.
    """
    seed = int.from_bytes(flight.id.encode()[:8].ljust(8, b"0"), "big")
    found = []
    for number in range(copies):
        drawn = noise.draw(np.random.default_rng([seed, number]), len(flight.time), flight.step)
        copy = flight.with_channels(_added(flight, drawn))
        measured = total_coefficients(copy, vehicle)
        found.append((copy, compare(copy, measured, database, vehicle.reference)))
    return found


def _added(flight: Flight, drawn: dict[str, Array]) -> dict[str, Array]:
    """The channels with their errors; rates of the flow angles are left to be made anew of the angles."""
    return {name: flight[name] + error for name, error in drawn.items() if name in flight}
