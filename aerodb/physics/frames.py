"""Attitude and rotations. Quaternions are (w, x, y, z), vectors stand in rows (3, k)."""

from typing import Final

import numpy as np

from aerodb.support import Array

#: Rows y z x and z x y of a vector.
_ROTATED: Final = np.array([[1, 2, 0], [2, 0, 1]])


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

    Parameters and returns are those of `euler_321_from_quaternion`. Angles are in [rad].
    """
    half = np.sqrt(0.5)
    w1, x1, y1, z1 = half * (-x - y), half * (w + z), half * (w - z), half * (y - x)
    return euler_321_from_quaternion(-x1, w1, z1, -y1)


def cross(a: Array, b: Array) -> Array:
    """Return a x b for vectors in rows (3, ...), without the overhead of numpy's general form."""
    # `take` gives the same rows as indexing does, four times faster on small arrays.
    yzx, zxy = _ROTATED
    return a.take(yzx, 0) * b.take(zxy, 0) - a.take(zxy, 0) * b.take(yzx, 0)


def quaternion_from_euler(phi: Array, theta: Array, psi: Array) -> Array:
    """Return the quaternion, body to earth, of Euler 3-2-1 angles.

    Parameters
    ----------
    phi, theta, psi : (k,) [rad]

    Returns
    -------
    (4, k)

    References
    ----------
    Stevens & Lewis, Aircraft Control and Simulation (2003), section 1.3.
    """
    cf, sf = np.cos(phi / 2), np.sin(phi / 2)
    ct, st = np.cos(theta / 2), np.sin(theta / 2)
    cp, sp = np.cos(psi / 2), np.sin(psi / 2)
    return np.stack(
        [
            cf * ct * cp + sf * st * sp,
            sf * ct * cp - cf * st * sp,
            cf * st * cp + sf * ct * sp,
            cf * ct * sp - sf * st * cp,
        ]
    )


def to_earth(quaternion: Array, vector: Array) -> Array:
    """Return body vectors in earth axes, in their own unit: v + 2 e x (e x v + e0 v).

    Parameters
    ----------
    quaternion : (4, k), body to earth
    vector : (3, k), body axes

    Returns
    -------
    (3, k)
    """
    e0, e = quaternion[0], quaternion[1:]
    return vector + 2 * cross(e, cross(e, vector) + e0 * vector)


def to_body(quaternion: Array, vector: Array) -> Array:
    """Return earth vectors in body axes, in their own unit; inverse of `to_earth`.

    Parameters
    ----------
    quaternion : (4, k), body to earth
    vector : (3, k), earth axes

    Returns
    -------
    (3, k)
    """
    e0, e = quaternion[0], quaternion[1:]
    return vector + 2 * cross(e, cross(e, vector) - e0 * vector)
