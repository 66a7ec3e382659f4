"""Flights of a helicopter blade by blade: an azimuth-resolved rotor, and inflow with wake distortion.

Independent of the program and of `tests.support.helicopter`, whose data it shares: each of four blades
flaps by itself, its lift is integrated over ten radii without the truncation by advance ratio. Inflow is
that of Pitt and Peters with the terms (1/Omega) L^-1 [0, Kp (p - bs'), Kq (q - bc')]. Many flights are
integrated at once (columns).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from aerodb.support import Array
from tests.support.helicopter import (
    AREA,
    BLADES,
    FIN_LIMIT,
    FLAP,
    FREQUENCY,
    FUSELAGE,
    HEIGHT,
    INERTIA,
    MASS,
    OMEGA,
    RADIUS,
    RHO,
    SLOPE,
    SOLIDITY,
    SPAN,
    SPRING,
    TAIL,
    TAIL_ARM,
    TAIL_HEIGHT,
    TWIST,
    WEATHERCOCK,
)

GRAVITY, STEP, EVERY = 9.80665, 0.0025, 4
CONTROLS: Final = ("collective", "lateral", "longitudinal", "pedal")
CHORD: Final = SOLIDITY * np.pi * RADIUS / BLADES
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
RADII: Final = 0.5 * (_NODES + 1.0)[:, None, None]
WEIGHTS: Final = 0.5 * _WEIGHTS
TENSOR: Final = np.array([
    [INERTIA["Ixx"], 0.0, -INERTIA["Ixz"]], [0.0, INERTIA["Iyy"], 0.0],
    [-INERTIA["Ixz"], 0.0, INERTIA["Izz"]],
])  # fmt: skip
INVERSE: Final = np.linalg.inv(TENSOR)
#: Standard deviations: gyros [rad/s], accelerometers [m/s2], velocity [m/s], attitude [rad].
GYRO, ACCELEROMETER, VELOCITY, ATTITUDE = 0.003, 0.05, 0.05, 0.002
#: Deflections of a hover: collective, lateral and longitudinal cyclic, pedal [rad].
HOVER: Final = np.array([0.271, 0.003, 0.001, 0.097])
#: The same at 38 m/s, advance ratio .18; roll and pitch attitude of both [rad].
CRUISE: Final = np.array([0.242, 0.011, -0.056, 0.040])
HOVER_ATTITUDE, CRUISE_ATTITUDE = np.array([-0.052, 0.0]), np.array([-0.021, -0.050])


def turned(euler: Array) -> Array:
    """The turn (3, 3, k) from body to earth axes of Euler angles (3, k) [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(euler), np.sin(euler)
    return np.array([
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ])  # fmt: skip


def motion(state: Array, turn: Array, force: Array, moment: Array) -> Array:
    """Rates (9, k) of velocity over the earth, Euler angles and body rates, under loads (3, k) [N, N m] in
    body axes at the CG. turn : from body to earth axes."""
    (phi, theta, _), (p, q, r) = state[3:6], state[6:9]
    made = np.empty((9, state.shape[1]))
    made[0:3] = np.einsum("ij...,j...->i...", turn, force / MASS)
    made[2] += GRAVITY
    yaw = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
    made[3:6] = p + yaw * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), yaw
    spin = state[6:9]
    made[6:9] = INVERSE @ (moment - np.cross(spin, TENSOR @ spin, axis=0))
    return made


def _derivative(
    state: Array,
    azimuth: float,
    controls: Array,
    air: Array,
    kp: float,
    kq: float,
    skewed: bool = False,
) -> tuple[Array, Array]:
    """Rates of the state (20, k) and the specific force (3, k). State: velocity over the earth, Euler
    angles, rates, flap angles and speeds of four blades [rad, rad/s], inflow."""
    velocity, euler, (p, q, r) = state[0:3], state[3:6], state[6:9]
    flap, speed, (l0, ls, lc) = state[9:13], state[13:17] / OMEGA, state[17:20]
    turn = turned(euler)
    u, v, w = np.einsum("ji...,j...->i...", turn, velocity - air)
    tip = OMEGA * RADIUS
    psi = (azimuth + np.arange(4) * np.pi / 2)[:, None]
    sin, cos = np.sin(psi), np.cos(psi)
    hub_u, hub_v, hub_w = (u - q * HEIGHT) / tip, (v + p * HEIGHT) / tip, w / tip
    collective, lateral, longitudinal, pedal = controls
    pitch = collective + TWIST * RADII + lateral * cos + longitudinal * sin
    tangential = RADII + hub_u * sin + hub_v * cos
    normal = (
        RADII * (speed - p / OMEGA * sin - q / OMEGA * cos)
        + l0 + RADII * (ls * sin + lc * cos) - hub_w + flap * (hub_u * cos - hub_v * sin)
    )  # fmt: skip
    lift = (
        0.5 * RHO * SLOPE * CHORD * tip**2 * RADIUS * (tangential**2 * pitch - tangential * normal)
    )
    force = np.einsum("r,rbk->bk", WEIGHTS, lift)
    moment = RADIUS * np.einsum("r,rbk->bk", WEIGHTS * RADII[:, 0, 0], lift)
    thrust = force.sum(axis=0)
    bc, bs = 0.5 * (flap * cos).sum(axis=0), 0.5 * (flap * sin).sum(axis=0)
    bc_rate = 0.5 * (speed * cos - flap * sin).sum(axis=0)
    bs_rate = 0.5 * (speed * sin + flap * cos).sum(axis=0)
    side = TAIL * pedal
    drag = [0.5 * RHO * area * x * np.abs(x) for area, x in zip(FUSELAGE, (u, v, w), strict=True)]
    body = np.array([thrust * bc - drag[0], -thrust * bs + side - drag[1], -thrust - drag[2]])
    beta = np.clip(np.arctan2(v, np.hypot(u, w)), -FIN_LIMIT, FIN_LIMIT)
    fin = 0.5 * RHO * (u**2 + v**2 + w**2) * AREA * SPAN * np.where(beta < 0.0, *WEATHERCOCK) * beta
    about = np.array([
        -SPRING * (flap * sin).sum(axis=0) - HEIGHT * thrust * bs + TAIL_HEIGHT * side,
        -SPRING * (flap * cos).sum(axis=0) - HEIGHT * thrust * bc,
        -TAIL_ARM * side + thrust * RADIUS * (l0 + 0.01) - 3000.0 * r + fin,
    ])  # fmt: skip
    made = np.empty_like(state)
    made[:9] = motion(state, turn, body, about)
    turning = made[6:9]
    made[9:13] = state[13:17]
    made[13:17] = (
        -FREQUENCY * OMEGA**2 * flap + 2.0 * OMEGA * (p * cos - q * sin)
        + turning[0] * sin + turning[1] * cos + moment / FLAP
    )  # fmt: skip
    size = RHO * np.pi * RADIUS**2 * tip**2
    through = l0 - hub_w
    edge = hub_u**2 + hub_v**2
    total = np.sqrt(edge + through**2)
    mean = 0.5 * (edge + through * (through + l0)) / total
    load_s, load_c = ((moment * x).sum(axis=0) / (size * RADIUS) for x in (sin, cos))
    made[17] = OMEGA * 75 * np.pi / 128 * (thrust / size - 2.0 * total * l0)
    made[18] = OMEGA * 45 * np.pi / 16 * (load_s - mean * (ls - kp * (p / OMEGA - bs_rate)))
    made[19] = OMEGA * 45 * np.pi / 16 * (load_c - mean * (lc - kq * (q / OMEGA - bc_rate)))
    if skewed:  # gains of a wake that leaves the disc at an angle, of sine `down`
        down = np.clip(through / total, 0.0, 1.0)
        side_k = 15 * np.pi / 64 * np.sqrt((1 - down) / (1 + down))
        nought = np.zeros_like(down)
        gains = np.array([
            [nought + 0.5, nought, -side_k], [nought, 4 / (1 + down), nought],
            [side_k, nought, 4 * down / (1 + down)],
        ])  # fmt: skip
        flow = np.array([total, 2 * mean, 2 * mean])
        own = np.array([
            l0, ls - kp * (p / OMEGA - bs_rate), lc - kq * (q / OMEGA - bc_rate)
        ])  # fmt: skip
        held = flow * np.linalg.solve(np.moveaxis(gains, -1, 0), own.T[..., None])[..., 0].T
        masses = np.array([75 * np.pi / 128, 45 * np.pi / 16, 45 * np.pi / 16])[:, None]
        made[17:20] = OMEGA * masses * (np.array([thrust / size, load_s, load_c]) - held)
    return made, body / MASS


def fly(
    folder: Path, seeds: Sequence[int], seconds: float = 40.0, *, kp: float = 2.5, kq: float = 1.6,
    gusts: float = 0.3, speed: float = 0.0,
) -> list[Path]:  # fmt: skip
    """Fly hovers under test inputs on both cyclics, one per seed, and write what is logged.

    gusts : standard deviation [m/s]. speed : ahead [m/s], 0 or 38, whose wake is skewed: what theory
    has there for the gains, and the database has not.
    """
    k, steps = len(seeds), round(seconds / STEP)
    draws = [np.random.default_rng([4, seed]) for seed in seeds]
    omega = np.array([d.uniform(0.8, 12.0, (8, 4)) for d in draws])
    phase = np.array([d.uniform(0.0, 6.28, (8, 4)) for d in draws])
    size = np.array([0.004, 0.006, 0.009, 0.01])[:, None]
    blow = np.array([d.standard_normal((steps, 3)) for d in draws])
    decay = np.exp(-STEP / 1.5)
    state = np.zeros((20, k))
    tight = 2.5 if speed else 1.0
    trimmed, attitude = (CRUISE, CRUISE_ATTITUDE) if speed else (HOVER, HOVER_ATTITUDE)
    state[0], state[3:5] = speed, attitude[:, None]
    state[9:13], state[17] = 0.05, 0.015 if speed else 0.05
    air = np.zeros((3, k))
    rows: list[tuple[Array, ...]] = []
    controls = trimmed[:, None] + np.zeros(k)
    for number in range(steps):
        now = number * STEP
        dither = size * np.sin(omega * now + phase).sum(axis=1).T * min(1.0, now / 2.0)
        turn = turned(state[3:6])
        u, v, w = np.einsum("ji...,j...->i...", turn, state[0:3])
        phi, theta, psi = state[3:6]
        pitch, roll = (
            np.clip(0.06 * (u - speed), -0.15, 0.15) + attitude[1],
            attitude[0] - np.clip(0.06 * v, -0.15, 0.15),
        )
        held = np.array([
            0.02 * w, -0.05 * (roll - phi) + 0.01 * state[6],
            tight * (0.15 * (pitch - theta) - 0.04 * state[7]), 0.1 * psi + 0.1 * state[8],
        ])  # fmt: skip
        held_before = controls
        controls = trimmed[:, None] + np.clip(held, -0.1, 0.1) + dither
        azimuth = OMEGA * now
        first, pull = _derivative(state, azimuth, controls, air, kp, kq, speed > 0.0)
        before, middle = state, state + 0.5 * STEP * first
        state = (
            state
            + STEP * _derivative(middle, azimuth + 0.5 * OMEGA * STEP, controls, air, kp, kq)[0]
        )
        if number % EVERY == 0:
            rows.append((before, 0.5 * (held_before + controls), pull))  # a staircase at its step
        air = decay * air + gusts * np.sqrt(1 - decay**2) * blow[:, number].T
    states, deflections, force = (np.array([row[j] for row in rows]) for j in range(3))
    return [
        write_log(folder / f"hover-{seed}.csv", seed, STEP * EVERY, states[..., j],
                  deflections[..., j], force[..., j])
        for j, seed in enumerate(seeds)
    ]  # fmt: skip


def write_log(
    path: Path, seed: int, interval: float, states: Array, controls: Array, force: Array,
    air: Mapping[str, Array] | None = None,
) -> Path:  # fmt: skip
    """Write what a flight logs every `interval` s, with noise: states (n, 9), controls (n, 4) [rad], specific
    force (n, 3). air : further columns, as they are."""
    rng = np.random.default_rng([5, seed])
    n = len(states)
    noise = np.repeat([VELOCITY, ATTITUDE, GYRO], 3) * rng.standard_normal((n, 9))
    logged = states[:, :9] + noise
    of = {
        "time [s]": np.arange(n) * interval,
        **{f"velocity_{x} [m/s]": logged[:, j] for j, x in enumerate(("north", "east", "down"))},
        **{f"{x} [rad]": logged[:, 3 + j] for j, x in enumerate(("phi", "theta", "psi"))},
        **{f"{x} [rad/s]": logged[:, 6 + j] for j, x in enumerate("pqr")},
        **{f"a{x} [m/s^2]": force[:, j] + ACCELEROMETER * rng.standard_normal(n) for j, x in enumerate("xyz")},
        "rho [kg/m^3]": np.full(n, RHO),
        "altitude [m]": 100.0 - np.cumsum(states[:, 2]) * interval,
        **{f"delta_{x} [rad]": controls[:, j] for j, x in enumerate(CONTROLS)},
        **(air or {}),
    }  # fmt: skip
    np.savetxt(path, np.column_stack([*of.values()]), "%.9g", ",", header=",".join(of), comments="")
    return path
