"""The band in which residuals are traced: up to a little above the rigid-body modes.

Above it there is no excitation.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tracing.settings import short_period_frequency
from aerodb.vehicle import Vehicle, mass_channels

#: The edge in natural frequencies of the fastest rigid-body mode (one to two are sensible:
#: docs/method/tracing.md, section 5).
FACTOR = 1.5
#: The least edge [Hz].
LEAST = 0.5
#: The edge in sampling rates, at most.
_OF_SAMPLING = 0.2
#: Step of the angle for the slopes, rad.
_STEP = 0.01


def tracing_bandwidth(database: AeroDatabase, vehicle: Vehicle, flights: Sequence[Flight]) -> float:
    """Edge of the low-pass [Hz] for a set of flights.

    FACTOR times the fastest of short period and Dutch roll, both undamped, from the database's
    slopes at the flights' median conditions; at least LEAST and at most a fifth of the sampling
    rate. docs/method/tracing.md, section 5.
    """
    reference = database.reference
    edges = [LEAST]
    for flight in flights:
        properties = mass_channels(flight, vehicle)
        condition = {
            name: np.array([_median(flight, name)])
            for name in database.flight_inputs
            if name in flight
        }
        # where the log lacks these, a comparison makes them from the angles; here the air is steady
        condition |= {
            name: np.zeros(1)
            for name in ("alphadot", "betadot")
            if name in database.flight_inputs and name not in flight
        }
        qbar = reference.pressure or _median(flight, "qbar")
        modes = (("Cm", "alpha", "Iyy", reference.chord), ("Cn", "beta", "Izz", reference.span))
        for axis, angle, inertia, length in modes:
            slope = _slope(database, axis, angle, condition)
            size = float(np.median(properties[inertia]))
            edges.append(FACTOR * short_period_frequency(slope, qbar, reference.area, length, size))
    fastest = min(_OF_SAMPLING / flight.step for flight in flights)
    return round(min(max(edges), fastest), 3)


def _median(flight: Flight, name: str) -> float:
    good = flight[name][flight.usable([name]) & np.isfinite(flight[name])]
    return float(np.median(good)) if len(good) else 0.0


def _slope(database: AeroDatabase, axis: str, angle: str, condition: Mapping[str, Array]) -> float:
    if angle not in condition:
        return 0.0
    low, high = ({**condition, angle: condition[angle] + side * _STEP} for side in (-1.0, 1.0))
    difference = (
        database.predict(high).coefficients[axis] - database.predict(low).coefficients[axis]
    )
    slope = float(difference[0]) / (2.0 * _STEP)
    return slope if np.isfinite(slope) else 0.0
