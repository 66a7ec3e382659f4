"""Captive flight: while a carrier holds the vehicle, its motion is good for kinematics and says
nothing of its aerodynamics."""

from collections.abc import Iterable

import numpy as np

from aerodb.flight import Flight


def flag_captive(flight: Flight, times: Iterable[tuple[float, float]] = ()) -> Flight:
    """The flight flagged ``captive`` as a whole where its channel ``captive`` says so, or within
    declared `times`.

    times : (start, end) in seconds on the flight's clock. Where the channel is not known, the
    vehicle is taken as held: what follows from free flight alone must not rest on a guess.
    `Flight.usable` leaves such samples out unless told otherwise (``despite=("captive",)``), which
    flight-path reconstruction may do.
    """
    held = np.zeros(len(flight.time), dtype=bool)
    if "captive" in flight:
        held |= ~(flight["captive"] < 0.5)
    for start, end in times:
        held |= (flight.time >= start) & (flight.time <= end)
    return flight.with_flag("flight", "captive", held) if held.any() else flight
