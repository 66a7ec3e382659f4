"""The flow about a vehicle that rotors carry and whose log has no airspeed."""

from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.support import Dual, body_to_earth
from aerodb.vehicle.description import Vehicle

_EARTH = ("velocity_north", "velocity_east", "velocity_down")
_ATTITUDE = ("phi", "theta", "psi")
_WIND = ("wind_north", "wind_east", "wind_down")
#: Airspeed and flow angles.
FLOW: Final = ("V", "alpha", "beta")

#: Command, in size, beyond which no motor is told to turn: pulses are rounded to a thousandth of
#: their range, and no autopilot tells more than the whole.
FULL: Final = 1.02


def lacks_airspeed(flight: Flight, vehicle: Vehicle) -> bool:
    """Return whether the vehicle has rotors, and the flight velocity over the earth and attitude,
    each (n,), but no airspeed of a sensor."""
    known = all(name in flight for name in (*_EARTH, *_ATTITUDE))
    return bool(vehicle.rotors) and known and ("V" not in flight or "V" in flight.estimated)


def with_flow_over_ground(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight with V [m/s], alpha and beta [rad] (n,) from the velocity over the earth,
    where it `lacks_airspeed`: less the wind that is logged, else in still air.

    They are `estimated`, and flagged where a source is.
    """
    if not lacks_airspeed(flight, vehicle):
        return flight
    winds = [name for name in _WIND if name in flight]
    past = [flight[name] for name in _EARTH]
    for name in winds:
        past[_WIND.index(name)] = past[_WIND.index(name)] - flight[name]
    rows = body_to_earth(*(Dual(flight[name], {}) for name in _ATTITUDE))
    u, v, w = (sum(rows[j][k].value * past[j] for j in range(3)) for k in range(3))
    speed = np.sqrt(u**2 + v**2 + w**2)
    flow = {"V": speed, "alpha": np.arctan2(w, u), "beta": np.arctan2(v, np.hypot(u, w))}
    sources = (*_EARTH, *_ATTITUDE, *winds)
    bits = [flight.flags[name] for name in sources if name in flight.flags]
    flags = {name: np.bitwise_or.reduce(bits) for name in FLOW if bits}
    air = "less the logged wind" if winds else "in still air"
    note = f"V, alpha and beta from the velocity over the earth, {air}: no airspeed is logged"
    return replace(
        flight.with_channels(flow),
        flags={**{k: f for k, f in flight.flags.items() if k not in FLOW}, **flags},
        notes=flight.notes if note in flight.notes else (*flight.notes, note),
        estimated=flight.estimated | set(FLOW),
    )


def without_flow_over_ground(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight without what `with_flow_over_ground` added, (n,), and what follows from
    it: no sensor measures it."""
    if not lacks_airspeed(flight, vehicle) or "V" not in flight:
        return flight
    gone = (*FLOW, "qbar", "mach")
    return replace(
        flight,
        channels={k: values for k, values in flight.channels.items() if k not in gone},
        flags={k: bits for k, bits in flight.flags.items() if k not in gone},
        estimated=flight.estimated - set(FLOW),
    )
