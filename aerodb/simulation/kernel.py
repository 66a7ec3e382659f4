"""Compiled equations of motion and their integration, for several runs side by side.

Equations: ``v' = f + R'g - (w + R'W_e) x v``, ``q' = (q w - (W_e + W_t) q)/2``, position by the
radii of curvature, as in flight-path reconstruction (`aerodb.consistency.motion`), with ``I w' = M
- w x I w``; on the flat earth W_e = W_t = 0 and gravity is constant.

References
----------
Stevens & Lewis, Aircraft Control and Simulation (2003), sections 1.3 to 1.5; Groves (2013),
sections 5.3 and 5.4, with the velocity turned into body axes.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.physics import (
    EARTH_RATE,
    GAS_CONSTANT,
    GRAVITY,
    HEAT_RATIO,
    normal_gravity,
    radii_of_curvature,
)
from aerodb.simulation.layout import Numbers
from aerodb.support import Array, Integers
from aerodb.tables import execute

#: Tolerance of alphadot and betadot [rad/s], and the most evaluations to find them.
_TOLERANCE = 1e-11
_EVALUATIONS = 8
#: Number of rows in `SURROUNDINGS`, `MOTION` and `LOADS`.
_S = 25
_M = 23
_L = 12


@njit(cache=True, nogil=True, error_model="numpy")
def _air(layers: Array, altitude: float) -> tuple[float, float]:
    """Pressure [Pa] and temperature [K] of the standard atmosphere; NaN outside it."""
    for k in range(layers.shape[0]):
        if layers[k, 0] <= altitude <= layers[k, 1]:
            gradient, base, warm, pressure = (
                layers[k, 2],
                layers[k, 3],
                layers[k, 4],
                layers[k, 5],
            )
            rise = altitude - base
            if gradient == 0.0:
                return pressure * math.exp(-GRAVITY * rise / (GAS_CONSTANT * warm)), warm
            ratio = 1.0 + gradient * rise / warm
            power = -GRAVITY / (GAS_CONSTANT * gradient)
            return pressure * math.exp(power * math.log(ratio)), warm + gradient * rise
    return np.nan, np.nan


@njit(cache=True, nogil=True, error_model="numpy")
def _body(x: Array, k: int, n: float, e: float, d: float) -> tuple[float, float, float]:
    """An earth vector in body axes."""
    a, b, c, f = x[6, k], x[7, k], x[8, k], x[9, k]
    aa, bb, cc, ff = a * a, b * b, c * c, f * f
    return (
        (aa + bb - cc - ff) * n + 2.0 * (b * c + a * f) * e + 2.0 * (b * f - a * c) * d,
        2.0 * (b * c - a * f) * n + (aa - bb + cc - ff) * e + 2.0 * (c * f + a * b) * d,
        2.0 * (b * f + a * c) * n + 2.0 * (c * f - a * b) * e + (aa - bb - cc + ff) * d,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _earth_frame(x: Array, k: int, u: float, v: float, w: float) -> tuple[float, float, float]:
    """A body vector in earth axes."""
    a, b, c, f = x[6, k], x[7, k], x[8, k], x[9, k]
    aa, bb, cc, ff = a * a, b * b, c * c, f * f
    return (
        (aa + bb - cc - ff) * u + 2.0 * (b * c - a * f) * v + 2.0 * (b * f + a * c) * w,
        2.0 * (b * c + a * f) * u + (aa - bb + cc - ff) * v + 2.0 * (c * f - a * b) * w,
        2.0 * (b * f - a * c) * u + 2.0 * (c * f + a * b) * v + (aa - bb - cc + ff) * w,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _prepare(
    model: Numbers, x: Array, h: Array, dh: Array, k: int, slots: Array, chan: Array, work: Array
) -> None:
    """Motion channels of one run; into `slots` what the database reads, into `work` (k) what the
    equations need: gravity, earth rate and transport rate in body axes, wind in body axes with its
    rate, and the rates of position."""
    place = 10
    spin_n, spin_d, move_n, move_e, move_d = 0.0, 0.0, 0.0, 0.0, 0.0
    north, east, down = _earth_frame(x, k, x[0, k], x[1, k], x[2, k])
    altitude = model.earth[3] - x[place + 2, k]
    gravity_n, gravity_d = 0.0, model.earth[1]
    to_north, to_east = 1.0, 1.0
    if model.earth[0] != 0.0:
        latitude = model.earth[2] + x[place, k] / model.earth[4]
        field = normal_gravity(latitude, altitude)
        gravity_n, gravity_d = field.north_by_height * altitude, field.gravity
        s, c = math.sin(latitude), math.cos(latitude)
        radii = radii_of_curvature(latitude)
        meridian, normal = radii.meridian + altitude, radii.normal + altitude
        spin_n, spin_d = EARTH_RATE * c, -EARTH_RATE * s
        move_n, move_e, move_d = east / normal, -north / meridian, -east * s / c / normal
        to_north, to_east = model.earth[4] / meridian, model.earth[5] / (normal * c)
    work[0, k], work[1, k], work[2, k] = _body(x, k, gravity_n, 0.0, gravity_d)
    spin = _body(x, k, spin_n, 0.0, spin_d)
    work[3, k], work[4, k], work[5, k] = spin
    work[6, k], work[7, k], work[8, k] = _body(x, k, spin_n + move_n, move_e, spin_d + move_d)
    wind = _body(x, k, h[8, k], h[9, k], h[10, k])
    p, q, r = x[3, k] - spin[0], x[4, k] - spin[1], x[5, k] - spin[2]
    change = _body(x, k, dh[8, k], dh[9, k], dh[10, k])
    # Rate of the air's velocity in body axes, which turn under the wind.
    work[9, k] = change[0] - (q * wind[2] - r * wind[1]) + dh[11, k]
    work[10, k] = change[1] - (r * wind[0] - p * wind[2]) + dh[12, k]
    work[11, k] = change[2] - (p * wind[1] - q * wind[0]) + dh[13, k]
    work[12, k], work[13, k], work[14, k] = to_north * north, to_east * east, down
    u, v, w = (
        x[0, k] - wind[0] - h[11, k],
        x[1, k] - wind[1] - h[12, k],
        x[2, k] - wind[2] - h[13, k],
    )
    work[15, k], work[16, k], work[17, k] = u, v, w
    speed = math.sqrt(u * u + v * v + w * w)
    pressure, warm = _air(model.layers, altitude)
    temperature = warm + h[15, k]
    density = h[14, k] * pressure / (GAS_CONSTANT * warm)
    chan[0, k], chan[1, k], chan[2, k] = speed, math.atan2(w, u), math.asin(v / speed)
    chan[5, k], chan[6, k], chan[7, k] = p, q, r
    chan[8, k], chan[9, k] = density, 0.5 * density * speed * speed
    chan[10, k] = speed / math.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature)
    chan[11, k], chan[12, k], chan[13, k] = temperature, pressure, altitude
    a, b, c, d = x[6, k], x[7, k], x[8, k], x[9, k]
    chan[14, k] = math.atan2(2.0 * (c * d + a * b), a * a - b * b - c * c + d * d)
    chan[15, k] = math.asin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    chan[16, k] = math.atan2(2.0 * (b * c + a * d), a * a + b * b - c * c - d * d)
    chan[17, k], chan[18, k] = x[place, k], x[place + 1, k]
    chan[19, k], chan[20, k], chan[21, k] = north, east, down
    chan[22, k] = altitude - h[22, k]
    for j in range(_M):
        if model.motion[j] >= 0:
            slots[model.motion[j], k] = chan[j, k]
    for j in range(_S):
        if model.surroundings[j] >= 0:
            slots[model.surroundings[j], k] = h[j, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _loads(model: Numbers, h: Array, k: int, slots: Array, chan: Array, work: Array) -> None:
    """Specific force and moment about the CG of one run, with what the equations make of them:
    rows 18 to 20 of `work` the rate of the velocity, 21 to 23 the moment; loads into `chan`."""
    area, chord, span = model.reference[0], model.reference[1], model.reference[2]
    scale = chan[9, k] * area
    fx, fy, fz = (
        scale * slots[model.totals[0], k],
        scale * slots[model.totals[1], k],
        scale * slots[model.totals[2], k],
    )
    ax, ay, az = (
        model.reference[3] - h[1, k],
        model.reference[4] - h[2, k],
        model.reference[5] - h[3, k],
    )
    mx = scale * span * slots[model.totals[3], k] + ay * fz - az * fy + h[19, k]
    my = scale * chord * slots[model.totals[4], k] + az * fx - ax * fz + h[20, k]
    mz = scale * span * slots[model.totals[5], k] + ax * fy - ay * fx + h[21, k]
    fx, fy, fz = fx + h[16, k], fy + h[17, k], fz + h[18, k]
    for e in range(model.thrust.shape[0]):
        thrust = slots[model.thrust[e], k]
        tx, ty, tz = (
            thrust * model.lines[e, 0],
            thrust * model.lines[e, 1],
            thrust * model.lines[e, 2],
        )
        ax, ay, az = (
            model.lines[e, 3] - h[1, k],
            model.lines[e, 4] - h[2, k],
            model.lines[e, 5] - h[3, k],
        )
        fx, fy, fz = fx + tx, fy + ty, fz + tz
        mx, my, mz = mx + ay * tz - az * ty, my + az * tx - ax * tz, mz + ax * ty - ay * tx
    work[21, k], work[22, k], work[23, k] = mx, my, mz
    chan[_M, k], chan[_M + 1, k], chan[_M + 2, k] = fx / h[0, k], fy / h[0, k], fz / h[0, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _accelerate(x: Array, k: int, chan: Array, work: Array) -> None:
    """Rate of the velocity over the earth (rows 18 to 20 of `work`)."""
    p, q, r = x[3, k] + work[3, k], x[4, k] + work[4, k], x[5, k] + work[5, k]
    u, v, w = x[0, k], x[1, k], x[2, k]
    work[18, k] = chan[_M, k] + work[0, k] - (q * w - r * v)
    work[19, k] = chan[_M + 1, k] + work[1, k] - (r * u - p * w)
    work[20, k] = chan[_M + 2, k] + work[2, k] - (p * v - q * u)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(
    model: Numbers, x: Array, h: Array, dh: Array, lanes: int, short: float, slots: Array,
    cells: Integers, outside: NDArray[np.bool_], chan: Array, work: Array, out: Array,
) -> int:  # fmt: skip
    """Time derivative of the states of all runs; returns how many runs found no alphadot.

    Parameters
    ----------
    x : (13 + m + a, k) states.
    h, dh : (s + i + 8, k) surroundings, inputs and references of feedback, and their rates [1/s].
    short : lag of an actuator that has a rate limit but no lag [s].
    slots : (s, k), constants and parameters given. cells, outside : as `execute`.
    chan : (35, k), MOTION and LOADS, written; alphadot and betadot hold the start of the search.
    work : (28, k), written; rows 24 to 27 are kept from one call to the next.
    out : as x, written.
    """
    inputs, states, actuated = model.inputs.shape[0], model.states.shape[0], model.actuated.shape[0]
    for k in range(lanes):
        _prepare(model, x, h, dh, k, slots, chan, work)
        for j in range(model.gains.shape[0]):
            number, channel = int(model.gains[j, 0]), int(model.gains[j, 1])
            now = chan[channel if channel < 3 else (channel + 2 if channel < 6 else channel + 8), k]
            h[_S + number, k] += model.gains[j, 2] * (h[_S + inputs + channel, k] - now)
        for j in range(actuated):
            number, position = model.actuated[j], x[13 + states + j, k]
            low, high, rate, lag = model.actuators[j]
            target = min(max(h[_S + number, k], low), high)
            out[13 + states + j, k] = 0.0
            if lag == 0.0 and rate == np.inf:
                h[_S + number, k] = target
            else:
                change = (target - position) / (lag if lag > 0.0 else short)
                out[13 + states + j, k] = min(max(change, -rate), rate)
                h[_S + number, k] = position
        for j in range(inputs):
            slots[model.inputs[j], k] = h[_S + j, k]
        for j in range(states):
            slots[model.states[j], k] = x[13 + j, k]
    moving = model.motion[3] >= 0 or model.motion[4] >= 0
    lost = 0
    for attempt in range(_EVALUATIONS if moving else 1):
        execute(model.program, slots, cells, outside, lanes)
        lost = 0
        for k in range(lanes):
            _loads(model, h, k, slots, chan, work)
            _accelerate(x, k, chan, work)
            u, v, w = work[15, k], work[16, k], work[17, k]
            du, dv, dw = (
                work[18, k] - work[9, k],
                work[19, k] - work[10, k],
                work[20, k] - work[11, k],
            )
            plane, speed = u * u + w * w, chan[0, k]
            rate = (u * dw - w * du) / plane
            slip = (dv * plane - v * (u * du + w * dw)) / (speed * speed * math.sqrt(plane))
            if not moving:
                chan[3, k], chan[4, k] = rate, slip
                continue
            # Each rate depends almost linearly on what the database was given: secants of both.
            gap, gap_slip = rate - chan[3, k], slip - chan[4, k]
            if abs(gap) > _TOLERANCE * (1.0 + abs(rate)) or abs(gap_slip) > _TOLERANCE * (
                1.0 + abs(slip)
            ):
                lost += 1
            elif attempt > 0:
                continue
            if attempt > 0:
                for row, step, error in ((24, gap, work[26, k]), (25, gap_slip, work[27, k])):
                    moved = work[row + 4, k]
                    if abs(moved) > 1e-9:
                        work[row, k] = min(max((step - error) / moved, -1.9), -0.1)
            work[26, k], work[27, k] = gap, gap_slip
            work[28, k], work[29, k] = -gap / work[24, k], -gap_slip / work[25, k]
            chan[3, k] += work[28, k]
            chan[4, k] += work[29, k]
            for j in (3, 4):
                if model.motion[j] >= 0:
                    slots[model.motion[j], k] = chan[j, k]
        if lost == 0:
            break
    for k in range(lanes):
        _finish(model, x, h, k, slots, chan, work, out)
    return lost


@njit(cache=True, nogil=True, error_model="numpy")
def _finish(
    model: Numbers, x: Array, h: Array, k: int, slots: Array, chan: Array, work: Array, out: Array
) -> None:
    """Derivatives of one run, from its loads."""
    p, q, r = x[3, k], x[4, k], x[5, k]
    ixx, iyy, izz, ixz, ixy, iyz = h[4, k], h[5, k], h[6, k], h[7, k], h[23, k], h[24, k]
    hx, hy, hz = (
        ixx * p - ixy * q - ixz * r,
        iyy * q - ixy * p - iyz * r,
        izz * r - ixz * p - iyz * q,
    )
    mx, my, mz = (
        work[21, k] - (q * hz - r * hy),
        work[22, k] - (r * hx - p * hz),
        work[23, k] - (p * hy - q * hx),
    )
    xx, yy, zz = iyy * izz - iyz * iyz, ixx * izz - ixz * ixz, ixx * iyy - ixy * ixy
    xy, xz, yz = ixy * izz + iyz * ixz, ixy * iyz + iyy * ixz, ixx * iyz + ixy * ixz
    determinant = ixx * xx - ixy * xy - ixz * xz
    out[0, k], out[1, k], out[2, k] = work[18, k], work[19, k], work[20, k]
    out[3, k] = (xx * mx + xy * my + xz * mz) / determinant
    out[4, k] = (xy * mx + yy * my + yz * mz) / determinant
    out[5, k] = (xz * mx + yz * my + zz * mz) / determinant
    p, q, r = p - work[6, k], q - work[7, k], r - work[8, k]
    a, b, c, d = x[6, k], x[7, k], x[8, k], x[9, k]
    # The earth's and the transport rate are subtracted in body axes, where they are the same.
    pull = 1.0 - (a * a + b * b + c * c + d * d)
    out[6, k] = -0.5 * (b * p + c * q + d * r) + pull * a
    out[7, k] = 0.5 * (a * p + c * r - d * q) + pull * b
    out[8, k] = 0.5 * (a * q + d * p - b * r) + pull * c
    out[9, k] = 0.5 * (a * r + b * q - c * p) + pull * d
    out[10, k], out[11, k], out[12, k] = work[12, k], work[13, k], work[14, k]
    for j in range(3):
        chan[_M + 3 + j, k] = out[3 + j, k]
    for j in range(6):
        chan[_M + 6 + j, k] = slots[model.totals[j], k]
    for j in range(model.states.shape[0]):
        out[13 + j, k] = 0.0
        if model.laws[j, 0] > 0.0:
            tau = model.laws[j, 0] / chan[0, k]
            out[13 + j, k] = (slots[model.steady[j], k] - x[13 + j, k]) / tau
