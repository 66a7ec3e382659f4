"""Newton's and Euler's equations of a rigid body in body axes."""

from collections.abc import Mapping

import numpy as np

from aerodb.support import Array


def specific_force_at_cg(
    force: Array, rates: Array, angular_acceleration: Array, arm: Array
) -> Array:
    """Specific force at the CG from that at a sensor: ``a_CG = a_P - wdot x r - w x (w x r)``.

    Parameters
    ----------
    force : a_P (n, 3) [m/s2], at the sensor.
    rates : w (n, 3) [rad/s].
    angular_acceleration : wdot (n, 3) [rad/s2].
    arm : r (n, 3) [m], from the CG to the sensor.

    All in body axes.

    Returns
    -------
    (n, 3) [m/s2].

    References
    ----------
    003, eq. 1, derived again.

    >>> import numpy as np
    >>> yaw = np.array([[0.0, 0.0, 2.0]])  # rad/s; a sensor 1 m ahead measures -4 m/s2 from it
    >>> ahead, still = np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3))
    >>> specific_force_at_cg(np.array([[-4.0, 0, 0]]), yaw, still, ahead).tolist()
    [[0.0, 0.0, 0.0]]
    """
    return force - np.cross(angular_acceleration, arm) - np.cross(rates, np.cross(rates, arm))


def inertial_moment(
    rates: Array, angular_acceleration: Array, inertia: Mapping[str, Array]
) -> Array:
    """Total moment about the CG from the motion, ``I wdot + w x (I w)``, with the xz plane as plane
    of symmetry.

    Parameters
    ----------
    rates : w (n, 3) [rad/s], body axes.
    angular_acceleration : wdot (n, 3) [rad/s2].
    inertia : Ixx Iyy Izz Ixz [kg m2], each (n,) or a number; Ixz is the integral of x z dm.

    Returns
    -------
    (n, 3) [N m].

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2006, eqs. 3.22-3.24.
    """
    p, q, r = rates.T
    pdot, qdot, rdot = angular_acceleration.T
    ixx, iyy, izz, ixz = (inertia[name] for name in ("Ixx", "Iyy", "Izz", "Ixz"))
    return np.column_stack(
        [
            ixx * pdot - ixz * (p * q + rdot) + (izz - iyy) * q * r,
            iyy * qdot + (ixx - izz) * p * r + ixz * (p**2 - r**2),
            izz * rdot - ixz * (pdot - q * r) + (iyy - ixx) * p * q,
        ]
    )
