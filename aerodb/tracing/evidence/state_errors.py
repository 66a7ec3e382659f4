"""Add the reconstruction's state noise to a flight once more, for SIMEX.

docs/method/tracing.md, section 17.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodb.coefficients import Comparison, compare, total_coefficients
from aerodb.consistency import StateNoise
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle


def noisy_copies(
    flight: Flight,
    noise: StateNoise,
    database: AeroDatabase,
    vehicle: Vehicle,
    copies: int,
    near: Comparison | None = None,
) -> list[tuple[Flight, Comparison]]:
    """Return `copies` of a reconstructed flight, each with one more realisation of its state noise.

    Each copy comes with its comparison with the database. near : the flight's comparison where its
    channels no longer give it exactly (`thinned`): what the noise changes is added to it.

    With the state noise doubled, the bias of estimates doubles (Cook & Stefanski, JASA 89, 1994).
    The noise runs through the whole chain, coefficients and prediction alike; draws are seeded by
    the flight, so that they are the same on every machine.
    """
    seed = int.from_bytes(flight.id.encode()[:8].ljust(8, b"0"), "big")
    clean = (
        None
        if near is None
        else compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)
    )
    noisy = []
    for number in range(copies):
        drawn = noise.draw(
            np.random.default_rng([seed, number // 2]), len(flight.time), flight.step
        )
        sign = -1.0 if number % 2 else 1.0
        # The intercepts take what is constant; a mean of matrices with other means would not.
        centred = {name: sign * (error - error.mean()) for name, error in drawn.items()}
        copy = flight.with_channels(_added(flight, centred))
        beside = compare(copy, total_coefficients(copy, vehicle), database, vehicle.reference)
        noisy.append(
            (copy, beside if near is None or clean is None else _on_top(near, beside, clean))
        )
    return noisy


def _on_top(near: Comparison, beside: Comparison, clean: Comparison) -> Comparison:
    """The comparison `near` plus the difference of `beside` from `clean`."""

    def moved(
        base: Mapping[str, Array], to: Mapping[str, Array], start: Mapping[str, Array]
    ) -> dict[str, Array]:
        return {axis: base[axis] + (to[axis] - start[axis]) for axis in near.usable}

    measured = moved(near.measured, beside.measured, clean.measured)
    return replace(
        near, measured=measured, predicted=moved(near.predicted, beside.predicted, clean.predicted)
    )


def _added(flight: Flight, drawn: dict[str, Array]) -> dict[str, Array]:
    """The channels with their errors; rates of the flow angles are left to be derived from the
    angles.
    """
    return {name: flight[name] + error for name, error in drawn.items() if name in flight}
