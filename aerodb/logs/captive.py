"""Captive flight: while a carrier holds the vehicle, only its kinematics can be used."""

from collections.abc import Iterable

import numpy as np

from aerodb.flight import Flight


def flag_captive(flight: Flight, times: Iterable[tuple[float, float]] = ()) -> Flight:
    """Return the flight with samples of captive flight flagged ``captive`` for all channels.

    Captive is what the channel ``captive`` says, and what lies within declared `times`. Where the
    channel is not finite, the vehicle is taken as captive, so that no aerodynamic result rests on a
    guess. `Flight.usable` excludes these samples unless called with ``despite=("captive",)``, as
    flight-path reconstruction may do.

    Parameters
    ----------
    times : (start, end) in seconds on the flight's clock
    """
    held = np.zeros(len(flight.time), dtype=bool)
    if "captive" in flight:
        held |= ~(flight["captive"] < 0.5)
    for start, end in times:
        held |= (flight.time >= start) & (flight.time <= end)
    return flight.with_flag("flight", "captive", held) if held.any() else flight
