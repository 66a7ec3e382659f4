"""The sign of the drag: the air holds an aircraft back.

A logged thrust that is reversed, or in a unit larger than its own, leaves an air that pushes.
"""

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.suspicions.in_flight import flying, known_masses, middle
from aerodb.vehicle import Vehicle

#: What an accelerometer may err by in all of a flight [m/s^2]: errors above it have checks of their
#: own.
ACCELERATION = 0.2
#: The same of a flow angle [rad].
ANGLE = 0.035


def drag_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return a drag that pushes, as a median over a flight whose thrust is logged.

    Drag is ``-X cos(alpha) - Z sin(alpha)`` of the specific force without that of the thrust, in
    the plane of symmetry.

    Accelerations [m/s^2], thrust [N]. Source: `docs/method/consistency.md`, section "Against the
    vehicle". Channels are (n,).
    """
    x = next((name for name in ("ax", "ax_imu") if name in flight), "")
    z = next((name for name in ("az", "az_imu") if name in flight), "")
    lines, known = vehicle.thrust.lines, known_masses(flight, vehicle)
    needed = [x, z, "alpha", *lines]
    if vehicle.thrust.source != "channel" or any(name not in flight for name in needed):
        return ()
    if "mass" not in known:
        return ()
    thrust, along, normal = np.zeros(len(flight["alpha"])), flight[x], flight[z]
    for name, line in lines.items():
        direction: Array = np.asarray(line.direction, dtype=float)
        share = flight[name] / (known["mass"] * np.linalg.norm(direction))
        thrust, along, normal = (
            thrust + np.abs(share),
            along - share * direction[0],
            normal - share * direction[2],
        )
    cos, sin = np.cos(flight["alpha"]), np.sin(flight["alpha"])
    where = flying(flight, needed) & np.isfinite(along) & np.isfinite(normal)
    drag, lift = (
        middle(-along * cos - normal * sin, where),
        middle(along * sin - normal * cos, where),
    )
    margin = ACCELERATION + ANGLE * abs(lift)
    if not drag < -margin:
        return ()
    words = (
        f"without the thrust of {middle(thrust, where):.3g} N per kg the air would push the"
        f" aircraft forward by {-drag:.3g} N per kg. Sign, unit or direction of the thrust is"
        " wrong, or the mass, or alpha"
    )
    return (Suspicion("thrust", "sign", words, {"drag": drag, "margin": margin}),)
