"""Conversions between attitude representations. Quaternions are (w, x, y, z)."""

import numpy as np

from aerodb.support import Array


def euler_321_from_quaternion(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return Euler 3-2-1 angles from a quaternion from FRD body to NED earth axes.

    Parameters
    ----------
    w, x, y, z : (n,) each, quaternion that rotates body vectors into earth axes (PX4, JSBSim);
        normalised here

    Returns
    -------
    phi, theta, psi : (n,) each, bank angle, pitch attitude and heading, rad

    References
    ----------
    Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., sec. 1.8.
    """
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    with np.errstate(invalid="ignore", divide="ignore"):
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
    phi = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    theta = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    psi = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return phi, theta, psi


def euler_321_from_enu_quaternion(
    w: Array, x: Array, y: Array, z: Array
) -> tuple[Array, Array, Array]:
    """Return Euler 3-2-1 angles from a quaternion from FLU body to ENU earth axes (ROS, REP 103).

    With R the rotation from forward-left-up body axes to east-north-up earth axes, ``R_ned_frd = P
    R D``: P exchanges east and north and turns up into down, D turns left into right and up into
    down. As quaternions ``q_P q q_D`` with ``q_P = (0, 1, 1, 0)/sqrt 2``, ``q_D = (0, 1, 0, 0)``.

    Parameters and returns are those of `euler_321_from_quaternion`.
    """
    half = np.sqrt(0.5)
    w1, x1, y1, z1 = half * (-x - y), half * (w + z), half * (w - z), half * (y - x)
    return euler_321_from_quaternion(-x1, w1, z1, -y1)
