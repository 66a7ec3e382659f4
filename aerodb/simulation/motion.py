"""Equations of motion of a rigid body over a flat, non-rotating earth, for many flights at once.

State rows, each (k,) over the flights: u v w [m/s, inertial velocity in body axes], p q r [rad/s],
e0 e1 e2 e3 (unit quaternion, body to earth), north east down [m]. The caller provides forces and
moments.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from aerodb.physics import GRAVITY, cross, to_earth
from aerodb.support import Array

VELOCITY: Final = slice(0, 3)
RATES: Final = slice(3, 6)
QUATERNION: Final = slice(6, 10)
POSITION: Final = slice(10, 13)


def inertia_matrix(Ixx: float, Iyy: float, Izz: float, Ixz: float) -> Array:
    """Return the inertia matrix of a body that is symmetric about its x-z plane.

    Parameters
    ----------
    Ixx, Iyy, Izz, Ixz : float, [kg m2]; `Ixz` is the integral of x z dm

    Returns
    -------
    (3, 3) [kg m2]

    References
    ----------
    Stevens & Lewis, Aircraft Control and Simulation (2003), section 1.3.
    """
    return np.array([[Ixx, 0.0, -Ixz], [0.0, Iyy, 0.0], [-Ixz, 0.0, Izz]])


def gravity_body(quaternion: Array) -> Array:
    """Return gravity in body axes (3, k) [m/s2] for a quaternion (4, k), body to earth."""
    e0, e1, e2, e3 = quaternion
    return GRAVITY * np.array(
        [2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), 1 - 2 * (e1 * e1 + e2 * e2)]
    )


def angular_acceleration(rates: Array, moment: Array, inertia: Array) -> Array:
    """Return the angular acceleration by Euler's equations: I^-1 (M - omega x I omega).

    Parameters
    ----------
    rates : (3, k), p q r [rad/s]
    moment : (3, k), about the CG [N m]
    inertia : (3, 3) [kg m2]

    Returns
    -------
    (3, k) [rad/s2]

    References
    ----------
    Stevens & Lewis, Aircraft Control and Simulation (2003), section 1.3.
    """
    return np.asarray(
        np.linalg.solve(inertia, moment - cross(rates, inertia @ rates)), dtype=np.float64
    )


def derivative(state: Array, specific_force: Array, moment: Array, inertia: Array) -> Array:
    """Return the time derivative of the state.

    Parameters
    ----------
    state : (13, k)
    specific_force : (3, k) [m/s2]
    moment : (3, k), about the CG [N m]
    inertia : (3, 3) [kg m2]

    Returns
    -------
    (13, k)

    References
    ----------
    Stevens & Lewis, Aircraft Control and Simulation (2003), section 1.5, flat earth.
    """
    velocity, rates, e = state[VELOCITY], state[RATES], state[QUATERNION]
    result = np.empty_like(state)
    result[VELOCITY] = specific_force + gravity_body(e) - cross(rates, velocity)
    result[RATES] = angular_acceleration(rates, moment, inertia)
    p, q, r = rates
    e0, e1, e2, e3 = e
    result[6] = -0.5 * (e1 * p + e2 * q + e3 * r)
    result[7] = 0.5 * (e0 * p + e2 * r - e3 * q)
    result[8] = 0.5 * (e0 * q + e3 * p - e1 * r)
    result[9] = 0.5 * (e0 * r + e1 * q - e2 * p)
    result[POSITION] = to_earth(e, velocity)
    return result


Derivative = Callable[[float, Array], Array]


def normalised(state: Array) -> Array:
    """Return the state with quaternions of unit length, which integration does not preserve."""
    result = state.copy()
    result[QUATERNION] /= np.sqrt(np.sum(state[QUATERNION] ** 2, axis=0))
    return result


def midpoint_step(rate: Derivative, time: float, state: Array, step: float, first: Array) -> Array:
    """Return the state after one step of the explicit midpoint rule (second order).

    It takes two evaluations per step. At 100 Hz its error over a flight is far below the noise of
    the sensors (tests/aerodb/simulation/test_simulation.py).

    Parameters
    ----------
    rate : time derivative of the state
    time, step : float, [s]
    state : (13, k)
    first : (13, k), derivative at `time`, already known
    """
    return normalised(state + step * rate(time + step / 2, state + step / 2 * first))
