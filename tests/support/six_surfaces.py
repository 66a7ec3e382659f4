"""The WVU YF-22 with six separate surfaces, and flights of it in memory with the noise of its sensors.

Coefficients are the linear model's of "Parameter Identification for Application within a
Fault-Tolerant Flight Control System" (eqs. 1 and 2), converted by its eqs. 23 to 39. The printed
nonlinear ones contradict them. Left and right halves follow eqs. 43 to 46: a pair shares the
effect of the pair, and each surface has a part that the pair cancels (eqs. 71 to 77). The signs of
eq. 46 are lost in print; those of the rudders, and drag of the ailerons, are nowhere: they are zero.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.coefficients import total_coefficients
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.identification.conversion import coefficient_derivatives, exact, matrix_derivatives
from aerodb.physics import GRAVITY
from aerodb.simulation import flight_model, simulate
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.aerodb.identification.test_conversion import (
    AILERON_RUDDER,
    ELEVATOR,
    LATERAL,
    LONGITUDINAL,
    YF22,
)
from tests.support.flights_in_memory import FlightsInMemory

SPEED, ALTITUDE, SECONDS, RATE = 42.0, 120.0, 10.0, 50.0
#: Steps of the simulation for a sample of the log: between two, surfaces do not move on straight
#: lines. Such lines would take .4 % of every moment that is a derivative of logged rates.
FINER = 8
SURFACES = (
    "stabilator_left", "stabilator_right", "aileron_left", "aileron_right", "rudder_left",
    "rudder_right",
)  # fmt: skip
DEGREE = np.pi / 180.0
#: Standard deviations, a third of the printed three sigma: m/s2 and rad(/s). V by the dynamic
#: pressure's .0015 psi.
NOISE = {
    "ax": 0.02 * GRAVITY, "ay": 0.02 * GRAVITY, "az": 0.02 * GRAVITY, "p": DEGREE / 3.0,
    "q": DEGREE / 3.0, "r": DEGREE / 3.0, "alpha": 0.05 * DEGREE, "beta": 0.05 * DEGREE,
    "phi": 0.35 * DEGREE / 3.0, "theta": 0.35 * DEGREE / 3.0, "V": 0.07,
    "delta_stabilator": 0.2 * DEGREE, "delta_aileron": 0.1 * DEGREE, "delta_rudder": 0.05 * DEGREE,
}  # fmt: skip
#: Largest deflections of the printed ranges [rad]; of a leg about three quarters.
LARGEST = {"stabilator": 4.5 * DEGREE, "aileron": 10.0 * DEGREE, "rudder": 7.0 * DEGREE}
_SIDES = "".join(
    f'[surfaces.{name}]\nlimits = ["-12 deg", "12 deg"]\n'
    f'log = {{ topic = "table", field = "delta_{name}" }}\n'
    f"[sensors.delta_{name}]\nnoise = {NOISE['delta_' + name.split('_')[0]]!r}\n"
    for name in SURFACES
)
VEHICLE = f"""\
name = "yf22"
[reference]
area = {YF22.area}
chord = {YF22.chord}
span = {YF22.span}
[points]
moment_reference = [0.0, 0.0, 0.0]
imu = "cg"
[mass]
source = "constant"
mass = {YF22.mass}
cg = [0.0, 0.0, 0.0]
Ixx = {YF22.Ixx}
Iyy = {YF22.Iyy}
Izz = {YF22.Izz}
Ixz = {YF22.Ixz}
{_SIDES}[combinations.elevator]
kind = "symmetric"
right = "stabilator_right"
left = "stabilator_left"
[combinations.stabilator_roll]
kind = "asymmetric"
right = "stabilator_right"
left = "stabilator_left"
[combinations.aileron]
kind = "asymmetric"
right = "aileron_right"
left = "aileron_left"
[combinations.rudder]
kind = "symmetric"
right = "rudder_right"
left = "rudder_left"
[thrust]
source = "channel"
point = [0.0, 0.0, 0.0]
[processing]
bandwidth = "8 Hz"
"""


def nominal() -> dict[str, dict[str, float]]:
    """Axis -> variable -> coefficient of the linear model, pairs as pairs; constants of the trim."""
    plane = coefficient_derivatives(
        exact(
            matrix_derivatives(
                LONGITUDINAL, ELEVATOR, ("V", "alpha", "q", "theta"), ("delta_elevator",), YF22
            )
        ),
        YF22,
        forces="wind",
    )
    side = coefficient_derivatives(
        exact(
            matrix_derivatives(
                LATERAL, AILERON_RUDDER, ("beta", "p", "r", "phi"),
                ("delta_aileron", "delta_rudder"), YF22,
            )
        ),
        YF22,
    )  # fmt: skip
    found: dict[str, dict[str, float]] = {}
    for derivatives in (plane, side):
        for name, value in zip(derivatives.names, derivatives.values, strict=True):
            axis = next(a for a in ("C_lift", "C_drag", "Cm", "CY", "Cl", "Cn") if name.startswith(f"{a}_"))  # fmt: skip
            variable = name.removeprefix(f"{axis}_")
            if variable != "V":
                found.setdefault(axis, {})[variable] = float(value)
    found["C_lift"]["1"] = YF22.mass * GRAVITY / YF22.force
    found["C_drag"]["1"] = YF22.thrust / YF22.force
    return found


def added() -> dict[str, dict[str, float]]:
    """Axis -> surface -> the part that the pair cancels: the 18 new terms."""
    lift = YF22.mass * YF22.V * 1.21 / YF22.force
    pitch = -YF22.Iyy * 12.5 / (YF22.force * YF22.chord)
    side = YF22.mass * YF22.V * 1.09 / YF22.force
    roll, yaw = (
        np.linalg.inv(
            np.array([[YF22.Izz, YF22.Ixz], [YF22.Ixz, YF22.Ixx]])
            / (YF22.Ixx * YF22.Izz - YF22.Ixz**2)
        )
        @ [30.3, 10.05]
        / (YF22.force * YF22.span)
    )
    ailerons = ("aileron_left", "aileron_right")
    rudders = ("rudder_left", "rudder_right")
    found: dict[str, dict[str, float]] = {
        "C_drag": dict.fromkeys((*ailerons, *rudders), 0.0),
        "C_lift": dict.fromkeys(ailerons, lift) | dict.fromkeys(rudders, 0.0),
        "Cm": dict.fromkeys(ailerons, pitch) | dict.fromkeys(rudders, 0.0),
    }
    for axis, value in (("CY", side), ("Cl", float(roll)), ("Cn", float(yaw))):
        found[axis] = {"stabilator_left": value, "stabilator_right": -value}
    return found


def halves(nominal_terms: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Axis -> term: pairs as two surfaces. The stabilator and the rudder are means of both, the
    aileron is half of right less left."""
    sides = {
        "delta_elevator": {"stabilator_left": 0.5, "stabilator_right": 0.5},
        "delta_aileron": {"aileron_left": -0.5, "aileron_right": 0.5},
        "delta_rudder": {"rudder_left": 0.5, "rudder_right": 0.5},
    }
    found: dict[str, dict[str, float]] = {}
    for axis, terms in nominal_terms.items():
        for variable, value in terms.items():
            for name, share in sides.get(variable, {variable: 1.0}).items():
                key = f"delta_{name}" if variable in sides else name
                found.setdefault(axis, {})[key] = share * value
    return found


def database(new: bool = True) -> AeroDatabase:
    """The database in six surfaces; `new`: with the terms of `added`."""
    return read_native(text(new))


def text(new: bool = True) -> str:
    """The file of `database`."""
    terms = halves(nominal())
    if new:
        for axis, own in added().items():
            for name, value in own.items():
                terms[axis][f"delta_{name}"] = terms[axis].get(f"delta_{name}", 0.0) + value
    lines = [
        'name = "yf22"', "[reference]", f"area = {YF22.area}", f"chord = {YF22.chord}",
        f"span = {YF22.span}", "moment_reference = [0.0, 0.0, 0.0]",
    ]  # fmt: skip
    for axis, own in terms.items():
        lines.append(f"[derivatives.{axis}]")
        lines += [f'"{name}" = {value!r}' for name, value in own.items()]
    return "\n".join(lines) + "\n"


def vehicle() -> Vehicle:
    return parse_vehicle(VEHICLE)


def commands(seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times and the commanded deflections of a leg: two series of steps of each surface, those of a
    pair at different times."""
    time, moved = _flown_commands(seed)
    return time[::FINER], {name: values[::FINER] for name, values in moved.items()}


def _flown_commands(seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """As `commands`, at the steps of the simulation."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE) * FINER) / (RATE * FINER)
    moved = {}
    for name in SURFACES:
        size = LARGEST[name.split("_")[0]] * rng.uniform(0.5, 0.8)
        values = np.zeros(len(time))
        for _ in range(2):
            at, width = rng.uniform(0.3, SECONDS - 3.0), rng.uniform(0.15, 0.4)
            for number, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
                values += sign * size * ((time >= at + number * width) & (time < at + (number + 1) * width))  # fmt: skip
        # A servo's lag of .05 s.
        moved[f"delta_{name}"] = _lagged(np.clip(values, -size, size), 0.05)
    return time, moved


def _lagged(values: np.ndarray, lag: float) -> np.ndarray:
    found, share = np.zeros(len(values)), 1.0 - np.exp(-1.0 / (RATE * FINER * lag))
    for k in range(1, len(values)):
        found[k] = found[k - 1] + share * (values[k] - found[k - 1])
    return found


def _half(pair: str, sign: float) -> Callable[[Mapping[str, np.ndarray]], np.ndarray]:
    return lambda c: 0.5 * (c[f"delta_{pair}_right"] + sign * c[f"delta_{pair}_left"])


#: Combined deflection -> what it is of those of its two surfaces.
_HALVES = {
    "delta_elevator": _half("stabilator", 1.0),
    "delta_stabilator_roll": _half("stabilator", -1.0),
    "delta_aileron": _half("aileron", -1.0),
    "delta_rudder": _half("rudder", 1.0),
}


def leg(
    seed: int, truth: AeroDatabase, locked: Mapping[str, float] | None = None, noise: float = 1.0
) -> Flight:
    """One leg as it is logged. locked : surface -> where it stands in truth [rad], while the log
    shows what was commanded."""
    time, moved = commands(seed)
    fine, flown = _flown_commands(seed)
    flown |= {f"delta_{name}": np.full(len(fine), at) for name, at in (locked or {}).items()}
    body = {name: getattr(YF22, name) for name in ("mass", "Ixx", "Iyy", "Izz", "Ixz")}
    series = {**body, **flown, "force_x": YF22.thrust}
    start = {"V": SPEED, "alpha": 0.0, "theta": 0.0, "altitude": ALTITUDE}
    run = simulate(flight_model(truth), fine, start, series)
    was = {name: values[::FINER, 0] for name, values in run.channels.items()}
    rng = np.random.default_rng(10_000 + seed)
    n = len(time)
    channels = {
        name: was[name] + noise * NOISE[name] * rng.standard_normal(n)
        for name in ("V", "alpha", "beta", "p", "q", "r", "phi", "theta", "ax", "ay", "az")
    }
    for name, values in moved.items():
        sigma = NOISE[name.rsplit("_", 1)[0]]
        channels[name] = values + noise * sigma * rng.standard_normal(n)
    channels |= {name: half(channels) for name, half in _HALVES.items()}
    density = was["qbar"] / (0.5 * was["V"] ** 2)
    channels["qbar"] = 0.5 * density * channels["V"] ** 2
    channels["rho"] = density
    channels["mach"] = was["mach"]
    channels["altitude"] = was["altitude"]
    channels["thrust"] = np.full(n, YF22.thrust)
    return Flight(f"leg-{seed}", "yf22", time, channels)


def legs(
    seeds: Sequence[int], truth: AeroDatabase, locked: Mapping[str, float] | None = None
) -> FlightsInMemory:
    """Legs with their coefficients, by id."""
    own, flown = vehicle(), {}
    for seed in seeds:
        flight = leg(seed, truth, locked)
        flown[flight.id] = (flight, total_coefficients(flight, own))
    return FlightsInMemory(own, flown)


def without(database: AeroDatabase, axes: Sequence[str]) -> AeroDatabase:
    """The database without the terms of some axes."""
    return replace(database, terms=tuple(t for t in database.terms if t.axis not in axes))


def exact_deflections(seed: int) -> dict[str, np.ndarray]:
    """The deflections of a leg without the noise of their potentiometers, those of pairs too."""
    moved = commands(seed)[1]
    return moved | {name: half(moved) for name, half in _HALVES.items()}
