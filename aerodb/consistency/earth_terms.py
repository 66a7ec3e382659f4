"""Take the curvature of the earth, and the part of its rotation that specific force shows, out of
the inertial channels of a flight, so that kinematics over a flat earth are right for them.

Level flight at V pitches down with the earth at V/R. Over a flat earth a gyro bias takes this, but
only as long as the wings are level: at 100 to 170 m/s and usual banks an error of sideslip of .1
deg was left, which looked like one of the vane.
"""

import numpy as np

from aerodb.consistency.sensors import earth_to_body
from aerodb.physics import EARTH_RATE, radii_of_curvature
from aerodb.support import Array


def over_flat_earth(
    inputs: Array, attitude: Array, velocity: Array, latitude: float | None
) -> Array:
    """Return inertial channels as they would be over a flat earth that stands still.

    Rates lose the transport rate W_t, specific force loses ``(2 W_e + W_t) x v``. The earth's own
    rate W_e stays in the rates, if it was in them: gyro biases take it in a short flight, and an
    attitude reference may have taken it out.

    Parameters
    ----------
    inputs : (n, 6), specific force at the CG [m/s2] and rates [rad/s], order of
        `kinematics.INPUTS`.
    attitude : (3, n), bank angle, pitch attitude and true heading [rad].
    velocity : (3, n), over the earth, body axes [m/s].
    latitude : [rad]; None where it or the heading is unknown: then of both rates only what turns
        about horizontal axes with the curvature is known.

    Source: Groves (2013), sections 5.3 and 5.4, with the velocity turned into body axes.
    """
    to_body = earth_to_body(np.concatenate([np.zeros((3, len(inputs))), attitude]))
    north, east, _ = np.einsum("jin,jn->in", to_body, velocity)
    radii = radii_of_curvature(np.pi / 4.0 if latitude is None else latitude)
    along, across = radii.meridian, radii.normal
    if latitude is None:
        transport = np.array([east / across, -north / along, 0.0 * east])
        earth = np.zeros(3)
    else:
        transport = np.array([east / across, -north / along, -east * np.tan(latitude) / across])
        earth = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    rates = np.einsum("ijn,jn->ni", to_body, transport)
    turning = rates + 2.0 * np.einsum("ijn,j->ni", to_body, earth)
    return np.asarray(inputs - np.hstack([np.cross(turning, velocity.T), rates]))
