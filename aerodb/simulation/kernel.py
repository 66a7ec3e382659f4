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
from numba.extending import register_jitable
from numpy.typing import NDArray

from aerodb.physics import (
    EARTH_RATE,
    GAS_CONSTANT,
    GRAVITY,
    HEAT_RATIO,
    LAYER,
    normal_gravity,
    radii_of_curvature,
)
from aerodb.simulation.layout import (
    CHAN,
    EXTRA,
    FEEDBACK_ROWS,
    GAIN,
    INPUTS,
    LAW,
    LINE,
    TOTAL,
    WORK,
    H,
    Numbers,
    X,
)
from aerodb.support import Array, Integers
from aerodb.tables import STILL_AIR, execute

#: Tolerance of alphadot and betadot [rad/s], and the most evaluations to find them.
_TOLERANCE = 1e-11
_EVALUATIONS = 8

register_jitable(normal_gravity)
register_jitable(radii_of_curvature)


@njit(cache=True, nogil=True, error_model="numpy")
def _air(layers: Array, altitude: float) -> tuple[float, float]:
    """Pressure [Pa] and temperature [K] of the standard atmosphere; NaN outside it."""
    for k in range(layers.shape[0]):
        if layers[k, LAYER.bottom] <= altitude <= layers[k, LAYER.top]:
            gradient, base, warm, pressure = (
                layers[k, LAYER.gradient],
                layers[k, LAYER.base_altitude],
                layers[k, LAYER.base_temperature],
                layers[k, LAYER.base_pressure],
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
    a, b, c, f = x[X.e0, k], x[X.e1, k], x[X.e2, k], x[X.e3, k]
    aa, bb, cc, ff = a * a, b * b, c * c, f * f
    return (
        (aa + bb - cc - ff) * n + 2.0 * (b * c + a * f) * e + 2.0 * (b * f - a * c) * d,
        2.0 * (b * c - a * f) * n + (aa - bb + cc - ff) * e + 2.0 * (c * f + a * b) * d,
        2.0 * (b * f + a * c) * n + 2.0 * (c * f - a * b) * e + (aa - bb - cc + ff) * d,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _earth_frame(x: Array, k: int, u: float, v: float, w: float) -> tuple[float, float, float]:
    """A body vector in earth axes."""
    a, b, c, f = x[X.e0, k], x[X.e1, k], x[X.e2, k], x[X.e3, k]
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
    spin_n, spin_d, move_n, move_e, move_d = 0.0, 0.0, 0.0, 0.0, 0.0
    north, east, down = _earth_frame(x, k, x[X.u, k], x[X.v, k], x[X.w, k])
    altitude = model.earth.height - x[X.down, k]
    gravity_n, gravity_d = 0.0, model.earth.gravity
    to_north, to_east = 1.0, 1.0
    if model.earth.rotates:
        latitude = model.earth.latitude + x[X.north, k] / model.earth.metres_north
        field = normal_gravity(latitude, altitude)
        gravity_n, gravity_d = field.north_by_height * altitude, field.gravity
        s, c = math.sin(latitude), math.cos(latitude)
        radii = radii_of_curvature(latitude)
        meridian, normal = radii.meridian + altitude, radii.normal + altitude
        spin_n, spin_d = EARTH_RATE * c, -EARTH_RATE * s
        move_n, move_e, move_d = east / normal, -north / meridian, -east * s / c / normal
        to_north, to_east = (
            model.earth.metres_north / meridian,
            model.earth.metres_east / (normal * c),
        )
    work[WORK.gravity_x, k], work[WORK.gravity_y, k], work[WORK.gravity_z, k] = _body(
        x, k, gravity_n, 0.0, gravity_d
    )
    spin_p, spin_q, spin_r = _body(x, k, spin_n, 0.0, spin_d)
    work[WORK.earth_p, k], work[WORK.earth_q, k], work[WORK.earth_r, k] = spin_p, spin_q, spin_r
    work[WORK.frame_p, k], work[WORK.frame_q, k], work[WORK.frame_r, k] = _body(
        x, k, spin_n + move_n, move_e, spin_d + move_d
    )
    wind_u, wind_v, wind_w = _body(x, k, h[H.wind_north, k], h[H.wind_east, k], h[H.wind_down, k])
    p, q, r = x[X.p, k] - spin_p, x[X.q, k] - spin_q, x[X.r, k] - spin_r
    change_u, change_v, change_w = _body(
        x, k, dh[H.wind_north, k], dh[H.wind_east, k], dh[H.wind_down, k]
    )
    # Rate of the air's velocity in body axes, which turn under the wind.
    work[WORK.air_u_rate, k] = change_u - (q * wind_w - r * wind_v) + dh[H.gust_u, k]
    work[WORK.air_v_rate, k] = change_v - (r * wind_u - p * wind_w) + dh[H.gust_v, k]
    work[WORK.air_w_rate, k] = change_w - (p * wind_v - q * wind_u) + dh[H.gust_w, k]
    work[WORK.north_rate, k], work[WORK.east_rate, k], work[WORK.down_rate, k] = (
        to_north * north,
        to_east * east,
        down,
    )
    u, v, w = (
        x[X.u, k] - wind_u - h[H.gust_u, k],
        x[X.v, k] - wind_v - h[H.gust_v, k],
        x[X.w, k] - wind_w - h[H.gust_w, k],
    )
    work[WORK.air_u, k], work[WORK.air_v, k], work[WORK.air_w, k] = u, v, w
    speed = math.sqrt(u * u + v * v + w * w)
    pressure, warm = _air(model.layers, altitude)
    temperature = warm + h[H.temperature_offset, k]
    density = h[H.density_ratio, k] * pressure / (GAS_CONSTANT * warm)
    chan[CHAN.V, k], chan[CHAN.alpha, k], chan[CHAN.beta, k] = (
        speed,
        min(speed / STILL_AIR, 1.0) * math.atan2(w, u),
        math.asin(v / max(speed, STILL_AIR)),
    )
    chan[CHAN.p, k], chan[CHAN.q, k], chan[CHAN.r, k] = p, q, r
    chan[CHAN.rho, k], chan[CHAN.qbar, k] = density, 0.5 * density * speed * speed
    chan[CHAN.mach, k] = speed / math.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature)
    chan[CHAN.temperature, k], chan[CHAN.static_pressure, k], chan[CHAN.altitude, k] = (
        temperature,
        pressure,
        altitude,
    )
    a, b, c, d = x[X.e0, k], x[X.e1, k], x[X.e2, k], x[X.e3, k]
    chan[CHAN.phi, k] = math.atan2(2.0 * (c * d + a * b), a * a - b * b - c * c + d * d)
    chan[CHAN.theta, k] = math.asin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    chan[CHAN.psi, k] = math.atan2(2.0 * (b * c + a * d), a * a + b * b - c * c - d * d)
    chan[CHAN.north, k], chan[CHAN.east, k] = x[X.north, k], x[X.east, k]
    chan[CHAN.velocity_north, k], chan[CHAN.velocity_east, k], chan[CHAN.velocity_down, k] = (
        north,
        east,
        down,
    )
    chan[CHAN.height_above_ground, k] = altitude - h[H.ground_altitude, k]
    for j in range(CHAN.ax):
        if model.motion[j] >= 0:
            slots[model.motion[j], k] = chan[j, k]
    # The aerodynamics feel the rates against air that itself rotates; gyros do not show that.
    for rate, turning in ((CHAN.p, H.gust_p), (CHAN.q, H.gust_q), (CHAN.r, H.gust_r)):
        if model.motion[rate] >= 0:
            slots[model.motion[rate], k] = chan[rate, k] - h[turning, k]
    for j in range(INPUTS):
        if model.surroundings[j] >= 0:
            slots[model.surroundings[j], k] = h[j, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _loads(model: Numbers, h: Array, k: int, slots: Array, chan: Array, work: Array) -> None:
    """Specific force of one run, into `chan`, and its moment about the CG, into `work`."""
    area, chord, span = model.reference.area, model.reference.chord, model.reference.span
    scale = (
        model.reference.pressure if model.reference.pressure > 0.0 else chan[CHAN.qbar, k]
    ) * area
    fx = fy = fz = mx = my = mz = 0.0
    if scale > 0.0:  # still air has no loads, whatever an expression divides by
        fx, fy, fz = (
            scale * slots[model.totals[TOTAL.CX], k],
            scale * slots[model.totals[TOTAL.CY], k],
            scale * slots[model.totals[TOTAL.CZ], k],
        )
        mx, my, mz = (
            scale * span * slots[model.totals[TOTAL.Cl], k],
            scale * chord * slots[model.totals[TOTAL.Cm], k],
            scale * span * slots[model.totals[TOTAL.Cn], k],
        )
    if model.loads.shape[0] > 0:
        fx, fy, fz = (
            fx + slots[model.loads[TOTAL.CX], k],
            fy + slots[model.loads[TOTAL.CY], k],
            fz + slots[model.loads[TOTAL.CZ], k],
        )
        mx, my, mz = (
            mx + slots[model.loads[TOTAL.Cl], k],
            my + slots[model.loads[TOTAL.Cm], k],
            mz + slots[model.loads[TOTAL.Cn], k],
        )
    ax, ay, az = (
        model.reference.x - h[H.cg_x, k],
        model.reference.y - h[H.cg_y, k],
        model.reference.z - h[H.cg_z, k],
    )
    mx, my, mz = (
        mx + ay * fz - az * fy + h[H.moment_x, k],
        my + az * fx - ax * fz + h[H.moment_y, k],
        mz + ax * fy - ay * fx + h[H.moment_z, k],
    )
    fx, fy, fz = fx + h[H.force_x, k], fy + h[H.force_y, k], fz + h[H.force_z, k]
    for e in range(model.thrust.shape[0]):
        thrust = slots[model.thrust[e], k]
        tx, ty, tz = (
            thrust * model.lines[e, LINE.x],
            thrust * model.lines[e, LINE.y],
            thrust * model.lines[e, LINE.z],
        )
        ax, ay, az = (
            model.lines[e, LINE.point_x] - h[H.cg_x, k],
            model.lines[e, LINE.point_y] - h[H.cg_y, k],
            model.lines[e, LINE.point_z] - h[H.cg_z, k],
        )
        fx, fy, fz = fx + tx, fy + ty, fz + tz
        mx, my, mz = mx + ay * tz - az * ty, my + az * tx - ax * tz, mz + ax * ty - ay * tx
    work[WORK.moment_x, k], work[WORK.moment_y, k], work[WORK.moment_z, k] = mx, my, mz
    chan[CHAN.ax, k], chan[CHAN.ay, k], chan[CHAN.az, k] = (
        fx / h[H.mass, k],
        fy / h[H.mass, k],
        fz / h[H.mass, k],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _accelerate(x: Array, k: int, chan: Array, work: Array) -> None:
    """Rate of the velocity over the earth, into `work`."""
    p, q, r = (
        x[X.p, k] + work[WORK.earth_p, k],
        x[X.q, k] + work[WORK.earth_q, k],
        x[X.r, k] + work[WORK.earth_r, k],
    )
    u, v, w = x[X.u, k], x[X.v, k], x[X.w, k]
    work[WORK.u_rate, k] = chan[CHAN.ax, k] + work[WORK.gravity_x, k] - (q * w - r * v)
    work[WORK.v_rate, k] = chan[CHAN.ay, k] + work[WORK.gravity_y, k] - (r * u - p * w)
    work[WORK.w_rate, k] = chan[CHAN.az, k] + work[WORK.gravity_z, k] - (p * v - q * u)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(
    model: Numbers, x: Array, h: Array, dh: Array, lanes: int, short: float, slots: Array,
    cells: Integers, outside: NDArray[np.bool_], chan: Array, work: Array, out: Array,
) -> int:  # fmt: skip
    """Time derivative of the states of all runs; returns how many runs found no alphadot.

    Parameters
    ----------
    x : rows `X` and further states (k).
    h, dh : rows `H`, inputs and references of feedback (k), and their rates [1/s].
    short : lag of an actuator that has a rate limit but no lag [s].
    slots : (s, k), constants and parameters given. cells, outside : as `execute`.
    chan : rows `CHAN`, written; alphadot and betadot hold the start of the search.
    work : rows `WORK`, written; the slopes are kept from one call to the next.
    out : as x, written.
    """
    inputs, states, actuated = model.inputs.shape[0], model.states.shape[0], model.actuated.shape[0]
    for k in range(lanes):
        _prepare(model, x, h, dh, k, slots, chan, work)
        for j in range(model.gains.shape[0]):
            number, channel = int(model.gains[j, GAIN.number]), int(model.gains[j, GAIN.channel])
            now = chan[FEEDBACK_ROWS[channel], k]
            h[INPUTS + number, k] += model.gains[j, GAIN.gain] * (
                h[INPUTS + inputs + channel, k] - now
            )
        for j in range(actuated):
            number, position = model.actuated[j], x[EXTRA + states + j, k]
            low, high, rate, lag = model.actuators[j]
            target = min(max(h[INPUTS + number, k], low), high)
            out[EXTRA + states + j, k] = 0.0
            if lag == 0.0 and rate == np.inf:
                h[INPUTS + number, k] = target
            else:
                change = (target - position) / (lag if lag > 0.0 else short)
                out[EXTRA + states + j, k] = min(max(change, -rate), rate)
                h[INPUTS + number, k] = position
        for j in range(inputs):
            slots[model.inputs[j], k] = h[INPUTS + j, k]
        for j in range(states):
            slots[model.states[j], k] = x[EXTRA + j, k]
    moving = model.motion[CHAN.alphadot] >= 0 or model.motion[CHAN.betadot] >= 0
    lost = 0
    for attempt in range(_EVALUATIONS if moving else 1):
        execute(model.program, slots, cells, outside, lanes)
        lost = 0
        for k in range(lanes):
            _loads(model, h, k, slots, chan, work)
            _accelerate(x, k, chan, work)
            u, v, w = work[WORK.air_u, k], work[WORK.air_v, k], work[WORK.air_w, k]
            du, dv, dw = (
                work[WORK.u_rate, k] - work[WORK.air_u_rate, k],
                work[WORK.v_rate, k] - work[WORK.air_v_rate, k],
                work[WORK.w_rate, k] - work[WORK.air_w_rate, k],
            )
            plane, speed = u * u + w * w, chan[CHAN.V, k]
            rate = (u * dw - w * du) / max(plane, STILL_AIR * STILL_AIR)
            slip = (dv * plane - v * (u * du + w * dw)) / max(
                speed * speed * math.sqrt(plane), STILL_AIR * STILL_AIR * STILL_AIR
            )
            if not moving:
                chan[CHAN.alphadot, k], chan[CHAN.betadot, k] = rate, slip
                continue
            # Each rate depends almost linearly on what the database was given: secants of both.
            gap, gap_slip = rate - chan[CHAN.alphadot, k], slip - chan[CHAN.betadot, k]
            if abs(gap) > _TOLERANCE * (1.0 + abs(rate)) or abs(gap_slip) > _TOLERANCE * (
                1.0 + abs(slip)
            ):
                lost += 1
            elif attempt > 0:
                continue
            if attempt > 0:
                for slope, moved, now, before in (
                    (WORK.slope, WORK.moved, gap, work[WORK.gap, k]),
                    (WORK.slope_slip, WORK.moved_slip, gap_slip, work[WORK.gap_slip, k]),
                ):
                    change = work[moved, k]
                    if abs(change) > 1e-9:
                        work[slope, k] = min(max((now - before) / change, -1.9), -0.1)
            work[WORK.gap, k], work[WORK.gap_slip, k] = gap, gap_slip
            work[WORK.moved, k], work[WORK.moved_slip, k] = (
                -gap / work[WORK.slope, k],
                -gap_slip / work[WORK.slope_slip, k],
            )
            chan[CHAN.alphadot, k] += work[WORK.moved, k]
            chan[CHAN.betadot, k] += work[WORK.moved_slip, k]
            for j in (CHAN.alphadot, CHAN.betadot):
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
    p, q, r = x[X.p, k], x[X.q, k], x[X.r, k]
    ixx, iyy, izz, ixz, ixy, iyz = (
        h[H.Ixx, k],
        h[H.Iyy, k],
        h[H.Izz, k],
        h[H.Ixz, k],
        h[H.Ixy, k],
        h[H.Iyz, k],
    )
    hx, hy, hz = (
        ixx * p - ixy * q - ixz * r,
        iyy * q - ixy * p - iyz * r,
        izz * r - ixz * p - iyz * q,
    )
    mx, my, mz = (
        work[WORK.moment_x, k] - (q * hz - r * hy),
        work[WORK.moment_y, k] - (r * hx - p * hz),
        work[WORK.moment_z, k] - (p * hy - q * hx),
    )
    xx, yy, zz = iyy * izz - iyz * iyz, ixx * izz - ixz * ixz, ixx * iyy - ixy * ixy
    xy, xz, yz = ixy * izz + iyz * ixz, ixy * iyz + iyy * ixz, ixx * iyz + ixy * ixz
    determinant = ixx * xx - ixy * xy - ixz * xz
    out[X.u, k], out[X.v, k], out[X.w, k] = (
        work[WORK.u_rate, k],
        work[WORK.v_rate, k],
        work[WORK.w_rate, k],
    )
    out[X.p, k] = (xx * mx + xy * my + xz * mz) / determinant
    out[X.q, k] = (xy * mx + yy * my + yz * mz) / determinant
    out[X.r, k] = (xz * mx + yz * my + zz * mz) / determinant
    p, q, r = p - work[WORK.frame_p, k], q - work[WORK.frame_q, k], r - work[WORK.frame_r, k]
    a, b, c, d = x[X.e0, k], x[X.e1, k], x[X.e2, k], x[X.e3, k]
    # The earth's and the transport rate are subtracted in body axes, where they are the same.
    pull = 1.0 - (a * a + b * b + c * c + d * d)
    out[X.e0, k] = -0.5 * (b * p + c * q + d * r) + pull * a
    out[X.e1, k] = 0.5 * (a * p + c * r - d * q) + pull * b
    out[X.e2, k] = 0.5 * (a * q + d * p - b * r) + pull * c
    out[X.e3, k] = 0.5 * (a * r + b * q - c * p) + pull * d
    out[X.north, k], out[X.east, k], out[X.down, k] = (
        work[WORK.north_rate, k],
        work[WORK.east_rate, k],
        work[WORK.down_rate, k],
    )
    for j in range(X.p, X.r + 1):
        chan[CHAN.pdot + j - X.p, k] = out[j, k]
    for j in range(model.totals.shape[0]):
        chan[CHAN.CX + j, k] = slots[model.totals[j], k]
    if model.loads.shape[0] > 0:
        scale = (
            model.reference.pressure if model.reference.pressure > 0.0 else chan[CHAN.qbar, k]
        ) * model.reference.area
        for j, length in enumerate(
            (1.0, 1.0, 1.0, model.reference.span, model.reference.chord, model.reference.span)
        ):
            if scale != 0.0:  # without dynamic pressure a load has no coefficient
                chan[CHAN.CX + j, k] += slots[model.loads[j], k] / (scale * length)
    for j in range(model.states.shape[0]):
        out[EXTRA + j, k] = 0.0
        if model.laws[j, LAW.relaxation] > 0.0:
            tau = model.laws[j, LAW.relaxation] / chan[CHAN.V, k]
            out[EXTRA + j, k] = (slots[model.steady[j], k] - x[EXTRA + j, k]) / tau
        elif model.laws[j, LAW.relaxation] < 0.0:
            out[EXTRA + j, k] = slots[model.steady[j], k]
