"""Compiled integration of position, velocity and attitude with quaternions, over a flat or a
rotating oblate earth.

With v the velocity over the earth in body axes, q the attitude (body to earth axes, R its matrix),
w and f the measured rates and specific force, W_e the earth's rate and W_t the transport rate, g
the gravity in local north, east, down axes: ``v' = f + R'g - (w + R'W_e) x v``, ``q' = (q w - (W_e
+ W_t) q) / 2``, position by the radii of curvature (Groves 2013, sections 5.3 and 5.4, with the
velocity turned into body axes). On the flat earth W_e = W_t = 0 and g is constant.
"""

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

from aerodb.physics import EARTH_RATE, PLUMB_LINE_CURVATURE, normal_gravity, radii_of_curvature
from aerodb.support import Array

#: Smallest cosine of the pitch attitude in derivatives of Euler angles; closer to the vertical,
#: those at this cosine are used.
_LEAST_COSINE = 1e-7

register_jitable(normal_gravity)
register_jitable(radii_of_curvature)


@njit(cache=True, nogil=True)
def _slope(x: Array, u: Array, gravity: float, out: Array, jacobian: Array) -> None:
    """Time derivative over the flat earth and its Jacobian.

    out (10,): of v, q, north, east, altitude under inputs u (6,). jacobian (10, 16): by states and
    inputs; its zeros are not written. Written out in full because most of the time is spent here.
    """
    v0, v1, v2, p, q, r = x[0], x[1], x[2], u[3], u[4], u[5]
    a, b, c, d = x[3], x[4], x[5], x[6]
    aa, bb, cc, dd = a * a, b * b, c * c, d * d
    r00, r01, r02 = aa + bb - cc - dd, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)
    r10, r11, r12 = 2.0 * (b * c + a * d), aa - bb + cc - dd, 2.0 * (c * d - a * b)
    r20, r21, r22 = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b), aa - bb - cc + dd
    out[0] = u[0] + gravity * r20 - q * v2 + r * v1
    out[1] = u[1] + gravity * r21 - r * v0 + p * v2
    out[2] = u[2] + gravity * r22 - p * v1 + q * v0
    out[7], out[8] = r00 * v0 + r01 * v1 + r02 * v2, r10 * v0 + r11 * v1 + r12 * v2
    out[9] = -(r20 * v0 + r21 * v1 + r22 * v2)
    jacobian[0, 1], jacobian[0, 2], jacobian[1, 0] = r, -q, -r
    jacobian[1, 2], jacobian[2, 0], jacobian[2, 1] = p, q, -p
    jacobian[0, 10], jacobian[1, 11], jacobian[2, 12] = 1.0, 1.0, 1.0
    jacobian[0, 14], jacobian[0, 15], jacobian[1, 13] = -v2, v1, v2
    jacobian[1, 15], jacobian[2, 13], jacobian[2, 14] = -v0, -v1, v0
    ga, gb, gc, gd = 2.0 * gravity * a, 2.0 * gravity * b, 2.0 * gravity * c, 2.0 * gravity * d
    jacobian[0, 3], jacobian[0, 4], jacobian[0, 5], jacobian[0, 6] = -gc, gd, -ga, gb
    jacobian[1, 3], jacobian[1, 4], jacobian[1, 5], jacobian[1, 6] = gb, ga, gd, gc
    jacobian[2, 3], jacobian[2, 4], jacobian[2, 5], jacobian[2, 6] = ga, -gb, -gc, gd
    jacobian[7, 0], jacobian[7, 1], jacobian[7, 2] = r00, r01, r02
    jacobian[8, 0], jacobian[8, 1], jacobian[8, 2] = r10, r11, r12
    jacobian[9, 0], jacobian[9, 1], jacobian[9, 2] = -r20, -r21, -r22
    e, f = 2.0 * (a * v0 - d * v1 + c * v2), 2.0 * (b * v0 + c * v1 + d * v2)
    h, k = 2.0 * (b * v1 - c * v0 + a * v2), 2.0 * (b * v2 - d * v0 - a * v1)
    jacobian[7, 3], jacobian[7, 4], jacobian[7, 5], jacobian[7, 6] = e, f, h, k
    jacobian[8, 3], jacobian[8, 4], jacobian[8, 5], jacobian[8, 6] = -k, -h, f, e
    jacobian[9, 3], jacobian[9, 4], jacobian[9, 5], jacobian[9, 6] = -h, k, e, -f
    _attitude(0.5 * p, 0.5 * q, 0.5 * r, 0.5 * a, 0.5 * b, 0.5 * c, 0.5 * d, out, jacobian)


@njit(cache=True, nogil=True)
def _attitude(
    p: float,
    q: float,
    r: float,
    a: float,
    b: float,
    c: float,
    d: float,
    out: Array,
    jacobian: Array,
) -> None:
    """Time derivative of the quaternion and its derivatives, from half the rates and half the
    quaternion."""
    out[3], out[4] = -2.0 * (b * p + c * q + d * r), 2.0 * (a * p + c * r - d * q)
    out[5], out[6] = 2.0 * (a * q + d * p - b * r), 2.0 * (a * r + b * q - c * p)
    jacobian[3, 4], jacobian[3, 5], jacobian[3, 6] = -p, -q, -r
    jacobian[4, 3], jacobian[4, 5], jacobian[4, 6] = p, r, -q
    jacobian[5, 3], jacobian[5, 4], jacobian[5, 6] = q, -r, p
    jacobian[6, 3], jacobian[6, 4], jacobian[6, 5] = r, q, -p
    jacobian[3, 13], jacobian[3, 14], jacobian[3, 15] = -b, -c, -d
    jacobian[4, 13], jacobian[4, 14], jacobian[4, 15] = a, -d, c
    jacobian[5, 13], jacobian[5, 14], jacobian[5, 15] = d, a, -b
    jacobian[6, 13], jacobian[6, 14], jacobian[6, 15] = -c, b, a


@njit(cache=True, nogil=True)
def _back(q: Array, y: Array, out: Array, by: Array) -> None:
    """out (3,) = R'(q) y, from earth to body axes; by (3, 4) its derivatives by q."""
    dot = q[1] * y[0] + q[2] * y[1] + q[3] * y[2]
    size = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] - q[3] * q[3]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = q[1 + j] * y[k] - q[1 + k] * y[j]
        out[i] = size * y[i] + 2.0 * dot * q[1 + i] - 2.0 * q[0] * across
        by[i, 0] = 2.0 * q[0] * y[i] - 2.0 * across
        by[i, 1 + i] = 2.0 * dot
        by[i, 1 + j] = 2.0 * (y[j] * q[1 + i] - q[1 + j] * y[i] - q[0] * y[k])
        by[i, 1 + k] = 2.0 * (y[k] * q[1 + i] - q[1 + k] * y[i] + q[0] * y[j])


@njit(cache=True, nogil=True)
def _slope_rotating(x: Array, u: Array, earth: Array, out: Array, jacobian: Array) -> None:
    """As `_slope`, over the rotating earth.

    earth (4,): latitude [rad], height [m], metres per radian of latitude and of longitude, at the
    local origin.
    """
    latitude, height = earth[0] + x[7] / earth[2], earth[1] + x[9]
    gravity = normal_gravity(latitude, height)
    jacobian[:, :] = 0.0
    _slope(x, u, gravity.gravity, out, jacobian)
    s, c = np.sin(latitude), np.cos(latitude)
    spin, dspin = (
        np.array([EARTH_RATE * c, 0.0, -EARTH_RATE * s]),
        np.array([-EARTH_RATE * s, 0.0, -EARTH_RATE * c]) / earth[2],
    )
    north = np.array([gravity.north_by_height * height, 0.0, 0.0])
    bend = 2.0 * PLUMB_LINE_CURVATURE * np.cos(2.0 * latitude) * height
    north_by = np.array([bend, 0.0, gravity.by_latitude]) / earth[2]
    rise = np.array([gravity.north_by_height, 0.0, gravity.by_height])
    _velocity_by_earth(x, spin, dspin, north, north_by, rise, out, jacobian)
    _attitude_by_earth(x, spin, dspin, latitude, height, earth, out, jacobian)
    radii = radii_of_curvature(latitude)
    meridian, normal = radii.meridian + height, radii.normal + height
    to_north, to_east = earth[2] / meridian, earth[3] / (normal * c)
    for number in range(7):
        jacobian[7, number] *= to_north
        jacobian[8, number] *= to_east
    out[7] *= to_north
    out[8] *= to_east
    jacobian[7, 7], jacobian[7, 9] = (
        -out[7] * radii.meridian_by_latitude / meridian / earth[2],
        -out[7] / meridian,
    )
    jacobian[8, 7] = out[8] * (s / c - radii.normal_by_latitude / normal) / earth[2]
    jacobian[8, 9] = -out[8] / normal


@njit(cache=True, nogil=True)
def _velocity_by_earth(
    x: Array,
    spin: Array,
    dspin: Array,
    north: Array,
    north_by: Array,
    rise: Array,
    out: Array,
    jacobian: Array,
) -> None:
    """Add ``R'g_north - R'W_e x v`` to v', with derivatives (of gravity by position as well).

    north (3,): gravity without its component along the normal. north_by, dspin: derivatives of
    gravity and W_e by the state north. rise: derivative of gravity by altitude.
    """
    v, q = x[0:3], x[3:7]
    part, around, daround, none = np.empty(3), np.empty(3), np.empty((3, 4)), np.empty((3, 4))
    moved, pull, climb = np.empty(3), np.empty(3), np.empty(3)
    _back(q, dspin, moved, none)
    _back(q, north_by, pull, none)
    _back(q, rise, climb, none)
    _back(q, spin, around, daround)
    _back(q, north, part, none)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] += part[i] - around[j] * v[k] + around[k] * v[j]
        jacobian[i, k] -= around[j]
        jacobian[i, j] += around[k]
        jacobian[i, 7] = pull[i] - moved[j] * v[k] + moved[k] * v[j]
        jacobian[i, 9] = climb[i]
        for c in range(4):
            jacobian[i, 3 + c] += none[i, c] - daround[j, c] * v[k] + daround[k, c] * v[j]


@njit(cache=True, nogil=True)
def _attitude_by_earth(
    x: Array,
    spin: Array,
    dspin: Array,
    latitude: float,
    height: float,
    earth: Array,
    out: Array,
    jacobian: Array,
) -> None:
    """Add ``-(W_e + W_t) q / 2`` to q', with derivatives.

    Rows 7 and 8 of out and jacobian must hold the velocity over the earth.
    """
    q = x[3:7]
    north, east = out[7], out[8]
    radii = radii_of_curvature(latitude)
    a, b, slant, c = (
        1.0 / (radii.meridian + height),
        1.0 / (radii.normal + height),
        np.tan(latitude),
        np.cos(latitude),
    )
    total = spin + np.array([east * b, -north * a, -east * slant * b])
    change = np.zeros((3, 10))  # of the total by the states
    for number in range(7):
        along, across = jacobian[7, number], jacobian[8, number]
        change[0, number], change[1, number], change[2, number] = (
            across * b,
            -along * a,
            -across * slant * b,
        )
    change[0, 7] = -east * radii.normal_by_latitude * b * b
    change[1, 7] = north * radii.meridian_by_latitude * a * a
    change[2, 7] = -east * (b / (c * c) - slant * radii.normal_by_latitude * b * b)
    change[0, 9], change[1, 9], change[2, 9] = -east * b * b, north * a * a, east * slant * b * b
    for i in range(3):
        change[i, 7] = change[i, 7] / earth[2] + dspin[i]
    out[3] += 0.5 * (total[0] * q[1] + total[1] * q[2] + total[2] * q[3])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[4 + i] -= 0.5 * (q[0] * total[i] + total[j] * q[1 + k] - total[k] * q[1 + j])
        jacobian[3, 4 + i] += 0.5 * total[i]
        jacobian[4 + i, 3] -= 0.5 * total[i]
        jacobian[4 + i, 4 + k] -= 0.5 * total[j]
        jacobian[4 + i, 4 + j] += 0.5 * total[k]
        for number in range(10):
            jacobian[3, number] += 0.5 * q[1 + i] * change[i, number]
            across = change[j, number] * q[1 + k] - change[k, number] * q[1 + j]
            jacobian[4 + i, number] -= 0.5 * (q[0] * change[i, number] + across)


@njit(cache=True, nogil=True)
def _along(
    jacobian: Array,
    rotating: bool,
    dx: Array,
    kind: NDArray[np.int64],
    gain: Array,
    u: Array,
    out: Array,
) -> None:
    """Apply the Jacobian to dx (10, k) and to the corrections of the inputs, into out (10, k).

    kind : as `input_kind` of `kinematics.integrate`.
    """
    for k in range(kind.shape[0]):
        if rotating:
            for i in range(10):
                total = 0.0
                for j in range(10):
                    total += jacobian[i, j] * dx[j, k]
                out[i, k] = total
        else:  # the rest of the Jacobian is zero
            for i in range(3):
                velocity, place = 0.0, 0.0
                for j in range(7):
                    velocity += jacobian[i, j] * dx[j, k]
                    place += jacobian[7 + i, j] * dx[j, k]
                out[i, k], out[7 + i, k] = velocity, place
            for i in range(3, 7):
                turn = 0.0
                for j in range(3, 7):
                    turn += jacobian[i, j] * dx[j, k]
                out[i, k] = turn
        if kind[k] >= 0:
            number = kind[k] if kind[k] < 6 else kind[k] - 6
            change = -gain[number] * (1.0 if kind[k] < 6 else u[number])
            if number < 3:
                out[number, k] += change
            else:
                for i in range(7):
                    out[i, k] += jacobian[i, 10 + number] * change


@njit(cache=True, nogil=True)
def _keep(x: Array, dx: Array, number: int, states: Array, sensitivity: Array) -> None:
    """Write the states with Euler angles, and their sensitivities, at sample `number`.

    Bank and heading are those closest to the previous sample; at the first sample, those closest to
    the values already in `states`.
    """
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    aside, below = 2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2)
    steep = min(1.0, max(-1.0, 2.0 * (q0 * q2 - q3 * q1)))
    phi, theta = np.arctan2(aside, below), np.arcsin(steep)
    psi = np.arctan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    before = max(number - 1, 0)
    phi += 2.0 * np.pi * np.floor((states[3, before] - phi) / (2.0 * np.pi) + 0.5)
    psi += 2.0 * np.pi * np.floor((states[5, before] - psi) / (2.0 * np.pi) + 0.5)
    states[3, number], states[4, number], states[5, number] = phi, theta, psi
    upright = np.sqrt(aside * aside + below * below)
    sine, cosine = (
        (aside / upright, below / upright)
        if upright > _LEAST_COSINE
        else (np.sin(phi), np.cos(phi))
    )
    upright = max(upright, _LEAST_COSINE)
    slant = steep / upright
    for j in range(3):
        states[j, number], states[6 + j, number] = x[j], x[7 + j]
    for k in range(dx.shape[1]):
        for j in range(3):
            sensitivity[j, number, k], sensitivity[6 + j, number, k] = dx[j, k], dx[7 + j, k]
        # the turn in body axes, 2 q* dq
        a = 2.0 * (q0 * dx[4, k] - q1 * dx[3, k] - q2 * dx[6, k] + q3 * dx[5, k])
        b = 2.0 * (q0 * dx[5, k] - q2 * dx[3, k] - q3 * dx[4, k] + q1 * dx[6, k])
        c = 2.0 * (q0 * dx[6, k] - q3 * dx[3, k] - q1 * dx[5, k] + q2 * dx[4, k])
        heading = b * sine + c * cosine
        sensitivity[3, number, k] = a + heading * slant
        sensitivity[4, number, k] = b * cosine - c * sine
        sensitivity[5, number, k] = heading / upright


@njit(cache=True, nogil=True)
def _normalise(x: Array, dx: Array) -> None:
    """Normalise the quaternion and project its derivatives on the tangent space."""
    size = np.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
    for j in range(3, 7):
        x[j] /= size
    for k in range(dx.shape[1]):
        along = x[3] * dx[3, k] + x[4] * dx[4, k] + x[5] * dx[5, k] + x[6] * dx[6, k]
        for j in range(3, 7):
            dx[j, k] = (dx[j, k] - x[j] * along) / size


@njit(cache=True, nogil=True)
def march(
    inputs: Array, midway: Array, x: Array, dx: Array, kind: NDArray[np.int64], gain: Array,
    step: float, gravity: float, earth: Array | None, held: bool, every: int, states: Array,
    sensitivity: Array,
) -> None:  # fmt: skip
    """Integrate by fourth-order Runge-Kutta from x (10,) and dx (10, k), with inputs (n, 6) and
    those midway between them (n - 1, 6).

    Fills states (9, r) and sensitivity (9, r, k), with Euler angles, with one sample of `every`
    kept. states[3, 0] and states[5, 0] set the turn in which bank and heading are counted. Without
    an earth its equations are not compiled: the branch on None is decided by type.
    """
    n, columns = inputs.shape[0], kind.shape[0]
    u, stage, slope, total, jacobian = (
        np.empty(6),
        np.empty(10),
        np.zeros(10),
        np.empty(10),
        np.zeros((10, 16)),
    )
    dstage, dslope, dtotal = (
        np.empty((10, columns)),
        np.zeros((10, columns)),
        np.empty((10, columns)),
    )
    # one long loop instead of ten short ones
    all_stage, all_slope, all_total, all_x = (
        dstage.ravel(),
        dslope.ravel(),
        dtotal.ravel(),
        dx.ravel(),
    )
    for i in range(n):
        if i % every == 0:
            _keep(x, dx, i // every, states, sensitivity)
        if i == n - 1:
            break
        total[:] = 0.0
        all_total[:] = 0.0
        for part in range(4):
            ahead = 0.0 if part == 0 else (1.0 if part == 3 else 0.5)
            late = i + 1 if part == 3 and not held else i
            weight = step / 6.0 if part == 0 or part == 3 else step / 3.0
            for j in range(6):
                u[j] = midway[i, j] if part == 1 or part == 2 else inputs[late, j]
            for j in range(10):
                stage[j] = x[j] + ahead * step * slope[j]
            for k in range(10 * columns):
                all_stage[k] = all_x[k] + ahead * step * all_slope[k]
            if earth is None:
                _slope(stage, u, gravity, slope, jacobian)
            else:
                _slope_rotating(stage, u, earth, slope, jacobian)
            _along(jacobian, earth is not None, dstage, kind, gain, u, dslope)
            for j in range(10):
                total[j] += weight * slope[j]
            for k in range(10 * columns):
                all_total[k] += weight * all_slope[k]
        for j in range(10):
            x[j] += total[j]
        for k in range(10 * columns):
            all_x[k] += all_total[k]
        _normalise(x, dx)


def quaternion_start(initial: Array, directions: Array) -> tuple[Array, Array]:
    """First states and their derivatives with a quaternion, from those with Euler angles.

    initial : (9,), SI, angles 3-2-1 [rad]. directions : (9, k), derivatives by k unknowns. Returns
    (10,) and (10, k), body to earth.
    """
    cosine, sine = np.cos(0.5 * initial[3:6]), np.sin(0.5 * initial[3:6])
    attitude = _half_angles(cosine, sine)
    by = np.empty((4, 3))
    for angle in range(3):
        c, s = cosine.copy(), sine.copy()
        c[angle], s[angle] = -0.5 * sine[angle], 0.5 * cosine[angle]
        by[:, angle] = _half_angles(c, s)
    x = np.concatenate([initial[:3], attitude, initial[6:]])
    return x, np.concatenate([directions[:3], by @ directions[3:6], directions[6:]])


def _half_angles(c: Array, s: Array) -> Array:
    """(4,) quaternion from cosines and sines (3,) of half the bank, pitch and heading."""
    return np.array(
        [
            c[0] * c[1] * c[2] + s[0] * s[1] * s[2],
            s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
            c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
            c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
        ]
    )
