"""Place and speed over the ground, from whatever a log has of them."""

from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, POSITIONS, WHEELS
from aerodb.physics import Earth
from aerodb.support import Array

#: Flags that what moves over the ground may have.
_COUNTS: Final = ("on_ground",)
#: Time over which a speed is taken from positions [s].
_SPEED_WINDOW: Final = 4.0
#: Duration [s] over which the wind of a flight is taken as constant.
STEADY_WIND_TIME: Final = 300.0
#: Range of altitude [m] over which it is.
STEADY_WIND_ALTITUDE: Final = 300.0


def ground_speed(flight: Flight) -> Array | None:
    """Return the speed over the ground (n,) [m/s] from velocities, else from positions; None
    without both. Samples on the ground count."""
    names = ("velocity_north", "velocity_east")
    if all(name in flight and flight.usable([name], _COUNTS).any() for name in names):
        north, east = (np.where(flight.usable([n], _COUNTS), flight[n], np.nan) for n in names)
        return np.hypot(_filled(north), _filled(east))
    place = places(flight)
    if not place:
        return None
    window = min(round(_SPEED_WINDOW / flight.step) | 1, (len(flight.time) - 1) // 2 * 2 - 1)
    if window < 5:
        return None
    from scipy.signal import savgol_filter  # slow to import

    slopes = [savgol_filter(_filled(each), window, 2, 1, flight.step) for each in place.values()]
    return np.hypot(*slopes)


def wheel_speed(flight: Flight) -> Array | None:
    """Return the `ground_speed` (n,) [m/s] of a log that has commands of wheels; None for another:
    of one with wheels it tells where it rolls, also without airspeed."""
    if not any(name in flight for name in WHEELS):
        return None
    return ground_speed(flight)


def places(flight: Flight) -> dict[str, Array]:
    """Return the place north and east (n,) [m], NaN where it was not measured; empty without
    positions."""
    for names in POSITIONS:
        if all(name in flight for name in names) and (good := flight.usable(names, _COUNTS)).any():
            first, second = (np.where(good, flight[name], np.nan) for name in names)
            if "latitude" in names:
                at = int(np.argmax(good))
                earth = Earth(float(first[at]), float(second[at]))
                first, second = earth.to_local(first, second)
            return {"north": first, "east": second}
    return {}


def _filled(values: Array) -> Array:
    """Values (n,) with gaps bridged."""
    at = np.flatnonzero(np.isfinite(values))
    return np.asarray(np.interp(np.arange(len(values)), at, values[at]))


def despite_ground(flight: Flight) -> Flight:
    """The flight without the flag that would hide its time on the ground."""
    if "flight" not in flight.flags:
        return flight
    return replace(
        flight,
        flags={
            **flight.flags,
            "flight": flight.flags["flight"]
            & ~flight.flags["flight"].dtype.type(FLAGS["on_ground"]),
        },
    )
