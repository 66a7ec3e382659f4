"""Stretches in which a whole record stands still: every channel repeats its value."""

from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.signals import runs

#: Shortest such stretch that is told [s]: recorders that log slower than others repeat less.
SHORTEST_FROZEN: Final = 1.0
#: What an aircraft in flight changes with every sample.
_MOTION: Final = ("p", "q", "r", "phi", "theta", "psi", "alpha", "beta", "ax", "ay", "az")


def frozen(flight: Flight) -> list[tuple[int, int]]:
    """Return the first and the last sample of each stretch in which all rates, angles and
    accelerations that change in the flight repeat their values, and after which they go on.

    A simulated flight may begin in perfect trim. Channels are (n,) in any unit; fewer than four
    that move tell nothing.
    """
    moving = [n for n in flight.channels if n in _MOTION or n.removesuffix("_imu") in _MOTION]
    moving = [name for name in moving if np.ptp(flight[name]) > 0.0]
    least = max(2, round(SHORTEST_FROZEN / flight.step))
    if len(moving) < 4:
        return []
    same = np.ones(len(flight.time) - 1, dtype=bool)
    for name in moving:
        values = flight[name]
        same &= values[1:] == values[:-1]
    return [
        (first, last + 1)
        for first, last in runs(same, least)
        if first > 0 and last + 2 < len(flight.time)
    ]
