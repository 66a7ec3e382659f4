"""What sensors that were found to be wrong leave in a comparison."""

import numpy as np

from aerodb.coefficients import total_coefficients
from aerodb.loop import freeze_library
from aerodb.loop.sensor_share import without_sensors
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory


def test_an_accelerometer_that_is_off_leaves_nothing_on_any_axis() -> None:
    source, known, off = flights(range(60, 62), 0.0), database(1.0), 0.1  # m/s2
    ids, seen = tuple(source.flown), {}
    for id, (flight, _) in source.flown.items():
        high = flight.with_channels({"az": flight["az"] + off})
        made = total_coefficients(high, source.vehicle, angular_acceleration="logged")
        seen[id] = (high, made)
    wrong = FlightsInMemory(source.vehicle, seen)
    library = freeze_library(wrong, ids, known)
    right = without_sensors(wrong, ids, known, library, {"accelerometer_bias@all:z": off})
    for id in ids:
        before, after, truth = wrong.comparison(id, known), right[id], source.comparison(id, known)
        for axis in ("CZ", "C_lift", "C_drag", "Cm"):
            usable = before.usable[axis] & truth.usable[axis]
            added, left = (
                np.abs((each.residual(axis) - truth.residual(axis))[usable]).max()
                for each in (before, after)
            )
            assert added > 1e-4, axis
            assert left <= 0.01 * added, axis
    assert without_sensors(wrong, ids, known, library, {}).keys() == right.keys()
