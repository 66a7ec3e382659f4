"""Test flights whose forces and moments are exactly those of a database.

Air angles, speed and deflections are prescribed; body rates are integrated from the database's
moments, so that a perfect log leaves no residual. Accelerometer and air-data probe sit off the CG,
the CG off the moment reference, thrust off both.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.physics.frames import cross
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import transfer_moments
from aerodb.vehicle import Vehicle, parse_vehicle
from aerodb.vehicle.probe import velocity_at_cg

RATE, SECONDS = 50.0, 16.0
AREA, CHORD, SPAN, DENSITY = 16.0, 1.5, 11.0, 1.1

VEHICLE = f"""\
name = "tangent-taxi"
[reference]
area = {AREA}
chord = {CHORD}
span = {SPAN}
[points]
moment_reference = [-2.0, 0.0, 0.0]
imu = [-1.4, 0.1, -0.2]
air_data = [1.2, 0.0, 0.1]
[mass]
source = "constant"
mass = 1100.0
cg = [-2.2, 0.02, 0.05]
Ixx = 1300.0
Iyy = 1800.0
Izz = 2700.0
Ixz = 90.0
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
[surfaces.aileron_right]
limits = ["-25 deg", "25 deg"]
[surfaces.aileron_left]
limits = ["-25 deg", "25 deg"]
[surfaces.rudder]
limits = ["-25 deg", "25 deg"]
[surfaces.flap]
limits = ["0 deg", "40 deg"]
[surfaces.landing_gear]
limits = [0.0, 1.0]
[surfaces.speed_brake]
limits = ["0 deg", "40 deg"]
[surfaces.body_flap]
limits = ["-10 deg", "20 deg"]
[surfaces.strake]
limits = ["-10 deg", "10 deg"]
[combinations.aileron]
kind = "asymmetric"
right = "aileron_right"
left = "aileron_left"
[combinations.flaperon]
kind = "symmetric"
right = "aileron_right"
left = "aileron_left"
[thrust]
source = "channel"
point = [0.5, 0.0, 0.15]
[processing]
bandwidth = "10 Hz"
"""

HEADER_ONLY = f"""\
name = "tangent-taxi"
[reference]
area = {AREA}
chord = {CHORD}
span = {SPAN}
moment_reference = [-2.1, 0.0, 0.1]
"""
_MOMENTS = """\
[tables.lift]
arguments = ["alpha"]
units = ["deg"]
breakpoints = [[-8, -4, 0, 4, 8, 12, 16]]
values = [-0.4, 0.0, 0.4, 0.78, 1.14, 1.47, 1.75]
[tables.Clb]
arguments = ["beta", "alpha"]
units = ["deg", "deg"]
breakpoints = [[-20, -10, -5, 0, 5, 10, 20], [0, 10]]
values = [[0.03, 0.05], [0.016, 0.024], \
[0.009, 0.011], [0.0, 0.0], [-0.008, -0.012], [-0.017, -0.023], [-0.03, -0.046]]
[[terms]]
name = "dihedral"
axis = "Cl"
expression = "Clb(beta, alpha)"
[[terms]]
name = "rudder_yaw"
axis = "Cn"
expression = "-0.07*delta_rudder*(1 - 0.4*alpha)"
[derivatives.Cl]
p_hat = -0.48
r_hat = 0.1
delta_aileron = -0.16
delta_rudder = 0.01
[derivatives.Cm]
"1" = -0.02
alpha = -0.25
q_hat = -14.0
alphadot_hat = -5.0
delta_elevator = -1.1
delta_flaperon = -0.1
delta_flap = -0.1
delta_body_flap = -0.05
[derivatives.Cn]
beta = 0.07
p_hat = -0.04
r_hat = -0.12
delta_aileron = 0.01
"""
_BODY = """\
[[terms]]
name = "normal"
axis = "CZ"
expression = "-lift(alpha)*(1 - 2e-5*qbar) - 6*q_hat \
- 0.4*delta_elevator - 0.3*delta_flaperon - 0.5*delta_flap"
[[terms]]
name = "axial"
axis = "CX"
expression = "-0.03 + 0.2*lift(alpha)*alpha - 0.3*beta^2 \
- 0.02*delta_landing_gear - 0.04*delta_speed_brake"
[derivatives.CY]
beta = -0.5
r_hat = 0.3
delta_rudder = 0.15
"""
_WIND = """\
[[terms]]
name = "lift"
axis = "C_lift"
expression = "lift(alpha) + 6*q_hat + 0.4*delta_elevator + 0.3*delta_flaperon + 0.5*delta_flap"
[[terms]]
name = "drag"
axis = "C_drag"
expression = "0.03 + 0.05*lift(alpha)^2 + 0.02*delta_landing_gear + 0.04*delta_speed_brake"
[derivatives.C_side]
beta = -0.5
r_hat = 0.3
delta_rudder = 0.15
"""


def vehicle() -> Vehicle:
    return parse_vehicle(VEHICLE)


def database(wind: bool = False) -> AeroDatabase:
    """Forces along the body axes, or along the wind axes."""
    return read_native(HEADER_ONLY + _MOMENTS + (_WIND if wind else _BODY))


def _wave(
    rng: np.random.Generator, size: float, mean: float = 0.0, fast: float = 0.7
) -> Callable[[Array], Array]:
    frequency, phase = rng.uniform(0.1, fast, 5), rng.uniform(0, 2 * np.pi, 5)
    return lambda t: (
        mean
        + size
        * np.sin(2 * np.pi * np.multiply.outer(t, frequency) + phase).sum(axis=-1)
        / np.sqrt(2.5)
    )


def prescribed(seed: int) -> dict[str, Callable[[Array], Array]]:
    """Channel -> its values at times (n,): everything but rates."""
    rng = np.random.default_rng(seed)
    waves = {
        "alpha": _wave(rng, 0.045, 0.07),
        "beta": _wave(rng, 0.04),
        "V": _wave(rng, 4.0, 62.0, 0.2),
        "delta_elevator": _wave(rng, 0.03, -0.03),
        "delta_aileron_right": _wave(rng, 0.06, 0.01),
        "delta_aileron_left": _wave(rng, 0.06, -0.01),
        "delta_rudder": _wave(rng, 0.06),
        "delta_flap": _wave(rng, 0.1, 0.2, 0.2),
        "delta_speed_brake": _wave(rng, 0.15, 0.3, 0.2),
        "delta_body_flap": _wave(rng, 0.06, 0.05, 0.3),
        "delta_strake": _wave(rng, 0.03),
        "delta_landing_gear": lambda t: np.clip((t - 5.0) / 3.0, 0.0, 1.0),
        "thrust": _wave(rng, 400.0, 2000.0, 0.2),
        "height_above_ground": lambda t: 2.0 + 0.5 * np.abs(t - 9.0),
    }
    return waves


def _state(waves: Mapping[str, Callable[[Array], Array]], t: Array) -> dict[str, Array]:
    found = {name: wave(t) for name, wave in waves.items()}
    right, left = found["delta_aileron_right"], found["delta_aileron_left"]
    step = 1e-4
    return {
        **found,
        "delta_aileron": 0.5 * (right - left),
        "delta_flaperon": 0.5 * (right + left),
        "qbar": 0.5 * DENSITY * found["V"] ** 2,
        "mach": found["V"] / 335.0,
        "alphadot": (waves["alpha"](t + step) - waves["alpha"](t - step)) / (2 * step),
    }


def channel_names() -> tuple[str, ...]:
    """The channels of the flights below."""
    return (*_state(prescribed(0), np.zeros(1)), *"pqr", "ax", "ay", "az", "pdot", "qdot", "rdot")


def flown(seed: int, truth: AeroDatabase, of: Vehicle | None = None) -> Flight:
    """A flight at the CG of a vehicle whose aerodynamics are `truth`, with true specific force and
    angular acceleration."""
    return flown_together([seed], truth, of)[0]


class _Bodies:
    """Mass, inertia, CG and line of thrust of k vehicles, each (k, ...)."""

    def __init__(self, vehicles: Sequence[Vehicle]) -> None:
        masses = [each.mass for each in vehicles]
        self.mass = np.array([float(np.asarray(each.mass)) for each in masses])
        self.cg = np.array([np.asarray(each.cg, dtype=float) for each in masses])
        self.arm = np.array([each.thrust.point for each in vehicles]) - self.cg
        xx, yy, zz, xz = (
            np.array([float(np.asarray(getattr(each, f"I{a}"))) for each in masses])
            for a in ("xx", "yy", "zz", "xz")
        )
        none = np.zeros_like(xx)
        self.inertia = np.array([[xx, none, -xz], [none, yy, none], [-xz, none, zz]]).transpose(
            2, 0, 1
        )
        self.inverse = np.linalg.inv(self.inertia)

    def loads(
        self, truth: AeroDatabase, state: Mapping[str, Array], rates: Array
    ) -> tuple[Array, Array]:
        """Specific force and angular acceleration (n, 3) in a state with (n,) each, n = k, or any
        for one vehicle."""
        channels = {**state, **dict(zip("pqr", rates.T, strict=True))}
        about = truth.predict(channels).coefficients
        about = transfer_moments(about, truth.reference.moment_reference, self.cg, truth.reference)
        scale = state["qbar"] * AREA
        force = np.array([about[a] for a in ("CX", "CY", "CZ")]) * scale
        force[0] += state["thrust"]
        lengths = np.array([[SPAN], [CHORD], [SPAN]])
        moment = np.array([about[a] for a in ("Cl", "Cm", "Cn")]) * scale * lengths
        moment[1] += self.arm[:, 2] * state["thrust"]
        moment[2] -= self.arm[:, 1] * state["thrust"]
        momentum = (rates[:, None, :] @ self.inertia)[:, 0]
        turning = (moment - cross(rates.T, momentum.T)).T
        return force.T / self.mass[:, None], (turning[:, None, :] @ self.inverse)[:, 0]


def flown_together(
    seeds: Sequence[int],
    truth: AeroDatabase,
    of: Vehicle | Sequence[Vehicle] | None = None,
    prescribe: Callable[[int], dict[str, Callable[[Array], Array]]] = prescribed,
    seconds: float | None = None,
) -> list[Flight]:
    """A flight per seed, as `flown` gives it, integrated side by side: many cost little more than
    one. of : the vehicle, or one per seed; prescribe : seed -> what is prescribed; seconds :
    `SECONDS` if None."""
    of = of or vehicle()
    vehicles = [of] * len(seeds) if isinstance(of, Vehicle) else list(of)
    together = _Bodies(vehicles)
    t = np.arange(round((seconds or SECONDS) * RATE)) / RATE
    fine = np.arange(2 * len(t) - 1) / (2 * RATE)
    states = [_state(prescribe(seed), fine) for seed in seeds]
    columns = {name: np.column_stack([state[name] for state in states]) for name in states[0]}
    rates = np.zeros((len(t), len(seeds), 3))
    for k in range(len(t) - 1):  # Runge-Kutta of fourth order, deflections at half steps
        at = [
            {name: values[2 * k + half] for name, values in columns.items()} for half in (0, 1, 2)
        ]
        now, h = rates[k], 1.0 / RATE
        one = together.loads(truth, at[0], now)[1]
        two = together.loads(truth, at[1], now + h / 2 * one)[1]
        three = together.loads(truth, at[1], now + h / 2 * two)[1]
        four = together.loads(truth, at[2], now + h * three)[1]
        rates[k + 1] = now + h / 6 * (one + 2 * two + 2 * three + four)
    found = []
    for number, (seed, state, its) in enumerate(zip(seeds, states, vehicles, strict=True)):
        on_grid, own = {name: values[::2] for name, values in state.items()}, rates[:, number]
        force, speeding = _Bodies([its]).loads(truth, on_grid, own)
        channels = {
            **on_grid,
            **dict(zip("pqr", own.T, strict=True)),
            **dict(zip(("ax", "ay", "az"), force.T, strict=True)),
            **dict(zip(("pdot", "qdot", "rdot"), speeding.T, strict=True)),
        }
        found.append(Flight(f"taxi-{seed}", its.name, t, channels))
    return found


def logged(flight: Flight, of: Vehicle) -> Flight:
    """What a perfect log holds: specific force at the accelerometer, air data at the probe, no
    combined deflections."""
    channels = dict(flight.channels)
    rates = np.column_stack([channels[name] for name in "pqr"])
    speeding = np.column_stack([channels.pop(name) for name in ("pdot", "qdot", "rdot")])
    force = np.column_stack([channels.pop(name) for name in ("ax", "ay", "az")])
    cg = np.asarray(of.mass.cg, dtype=float)
    imu = np.broadcast_to(np.asarray(of.points.imu) - cg, rates.shape)
    moved = force + np.cross(speeding, imu) + np.cross(rates, np.cross(rates, imu))
    channels.update(zip(("ax_imu", "ay_imu", "az_imu"), moved.T, strict=True))
    speed, alpha, beta = (channels[name] for name in ("V", "alpha", "beta"))
    air = np.column_stack(
        [
            speed * np.cos(beta) * np.cos(alpha),
            speed * np.sin(beta),
            speed * np.cos(beta) * np.sin(alpha),
        ]
    )
    u, v, w = velocity_at_cg(
        air, rates, -(np.asarray(of.points.air_data) - cg)[None, :] + 0 * rates
    ).T
    total = np.sqrt(u * u + v * v + w * w)
    channels.update(V=total, alpha=np.arctan2(w, u), beta=np.arcsin(v / total))
    for name in ("alphadot", "delta_aileron", "delta_flaperon"):
        channels.pop(name)
    return Flight(flight.id, of.name, flight.time, channels)
