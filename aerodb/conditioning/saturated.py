"""Sensors that stand at the end of their range, or of that of their channel: clipped.

What is measured with noise reaches its largest value once. A channel that comes back to the same
largest or least value, and stays there, shows no motion beyond it. One in coarse steps, or one that
is logged slower, stands still elsewhere as well.
"""

from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.signals import runs
from aerodb.support import SMALL, Mask

#: What an aircraft in flight moves with every sample, and no stop holds but the sensor's own.
CLIPPED: Final = (
    *("p", "q", "r", "alpha", "beta"),
    *("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu"),
)
#: Fewest equal samples in a row that stand still: noise repeats one value now and then.
HELD: Final = 3
#: Fewest times that a channel comes to the end of its range: one that stands there once failed.
TIMES: Final = 2


def saturated(flight: Flight, name: str) -> Mask:
    """Return the samples (n,) at which a channel of the flight, in any unit, stands at its largest
    or least value.

    None where it does so once, or stands still elsewhere for a tenth as long. Samples on the ground
    are left out, and those at which nothing moves, as in the trim of a simulation.
    """
    values, found = flight[name], np.zeros(len(flight.time), dtype=bool)
    good = flight.usable([name], despite=("stuck", "implausible", "saturated"))
    if not good.any() or np.ptp(values[good]) == 0.0:
        return found
    moving = np.zeros(len(values) - 1, dtype=bool)
    for other in CLIPPED:
        if other in flight and other.removesuffix("_imu") != name.removesuffix("_imu"):
            moving |= np.diff(flight[other]) != 0.0
    still = moving & good[1:] & good[:-1] & (values[1:] == values[:-1])
    ends, elsewhere, times = {values[good].min(), values[good].max()}, 0, 0
    for first, last in runs(still, HELD - 1):
        if values[first] in ends:
            found[first : last + 2] = True
            times += 1
        else:
            elsewhere += last + 2 - first
    clipped = times >= TIMES and elsewhere <= SMALL * float(found.sum())
    return np.asarray(found & clipped)


def flag_saturated(flight: Flight) -> Flight:
    """Return the flight, its channels (n,) in SI units, with ``saturated`` flagged where a sensor
    stands at an end of its range."""
    for name in CLIPPED:
        if name in flight and (where := saturated(flight, name)).any():
            flight = flight.with_flag(name, "saturated", where)
    return flight
