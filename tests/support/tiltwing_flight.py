"""Flights of a tilt-wing of its own equations, through hover, transition and forward flight.

Constants of Galliker, Data-Driven Dynamics Modelling Using Flight Logs (2021), appendix A: mass,
inertia, positions, speeds of the rotors over their commands, static thrust. What the appendix does not
state (drag, wing, tail) is ordinary for such a vehicle. Independent of the program: the equations are
written here once more as vectors. Many flights are integrated at once (columns).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from aerodb.support import Array

MASS, INERTIA = 6.1, np.array([0.66, 0.33, 1.00])
RHO, GRAVITY = 1.225, 9.80665
#: x, y, z [m] of the main rotors from the CG, and their turning: outer and inner right, outer and inner left.
PLACES: Final = np.array([[0.055, 0.748, -0.02], [0.055, 0.323, -0.02],
                          [0.055, -0.748, -0.02], [0.055, -0.323, -0.02]])  # fmt: skip
TURNS: Final = np.array([1.0, -1.0, -1.0, 1.0])
NAMES: Final = ("outer_right", "inner_right", "outer_left", "inner_left", "tail")
TAIL_ROTOR: Final = np.array([-0.573, 0.0, 0.04])
DIAMETER, TAIL_DIAMETER = 0.4064, 0.254
#: Static thrust coefficients that give 33.3 N at 7,113 rpm and 9.4 N at 9,200 rpm.
CT0, TAIL_CT0 = 0.0709, 0.0784
CT1, TAIL_CT1, CQ, ROTOR_DRAG = 0.09, 0.08, 0.005, 1.5e-3
#: Wing sections: x, z [m], area [m2], lift slope [1/rad], effect of the ailerons on the outer two.
WING_X, WING_Z, WING_AREA, SLOPE, AILERON = 0.02, -0.02, 0.13, 4.6, 0.45
CD0, INDUCED, FLAT, PLATE = 0.02, 0.05, 1.0, (0.05, 1.8)
STALL, SHARP = np.deg2rad(15.0), 30.0
#: Tail and fin: place [m], area [m2], lift slope [1/rad]; effect of the elevator.
TAIL, TAIL_AREA, TAIL_SLOPE, ELEVATOR = np.array([-0.85, 0.0, 0.0]), 0.09, 3.6, 0.6
FIN, FIN_AREA, FIN_SLOPE = np.array([-0.85, 0.0, -0.15]), 0.06, 3.0
#: Drag areas of the fuselage by axes [m2].
FUSELAGE: Final = np.array([0.015, 0.06, 0.05])
MOTOR, RATE = 0.03, 50.0
GYRO, ACCELEROMETER, VELOCITY, ATTITUDE, TILT = 0.005, 0.1, 0.05, 0.003, 0.005


def speeds(commands: Array) -> Array:
    """Revolutions per second (5, ...) of commands 0 to 1 (5, ...), four main rotors and the tail's."""
    u = commands
    main, tail = -3058.0 * u**2 + 9945.0 * u + 226.0, -1895.0 * u**2 + 10882.0 * u + 213.0
    return np.concatenate([main[:4], tail[4:]]) / 60.0


def static_thrust(command: float) -> tuple[float, float]:
    """Thrust [N] of a main rotor and of the tail's, in no flow."""
    n = speeds(np.full(5, command))
    return (float(RHO * n[0] ** 2 * DIAMETER**4 * CT0),
            float(RHO * n[4] ** 2 * TAIL_DIAMETER**4 * TAIL_CT0))  # fmt: skip


def _plate(
    alpha: Array, attached: Array, drag: Array, low: float, high: float
) -> tuple[Array, Array]:
    """Lift and drag coefficients of attached flow that goes over to a flat plate."""
    away = np.exp(-SHARP * (alpha - STALL))
    other = np.exp(SHARP * (alpha + STALL))
    share = (1.0 + away + other) / ((1.0 + away) * (1.0 + other))
    share = np.where(np.isfinite(share), share, 1.0)
    flat = low + (high - low) * np.sin(alpha) ** 2
    return (1 - share) * attached + share * FLAT * np.sin(2 * alpha), (
        1 - share
    ) * drag + share * flat


def _cross(a: Array, b: Array) -> Array:
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def loads(
    air: Array, rates: Array, n: Array, tilt: Array, elevator: Array, aileron: Array
) -> Array:
    """Forces [N] and moments [N m] (6, k) about the CG, body axes: of the velocity through the air (3, k)
    [m/s], rates (3, k), rotor speeds (5, k) [rev/s] and angles (k,) [rad]."""
    zero = np.zeros_like(tilt)
    axis = np.array([np.cos(tilt), zero, -np.sin(tilt)])
    down = np.array([np.sin(tilt), zero, np.cos(tilt)])
    force, moment = np.zeros_like(air), np.zeros_like(air)
    for j in range(5):
        tail = j == 4
        arm = (TAIL_ROTOR if tail else PLACES[j])[:, None]
        along = np.array([zero, zero, zero - 1.0]) if tail else axis
        d, c0, c1 = (TAIL_DIAMETER, TAIL_CT0, TAIL_CT1) if tail else (DIAMETER, CT0, CT1)
        flow = air + _cross(rates, arm + 0.0 * air)
        u = (flow * along).sum(axis=0)
        thrust = RHO * d**3 * n[j] * (n[j] * d * c0 - c1 * u)
        own = thrust * along - ROTOR_DRAG * n[j] * (flow - u * along)
        turn = 1.0 if tail else TURNS[j]
        force += own
        moment += _cross(arm + 0.0 * air, own) - turn * RHO * n[j] ** 2 * d**5 * CQ * along
        if tail:
            continue
        area = np.pi * d**2 / 4.0
        induced = 0.5 * (np.sqrt(np.maximum(u**2 + 2.0 * thrust / (RHO * area), 0.0)) - u)
        back = PLACES[j, 0] - WING_X
        at = np.array([WING_X, PLACES[j, 1], WING_Z])[:, None] + 0.0 * air
        past = air + _cross(rates, at) + (1.0 + back / np.hypot(back, d / 2.0)) * induced * axis
        along_chord, normal = (past * axis).sum(axis=0), (past * down).sum(axis=0)
        side = np.sign(PLACES[j, 1])
        flap = AILERON * side * aileron if j % 2 == 0 else zero
        alpha = np.arctan2(normal, along_chord) + flap
        lift = SLOPE * alpha
        cl, cd = _plate(alpha, lift, CD0 + INDUCED * lift**2, *PLATE)
        size = 0.5 * RHO * WING_AREA * np.hypot(along_chord, normal)
        own = size * (
            (cl * normal - cd * along_chord) * axis - (cl * along_chord + cd * normal) * down
        )
        force += own
        moment += _cross(at, own)
    for at, surface, slope, flap, k in (
        (TAIL, TAIL_AREA, TAIL_SLOPE, ELEVATOR * elevator, 2), (FIN, FIN_AREA, FIN_SLOPE, zero, 1),
    ):  # fmt: skip
        arm = at[:, None] + 0.0 * air
        past = air + _cross(rates, arm)
        alpha = np.arctan2(past[k], past[0]) + flap
        cl, cd = _plate(alpha, slope * alpha, CD0 + 0.0 * alpha, *PLATE)
        size = 0.5 * RHO * surface * np.hypot(past[k], past[0])
        own = np.zeros_like(air)
        own[0], own[k] = size * (cl * past[k] - cd * past[0]), -size * (cl * past[0] + cd * past[k])
        force += own
        moment += _cross(arm, own)
    force -= 0.5 * RHO * FUSELAGE[:, None] * air * np.abs(air)
    return np.concatenate([force, moment])


def _turn(euler: Array) -> Array:
    """Rotation matrices (3, 3, k), body to earth, of roll, pitch and yaw (3, k)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(euler), np.sin(euler)
    return np.array([
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ])  # fmt: skip


@dataclass(frozen=True)
class Flown:
    """Channels of k flights, (n, 3, k) or (n, k): velocity over the earth, Euler angles, rates,
    specific force, commands (n, 5, k), tilt, elevator, aileron [rad], altitude [m]."""

    time: Array
    velocity: Array
    euler: Array
    rates: Array
    force: Array
    commands: Array
    tilt: Array
    elevator: Array
    aileron: Array
    altitude: Array
    seeds: tuple[int, ...]


def fly(
    seeds: Sequence[int], seconds: float = 60.0, *, fastest: float = 22.0, gusts: float = 0.1,
    wind: tuple[float, float] = (0.0, 0.0),
) -> Flown:  # fmt: skip
    """Fly one flight per seed. fastest : speed [m/s] of the legs; 0 only hovers, its wing upright.
    gusts : standard deviation [m/s]. wind : north and east [m/s]."""
    k, step, split = len(seeds), 1.0 / RATE, 4
    steps = round(seconds * RATE)
    draws = [np.random.default_rng([2, seed]) for seed in seeds]
    legs = np.array([d.uniform(0.0, 1.0, (steps // 300 + 2, 4)) for d in draws])  # of 6 s
    if fastest > 0.0:
        legs[:, 1::3, 0] = 0.7 + 0.3 * legs[:, 1::3, 0]  # every third leg is fast
        legs[:, ::3, 0] *= 0.3
    blow = np.array([d.standard_normal((steps, 3)) for d in draws])
    omega = np.array([d.uniform(1.0, 9.0, (8, 4)) for d in draws])
    phase = np.array([d.uniform(0.0, 6.28, (8, 4)) for d in draws])
    decay = np.exp(-step / 1.5)
    air, steady = np.zeros((3, k)), np.array([*wind, 0.0])[:, None]
    velocity, euler, rates = np.zeros((3, k)), np.zeros((3, k)), np.zeros((3, k))
    tilt, height = np.full(k, np.pi / 2), np.full(k, 100.0)
    commands = np.full((7, k), 0.55)
    commands[5:] = 0.0
    n, asked = speeds(commands[:5]), velocity.copy()
    rows: list[tuple[Array, ...]] = []
    for number in range(steps):
        now = number * step
        leg = legs[:, number // 300].T
        target = np.array([fastest * leg[0], 12.0 * (leg[1] - 0.5), 5.0 * (leg[2] - 0.5)])
        asked = asked + np.clip(target - asked, -3.0 * step, 3.0 * step)
        dither = np.sin(omega * now + phase[..., :]).sum(axis=2).T / 2.0 * min(1.0, now)
        forward = np.cos(euler[2]) * velocity[0] + np.sin(euler[2]) * velocity[1]
        upright = (
            np.pi / 2 - 1.45 * np.clip(forward / 17.0, 0.0, 1.0) if fastest > 0.0 else np.pi / 2
        )
        wanted_tilt = np.clip(upright + 0.06 * dither[7], 0.0, 1.6)
        tilt = tilt + np.clip(wanted_tilt - tilt, -0.5 * step, 0.5 * step)
        blown = steady + air
        commands = _controlled(
            commands, velocity, euler, rates, tilt, asked, blown, 0.6 * (leg[3] - 0.5)
        )
        given = commands + np.array([0.05] * 4 + [0.12, 0.1, 0.08])[:, None] * dither[:7]
        given[:5], given[5:] = np.clip(given[:5], 0.05, 1.0), np.clip(given[5:], -0.35, 0.35)
        for part in range(split):
            turn = _turn(euler)
            past = np.einsum("ji...,j...->i...", turn, velocity - blown)
            acting = loads(past, rates, n, tilt, given[5], given[6])
            if part == 0:
                rows.append((velocity, euler, rates, acting[:3] / MASS, given, tilt, height))
            h = step / split
            velocity = velocity + h * np.einsum("ij...,j...->i...", turn, acting[:3] / MASS)
            velocity[2] += h * GRAVITY
            height = height - h * velocity[2]
            a, b, c = INERTIA
            p, q, r = rates
            spin = np.array([(c - b) * q * r, (a - c) * r * p, (b - a) * p * q])
            rates = rates + h * (acting[3:] - spin) / INERTIA[:, None]
            p, q, r = rates
            phi, theta = euler[0], euler[1]
            yaw = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
            euler = euler + h * np.array(
                [p + yaw * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), yaw]
            )
            n = n + (1.0 - np.exp(-h / MOTOR)) * (speeds(given[:5]) - n)
        air = decay * air + gusts * np.sqrt(1 - decay**2) * blow[:, number].T
    columns = [np.array([row[j] for row in rows]) for j in range(7)]
    v, e, w, f, c, t, z = columns
    return Flown(
        np.arange(steps) * step, v, e, w, f, c[:, :5], t, c[:, 5], c[:, 6], z, tuple(seeds)
    )


def _controlled(
    commands: Array, velocity: Array, euler: Array, rates: Array, tilt: Array, asked: Array,
    air: Array, turning: Array,
) -> Array:  # fmt: skip
    """Commands (7, k): rotors, elevator and ailerons by the slopes of the loads, which this pilot knows."""
    k = tilt.size
    steps = np.array([*[0.01] * 5, 0.02, 0.02, 0.02, 0.02])  # commands, then roll and pitch
    many = np.repeat(np.concatenate([commands, euler[:2]])[:, None], 10, axis=1)  # (9, 10, k)
    for j in range(9):
        many[j, j + 1] += steps[j]
    spread = np.broadcast_to(euler[2], (10, k)).ravel()
    turned = _turn(np.array([many[7].ravel(), many[8].ravel(), spread]))
    past = np.einsum("ji...,jm...->im...", turned.reshape(3, 3, 10, k), (velocity - air)[:, None])

    def full(x: Array) -> Array:
        return np.broadcast_to(x, (*x.shape[:-1], 10, k)).reshape(*x.shape[:-1], -1)

    flat = loads(
        past.reshape(3, -1), np.repeat(rates[:, None], 10, axis=1).reshape(3, -1),
        speeds(many[:5].reshape(5, -1)), full(tilt), many[5].ravel(), many[6].ravel(),
    )  # fmt: skip
    pull = np.einsum("ij...,j...->i...", turned, flat[:3] / MASS).reshape(3, 10, k)
    heading = np.array(
        [[np.cos(euler[2]), np.sin(euler[2])], [-np.sin(euler[2]), np.cos(euler[2])]]
    )
    level = np.einsum("ij...,jm...->im...", heading, pull[:2])
    found = np.concatenate([level, pull[2:], flat[3:].reshape(3, 10, k)])  # (6, 10, k)
    slope = (found[:, 1:] - found[:, :1]) / steps[:, None]
    own = np.einsum("ij...,j...->i...", heading, velocity[:2])
    fast = np.clip((own[0] - 3.0) / 5.0, 0.0, 1.0)
    side = 0.8 * (asked[1] - own[1]) * (1 - fast) + fast * (turning * own[0] - 0.4 * own[1])
    needed = np.array([
        np.clip(0.9 * (asked[0] - own[0]), -2.0, 2.0), np.clip(side, -2.5, 2.5),
        np.clip(1.2 * (asked[2] - velocity[2]), -2.5, 2.5) - GRAVITY,
    ])  # fmt: skip
    # Attitude and collective for the forces; then all controls for the moments.
    jac = np.stack([slope[:3, 7], slope[:3, 8], slope[:3, :4].sum(axis=1)], axis=1)  # (3, 3, k)
    weight = np.diag([0.6, 0.6, 3.0])
    j = np.moveaxis(jac, -1, 0)
    gap = (needed - found[:3, 0]).T[..., None]
    change = np.linalg.solve(np.swapaxes(j, 1, 2) @ j + weight, np.swapaxes(j, 1, 2) @ gap)[
        ..., 0
    ].T
    roll = np.clip(euler[0] + change[0], -0.5, 0.5) - euler[0]
    pitch = np.clip(euler[1] + change[1], -0.35, 0.35) - euler[1]
    yaw_rate = turning * (1 - fast) + fast * (GRAVITY * np.tan(euler[0]) / np.maximum(own[0], 3.0))
    wanted = INERTIA[:, None] * np.array([
        20.0 * roll - 7.0 * rates[0], 20.0 * pitch - 7.0 * rates[1], 2.5 * (yaw_rate - rates[2]),
    ])  # fmt: skip
    rest = np.array([*[commands[:4].mean(axis=0)] * 4, 0.45 * np.sin(tilt), 0 * tilt, 0 * tilt])
    rest[:4] += 0.5 * change[2]
    moments = np.moveaxis(slope[3:, :7], -1, 0)  # (k, 3, 7)
    keep = np.diag([8.0, 8.0, 8.0, 8.0, 1.0, 0.5, 0.5]) * 0.1
    hold = np.swapaxes(moments, 1, 2)
    missing = (wanted - found[3:, 0]).T[..., None] + moments @ (commands - rest).T[..., None]
    made = np.linalg.solve(hold @ moments + keep, hold @ missing)[..., 0].T
    new = rest + made
    new[:5], new[5:] = np.clip(new[:5], 0.05, 1.0), np.clip(new[5:], -0.35, 0.35)
    return commands + 0.6 * (new - commands)


def write_csv(path: Path, flown: Flown, column: int = 0) -> Path:
    """One of the flights as a table of channels, with noise of the sensors."""
    rng = np.random.default_rng([3, flown.seeds[column]])

    def noisy(values: Array, size: float) -> Array:
        return values + size * rng.standard_normal(values.shape)

    of: dict[str, tuple[str, Array]] = {"time": ("s", flown.time)}
    of |= _three(("p", "q", "r"), "rad/s", noisy(flown.rates[..., column], GYRO))
    of |= _three(("ax", "ay", "az"), "m/s^2", noisy(flown.force[..., column], ACCELEROMETER))
    of |= _three(("phi", "theta", "psi"), "rad", noisy(flown.euler[..., column], ATTITUDE))
    earth = ("velocity_north", "velocity_east", "velocity_down")
    of |= _three(earth, "m/s", noisy(flown.velocity[..., column], VELOCITY))
    of["altitude"] = ("m", flown.altitude[:, column])
    of["rho"] = ("kg/m^3", np.full(len(flown.time), RHO))
    of |= {f"command_{name}": ("1", flown.commands[:, j, column]) for j, name in enumerate(NAMES)}
    of["delta_tilt"] = ("rad", noisy(flown.tilt[:, column], TILT))
    of["delta_elevator"] = ("rad", flown.elevator[:, column])
    of["delta_aileron"] = ("rad", flown.aileron[:, column])
    head = ",".join(f"{name} [{unit}]" for name, (unit, _) in of.items())
    np.savetxt(
        path, np.column_stack([v for _, v in of.values()]), "%.9g", ",", header=head, comments=""
    )
    return path


def _three(names: Sequence[str], unit: str, values: Array) -> Mapping[str, tuple[str, Array]]:
    return {name: (unit, values[:, j]) for j, name in enumerate(names)}
