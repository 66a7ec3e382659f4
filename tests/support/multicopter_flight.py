"""Flights of a quadrotor of its own equations, closed by a controller, and their ULogs of PX4.

Independent of the program: rotors, frame, air, motors and sensors are written here once more. Many
flights are integrated at once (columns), each with its own manoeuvres, air and sensor noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.recording import Topic
from aerodb.storage.writers.ulog import write_ulog
from aerodb.support import Array

MASS, INERTIA = 1.5, np.array([0.029, 0.029, 0.055])
RHO, GRAVITY, DIAMETER = 1.2, 9.80665, 0.254
CT0, CT1, CQ, ROTOR_DRAG = 0.11, 0.1, 0.006, 6e-4
FRAME: Final = np.array([0.010, 0.014, 0.030])
#: Fastest rotor [rev/s], time constant of a motor [s].
FASTEST, MOTOR = 120.0, 0.03
#: Of PX4's quadrotor x: front right, rear left, front left, rear right; x, y, z from the CG, turning.
ROTORS: Final = ((0.16, 0.17, -0.02, 1), (-0.16, -0.17, -0.02, 1),
                 (0.16, -0.17, -0.02, -1), (-0.16, 0.17, -0.02, -1))  # fmt: skip
#: Standard deviations of the sensors: gyros [rad/s], accelerometers [m/s2], velocity [m/s],
#: attitude [rad].
GYRO, ACCELEROMETER, VELOCITY, ATTITUDE = 0.01, 0.15, 0.03, 0.002
#: Moment of the elevator over the area of the wing [m/rad], its travel [rad].
ELEVATOR, TRAVEL = -0.3, np.deg2rad(20.0)
RATE = 250.0
NO_BIASES: Final = np.zeros(6)


@dataclass(frozen=True)
class Flown:
    """Channels of k flights, (n, k) or (n, 3, k): commands (n, 4, k), rotor speeds [rev/s] (n, 4,
    k), quaternion (n, 4, k) body to earth; voltage [V] (n, k)."""

    time: Array
    velocity: Array
    position: Array
    quaternion: Array
    rates: Array
    force: Array
    commands: Array
    speeds: Array
    voltage: Array
    seeds: tuple[int, ...]


def fly(
    seeds: Sequence[int],
    seconds: float = 40.0,
    *,
    strength: Sequence[float] = (1.0, 1.0, 1.0, 1.0),
    wind: tuple[float, float] = (0.0, 0.0),
    gusts: float = 0.3,
    sag: float | Sequence[float] = 0.0,
    regulated: bool = False,
    busy: float = 1.0,
    offset: Sequence[float] = (0.0, 0.0, 0.0),
    wing: float = 0.0,
) -> Flown:
    """Fly one flight per seed.

    strength : share of the thrust of each rotor. wind : north and east [m/s]; gusts : their
    standard deviation [m/s]. sag : share of the voltage lost by the end, or at times that are
    equally spaced; the motors lose as much speed, unless their speed is `regulated`. busy : size of the manoeuvres; 0 only hovers. offset : of the CG (3,) [m]. wing : area
    [m2] of a flat plate at the CG, with an elevator behind it that follows the pitch rate.
    """
    draws = [np.random.default_rng(seed) for seed in seeds]
    k, step = len(seeds), 1.0 / RATE
    steps = round(seconds * RATE)
    shares = np.atleast_1d(sag) if isinstance(sag, Sequence) else np.array([0.0, sag])
    lost = np.asarray(
        np.interp(np.arange(steps) / steps, np.linspace(0.0, 1.0, len(shares)), shares)
    )
    legs = np.array([d.uniform(-1.0, 1.0, (steps, 4)) for d in draws])[:, ::500]  # 2 s each
    blow = np.array([d.standard_normal((steps, 3)) for d in draws])
    rotors = np.array(ROTORS)
    arms = rotors[:, :3] - np.array(offset)
    mixer = np.linalg.inv(
        np.array([np.ones(4), -rotors[:, 1], rotors[:, 0], rotors[:, 3] * CQ / CT0 * DIAMETER])
    )
    air = np.zeros((3, k))
    steady = np.array([*wind, 0.0])[:, None]
    state = np.zeros((17, k))
    state[6] = 1.0
    hover = np.sqrt(MASS * GRAVITY / 4.0 / (RHO * DIAMETER**4 * CT0))
    state[13:17] = hover
    rows: list[tuple[Array, ...]] = []
    decay = np.exp(-step / 1.5)
    for number in range(steps):
        share = 1.0 if regulated else 1.0 - lost[number]
        wanted = busy * legs[:, number // 500].T
        commands = _controlled(state, wanted, mixer)
        blown = steady + air
        rates = _derivative(state, commands, blown, arms, rotors[:, 3], strength, share, wing)
        rows.append((state.copy(), commands, rates[1].copy()))
        middle = state + 0.5 * step * rates[0]
        state = (
            state
            + step
            * _derivative(middle, commands, blown, arms, rotors[:, 3], strength, share, wing)[0]
        )
        state[6:10] /= np.linalg.norm(state[6:10], axis=0)
        air = decay * air + gusts * np.sqrt(1 - decay**2) * blow[:, number].T
    states = np.array([row[0] for row in rows])
    voltage: Array = 16.0 * (1.0 - lost)
    return Flown(
        np.arange(steps) * step, states[:, 3:6], states[:, 0:3], states[:, 6:10],
        states[:, 10:13], np.array([row[2] for row in rows]), np.array([row[1] for row in rows]),
        states[:, 13:17], np.repeat(voltage[:, None], k, axis=1), tuple(seeds),
    )  # fmt: skip


def _turn(q: Array) -> Array:
    """Rotation matrices (3, 3, k), body to earth."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _derivative(
    state: Array, commands: Array, air: Array, arms: Array, turns: Array,
    strength: Sequence[float], share: float, wing: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Rates of the state (17, k) and the specific force (3, k)."""
    turn = _turn(state[6:10])
    p, q, r = state[10:13]
    past = state[3:6] - air
    u, v, w = local = sum(turn[j] * past[j] for j in range(3))
    n = state[13:17]
    x, y, z = arms.T[:, :, None]
    flow = w + p * y - q * x
    thrust = (
        np.asarray(strength)[:, None] * RHO * DIAMETER**3 * n * (n * DIAMETER * CT0 + CT1 * flow)
    )
    fx, fy = -ROTOR_DRAG * n * (u + q * z - r * y), -ROTOR_DRAG * n * (v + r * x - p * z)
    force = np.array([fx.sum(axis=0), fy.sum(axis=0), -thrust.sum(axis=0)])
    force -= 0.5 * RHO * FRAME[:, None] * local * np.abs(local)
    moment = np.array([
        (-y * thrust - z * fy).sum(axis=0),
        (z * fx + x * thrust).sum(axis=0),
        (x * fy - y * fx + turns[:, None] * RHO * n**2 * DIAMETER**5 * CQ).sum(axis=0),
    ])  # fmt: skip
    force[2] -= RHO * wing * w * np.hypot(u, w)
    moment[1] += 0.5 * RHO * u * np.abs(u) * wing * ELEVATOR * elevator(q)
    specific = force / MASS
    made = np.empty_like(state)
    made[0:3] = state[3:6]
    made[3:6] = [sum(turn[i, j] * specific[j] for j in range(3)) for i in range(3)]
    made[5] += GRAVITY
    e0, e1, e2, e3 = state[6:10]
    made[6:10] = 0.5 * np.array([
        -e1 * p - e2 * q - e3 * r, e0 * p + e2 * r - e3 * q,
        e0 * q - e1 * r + e3 * p, e0 * r + e1 * q - e2 * p,
    ])  # fmt: skip
    a, b, c = INERTIA
    made[10:13] = (
        moment - np.array([(c - b) * q * r, (a - c) * r * p, (b - a) * p * q])
    ) / INERTIA[:, None]
    made[13:17] = (FASTEST * share * commands - state[13:17]) / MOTOR
    return made, specific


def elevator(q: Array) -> Array:
    """Deflection [rad] (n,) for a pitch rate (n,) [rad/s]."""
    return np.asarray(TRAVEL * np.clip(2.0 * q, -1.0, 1.0))


def _controlled(state: Array, wanted: Array, mixer: Array) -> Array:
    """Commands (4, k), 0 to 1: velocity 5, 5 and 2 m/s and yaw rate by the legs, then attitude."""
    turn = _turn(state[6:10])
    velocity = np.array([5.0, 5.0, 2.0])[:, None] * wanted[:3]
    pull = 1.2 * (velocity - state[3:6])
    pull[:2] = np.clip(pull[:2], -5.0, 5.0)
    pull[2] -= GRAVITY
    up = [sum(turn[j, i] * pull[j] for j in range(3)) for i in range(3)]  # in body axes
    tilt = np.array([up[1], -up[0]]) / np.maximum(-up[2], 3.0)
    p, q, r = state[10:13]
    moment = np.array([
        INERTIA[0] * (60.0 * tilt[0] - 14.0 * p),
        INERTIA[1] * (60.0 * tilt[1] - 14.0 * q),
        INERTIA[2] * 3.0 * (0.8 * wanted[3] - r),
    ])  # fmt: skip
    lift = np.clip(-MASS * up[2], 4.0, 26.0)
    each = np.clip(mixer @ np.array([lift, *moment]), 0.05, 20.0)
    n = np.sqrt(each / (RHO * DIAMETER**4 * CT0))
    return np.asarray(np.clip(n / FASTEST, 0.05, 1.0))


def parameters(**more: float) -> dict[str, float]:
    """PX4's own of this quadrotor."""
    known: dict[str, float] = {
        "MAV_TYPE": 2, "CA_AIRFRAME": 0, "CA_ROTOR_COUNT": 4, "PWM_MAIN_MIN1": 1100,
    }  # fmt: skip
    for number, (x, y, z, turns) in enumerate(ROTORS):
        known |= {
            f"CA_ROTOR{number}_PX": x, f"CA_ROTOR{number}_PY": y, f"CA_ROTOR{number}_PZ": z,
            f"CA_ROTOR{number}_KM": turns * CQ / CT0 * DIAMETER, f"CA_ROTOR{number}_CT": 6.5,
        }  # fmt: skip
    return {**known, **more}


def write_px4(
    path: Path,
    flown: Flown,
    column: int = 0,
    *,
    known: Mapping[str, float] | None = None,
    pulses: tuple[float, float] | None = None,
    biases: Array = NO_BIASES,
    servos: Array | None = None,
    more: Sequence[Topic] = (),
    pusher: Array | None = None,
) -> None:
    """One of the flights as PX4 logs it, with noise of the sensors.

    servos : (n,) command of the first servo, where there is one. more : further topics. pusher :
    (n,) command of a fifth motor, which turns nothing here. known : parameters. pulses [us] of commands 0 and 1, as former releases log them. biases : of the three
    gyros [rad/s] and accelerometers [m/s2].
    """
    draw = np.random.default_rng(10_000 + flown.seeds[column])
    time = 100.0 + flown.time
    slow = slice(None, None, 5)

    def noisy(values: Array, size: float) -> Array:
        return values + size * draw.standard_normal(values.shape)

    def fields(name: str, values: Array) -> dict[str, Any]:
        return {f"{name}[{j}]": values[:, j].astype(np.float32) for j in range(values.shape[1])}

    quaternion = flown.quaternion[:, :, column]
    small = 0.5 * ATTITUDE * draw.standard_normal((len(time), 3))
    w, x, y, z = quaternion.T
    a, b, c = small.T
    turned = np.array([w - x * a - y * b - z * c, x + w * a + y * c - z * b,
                       y + w * b - x * c + z * a, z + w * c + x * b - y * a]).T  # fmt: skip
    velocity = noisy(flown.velocity[slow, :, column], VELOCITY)
    position = flown.position[slow, :, column]
    local = {
        **{f"v{name}": velocity[:, j].astype(np.float32) for j, name in enumerate("xyz")},
        **{name: position[:, j].astype(np.float32) for j, name in enumerate("xyz")},
    }
    commands = np.zeros((len(time), 12))
    commands[:, :4] = flown.commands[:, :, column]
    if pusher is not None:
        commands[:, 4] = pusher
    topics = [
        Topic("vehicle_angular_velocity", time, fields("xyz", noisy(flown.rates[:, :, column] + biases[:3], GYRO))),
        Topic("vehicle_acceleration", time, fields("xyz", noisy(flown.force[:, :, column] + biases[3:], ACCELEROMETER))),
        Topic("vehicle_attitude", time, fields("q", turned)),
        Topic("vehicle_local_position", time[slow], local),
        Topic("vehicle_air_data", time[slow], {
            "rho": np.full(len(time[slow]), RHO, np.float32),
            "baro_alt_meter": (100.0 - position[:, 2]).astype(np.float32),
        }),
        Topic("actuator_motors", time, fields("control", commands)),
        Topic("battery_status", time[slow], {"voltage_v": flown.voltage[slow, column].astype(np.float32)}),
    ]  # fmt: skip
    if servos is not None:
        topics.append(Topic("actuator_servos", time, fields("control", servos[:, None])))
    topics += more
    if pulses is not None:
        told = pulses[0] + (pulses[1] - pulses[0]) * flown.commands[:, :, column]
        topics = [each for each in topics if each.name != "actuator_motors"]
        topics.append(Topic("actuator_outputs", time, fields("output", told)))
    write_ulog(
        path,
        topics,
        metadata={"sys_name": "PX4"},
        parameters=known if known is not None else parameters(),
    )
