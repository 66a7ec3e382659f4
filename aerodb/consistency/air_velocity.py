"""Velocity of the air over the earth along a flight: what moved it, seen from its own path."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.physics import quaternion_from_euler, to_earth
from aerodb.support import Array
from aerodb.vehicle import Vehicle, cg_positions

#: Channels from which it follows, with `psi` taken as zero where it is not logged.
OVER_GROUND = ("velocity_north", "velocity_east", "velocity_down")


def air_velocity(flight: Flight, despite: Sequence[str] = ()) -> Array:
    """Return the velocity of the air (3, n) [m/s]: over the earth minus through the air.

    A flow angle that the flight lacks is taken as zero; samples that are not usable are NaN.
    despite : flags (keys of FLAGS) to ignore. Raises InputError naming what the flight lacks.
    """
    needed = ("V", "phi", "theta", "psi", *OVER_GROUND)
    lacking = [name for name in needed if name not in flight]
    if lacking:
        raise InputError(
            f"the flight lacks {', '.join(lacking)}",
            f"flight {flight.id[:12]}",
            "the motion of the air follows from airspeed, attitude and velocity over the earth",
        )
    zero = np.zeros(len(flight.time))
    angles = [name for name in ("alpha", "beta") if name in flight]
    alpha, beta = (flight[name] if name in angles else zero for name in ("alpha", "beta"))
    V = flight["V"]
    through = V * np.stack(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )
    attitude = quaternion_from_euler(flight["phi"], flight["theta"], flight["psi"])
    moved = np.stack([flight[name] for name in OVER_GROUND]) - to_earth(attitude, through)
    return np.where(flight.usable([*needed, *angles], despite), moved, np.nan)


def probe_path(flight: Flight, vehicle: Vehicle, inside: NDArray[np.bool_]) -> Array:
    """Return north, east, altitude (3, m) [m] of the air-data probe over the samples `inside` (n,),
    from where they begin: the velocity over the earth, integrated, so that no position need be
    logged. Raises UnknownNameError for a channel that the flight lacks."""
    velocity = np.nan_to_num(np.stack([flight[name][inside] for name in OVER_GROUND]))
    moved = 0.5 * flight.step * (velocity[:, 1:] + velocity[:, :-1])
    path = np.concatenate([np.zeros((3, 1)), np.cumsum(moved, axis=1)], axis=1)
    probe = vehicle.points.air_data
    if probe is not None:
        attitude = quaternion_from_euler(
            *(np.nan_to_num(flight[name][inside]) for name in ("phi", "theta", "psi"))
        )
        arm = np.asarray(probe)[:, None] - np.nan_to_num(cg_positions(flight, vehicle)[inside].T)
        path = path + to_earth(attitude, arm)
    path[2] *= -1.0
    return np.asarray(path)
