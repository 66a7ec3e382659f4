"""Air data from where the probe sits to the centre of gravity: rotation moves a nose boom through the air."""

from dataclasses import replace

import numpy as np

from aerodb.flight import Array, Flight
from aerodb.vehicle import Vehicle, mass_channels


def velocity_at_cg(velocity: Array, rates: Array, arm: Array) -> Array:
    """Air-relative velocity at the CG from that at the probe, ``v - w x r``.

    All (n, 3): velocity m/s, rates rad/s, arm r from the CG to the probe, m, body axes. Klein & Morelli (2006), chapter 10.

    >>> velocity_at_cg(np.array([[50.0, 0.0, 4.0]]), np.array([[0.0, 0.5, 0.0]]), np.array([[2.0, 0.0, 0.0]])).tolist()
    [[50.0, 0.0, 5.0]]
    """
    moved: Array = velocity - np.cross(rates, arm)
    return moved


def air_data_at_cg(flight: Flight, vehicle: Vehicle) -> Flight:
    """The flight with V, alpha and beta moved from the vehicle's air-data point to the CG, with a note.

    Unchanged where the vehicle file names no such point (the log's air data are then taken to be at the CG), or where
    airspeed, angle of attack, rates or the CG are not logged; the last is noted. Without beta the sideslip is taken as zero.
    """
    if vehicle.points.air_data is None:
        return flight
    absent = [name for name in ("V", "alpha", "p", "q", "r") if name not in flight]
    if absent:
        note = f"air data stay those at the probe: {', '.join(absent)} not logged"
        return replace(flight, notes=(*flight.notes, note))
    speed, alpha = flight["V"], flight["alpha"]
    beta = flight["beta"] if "beta" in flight else np.zeros_like(alpha)
    velocity = speed * np.stack([np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)])
    properties = mass_channels(flight, vehicle)
    arm = np.asarray(vehicle.points.air_data) - np.column_stack([properties[f"cg_{axis}"] for axis in "xyz"])
    u, v, w = velocity_at_cg(velocity.T, np.column_stack([flight[name] for name in "pqr"]), arm).T
    total = np.sqrt(u * u + v * v + w * w)
    with np.errstate(invalid="ignore", divide="ignore"):
        moved = {"V": total, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / total)}
    moved = {name: values for name, values in moved.items() if name in flight}
    flags = dict(flight.flags)
    for name in moved:
        bits = [flight.flags[source] for source in (name, "p", "q", "r") if source in flight.flags]
        if bits:
            flags[name] = np.bitwise_or.reduce(bits)
    names = ", ".join(moved)
    return replace(flight.with_channels(moved), flags=flags, notes=(*flight.notes, f"{names} moved from the probe to the CG"))
