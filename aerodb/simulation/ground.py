"""On the ground: where legs begin to carry, and the standstill that ends a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.parts import STANDING, contact_points
from aerodb.simulation.engine import Simulation
from aerodb.support import Array
from aerodb.tables import AeroDatabase

#: Speed over the ground [m/s] from which a run counts as moving: one that settles on its springs
#: does not.
_MOVING: Final = 1.0
#: Speed over the ground [m/s] down to which friction is whole.
_WHOLE: Final = 4.0 * STANDING


@dataclass(frozen=True)
class Standstill:
    """The end of a ground roll.

    time : since the start [s]. distance : over the ground since the start [m]. samples : those of
    the run before it.
    """

    time: float
    distance: float
    samples: int


def carrying_height(database: AeroDatabase, cg_z: float) -> float:
    """Return a height [m] of the centre of gravity (`cg_z` [m] below the vehicle's datum) above
    ground at which all legs touch it, level.

    Raises InputError for a database without legs.
    """
    points = contact_points(database)
    if not len(points):
        raise InputError(
            "it has no legs",
            f"database {database.name}",
            'a start on the ground needs parts of kind "leg"',
        )
    return float(points[:, 2].min()) - cg_z


def vertical(rates: Array, phi: Array, theta: Array) -> Array:
    """Return the rate (k,) [m/s2] of the velocity down, of rates (3, k) of u, v, w [m/s2] without
    rotation, at attitudes (k,) [rad]."""
    u, v, w = rates
    level = v * np.sin(phi) + w * np.cos(phi)
    return np.asarray(level * np.cos(theta) - u * np.sin(theta))


def touching(channels: Mapping[str, Array], points: Array) -> NDArray[np.bool_]:
    """Return where (...) a leg touches the ground, from phi, theta [rad] and height_above_ground
    [m], (...) each.

    points : (m, 3) contact points [m], body axes from the centre of gravity.
    """
    phi, theta = channels["phi"], channels["theta"]
    down = np.stack([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    below = np.tensordot(points, down, axes=1)
    return np.asarray((below > channels["height_above_ground"]).any(axis=0))


def forward(channels: Mapping[str, Array]) -> Array:
    """Return the speed (...) [m/s] over the ground along the heading, from velocity_north,
    velocity_east [m/s] and psi [rad]."""
    north, east, psi = (channels[name] for name in ("velocity_north", "velocity_east", "psi"))
    return np.asarray(north * np.cos(psi) + east * np.sin(psi))


def standing(channels: Mapping[str, Array], points: Array) -> NDArray[np.bool_]:
    """Return where (...) a vehicle stands on its legs: `touching`, and not faster than
    `STANDING`."""
    slow = forward(channels) <= STANDING
    return slow & touching(channels, points) if slow.any() else slow


def standstill(run: Simulation, database: AeroDatabase, cg: Sequence[float]) -> Standstill | None:
    """Return when the first of several runs stands still on its legs, after it was moving; None
    where it does not.

    cg : (3,) centre of gravity [m] from the vehicle's datum.

    Its forward speed over the ground falls to `STANDING`, within which friction fades. So the end
    is that of the deceleration just before (`_WHOLE`), held until the speed is zero.
    """
    points = contact_points(database) - np.asarray(cg)
    if not len(points):
        return None
    channels = {name: values[: run.ended[0], 0] for name, values in run.channels.items()}
    speed = forward(channels)
    moved = np.maximum.accumulate(speed) > _MOVING
    ends = standing(channels, points)[1:] & moved[1:] & (speed[:-1] > STANDING)
    if not ends.any():
        return None
    last = int(np.flatnonzero(speed[: int(np.argmax(ends)) + 1] > _WHOLE)[-1])
    slows = (speed[last] - speed[last + 1]) / (run.time[last + 1] - run.time[last])
    time = float(run.time[last] + speed[last] / slows)
    north, east = (np.diff(channels[name][: last + 1]) for name in ("north", "east"))
    way = np.hypot(north, east).sum()
    return Standstill(
        time,
        float(way + 0.5 * speed[last] ** 2 / slows),
        int(np.searchsorted(run.time[: len(speed)], time, side="right")),
    )
