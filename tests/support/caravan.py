"""A bin of manoeuvres like that of "Aerodynamic Model Update Using Parameter Identification
Supporting a Cessna Grand Caravan Engineering Simulation": four elevator sweeps and three stalls of an
aircraft of the C208B's size, flown by the engine and measured with noise."""

from dataclasses import dataclass

import numpy as np

from aerodb.estimation import EquationRecord, LinearEquation, Parameter, Parameters
from aerodb.simulation import flight_model, parse_manoeuvre, simulate, trim
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry, Table, Term, parse
from tests.support.equations import coloured

AREA, CHORD, SPAN = 25.96, 1.98, 15.87
MASS = {"mass": 3600.0, "Ixx": 15000.0, "Iyy": 22000.0, "Izz": 33000.0, "Ixz": 1500.0}
ALPHA = np.deg2rad([-10.0, -2.0, 1.0, 5.0, 9.0, 11.0, 13.0, 16.0, 20.0, 30.0])
LIFT = np.array([-0.7, 0.10, 0.38, 0.76, 1.12, 1.26, 1.34, 1.22, 1.00, 0.90])
PITCH_RATE, ELEVATOR = 7.5, 0.42
STEP = 0.02
SPEED = 64.3  # m/s, 125 kt
KNOTS = np.deg2rad([1.0, 5.0, 9.0, 11.0, 13.0, 16.0])


@dataclass(frozen=True)
class Flown:
    """Measured alpha, pitch rate (non-dimensional), elevator and lift coefficient, (n,) each."""

    name: str
    alpha: Array
    q_hat: Array
    elevator: Array
    lift: Array


def database() -> AeroDatabase:
    return AeroDatabase(
        name="caravan-like",
        reference=ReferenceGeometry(AREA, CHORD, SPAN, (0.0, 0.0, 0.0)),
        tables={"CLA": Table("CLA", ("alpha",), (ALPHA,), LIFT)},
        terms=(
            Term(
                "lift",
                "C_lift",
                parse(f"CLA(alpha) + {PITCH_RATE}*q_hat + {ELEVATOR}*delta_elevator"),
            ),
            Term("drag", "C_drag", parse("0.035 + 0.06*CLA(alpha)*CLA(alpha)")),
            Term("side", "C_side", parse("-0.6*beta")),
            Term("pitch", "Cm", parse("0.06 - 1.3*alpha - 22*q_hat - 1.5*delta_elevator")),
            Term("roll", "Cl", parse("-0.08*beta - 0.5*p_hat + 0.1*r_hat")),
            Term("yaw", "Cn", parse("0.07*beta - 0.03*p_hat - 0.1*r_hat")),
        ),
    )


SWEEP = """
duration = 60
[trim]
V = "64.3 m/s"
altitude = "10000 ft"
[[input]]
target = "delta_elevator"
shape = "sweep"
start = 2
duration = 55
amplitude = "{amplitude} deg"
band = ["0.1 Hz", "{high} Hz"]
"""
STALL = """
duration = 40
[trim]
V = "{speed} m/s"
altitude = "10000 ft"
"""


def caravan_bin(seed: int) -> list[Flown]:
    """The seven manoeuvres."""
    rng = np.random.default_rng(seed)
    sweeps = [
        _flown(f"sweep {k}", SWEEP.format(amplitude=a, high=h), rng)
        for k, (a, h) in enumerate(((1.5, 1.5), (2.0, 2.0), (3.5, 1.0), (1.8, 2.5)))
    ]
    stalls = [
        _flown(f"stall {k}", STALL.format(speed=v), rng, r)
        for k, (v, r) in enumerate(((56.0, 0.5), (58.0, 0.6), (54.0, 0.45)))
    ]
    return sweeps + stalls


def _flown(name: str, text: str, rng: np.random.Generator, pull: float = 0.0) -> Flown:
    manoeuvre = parse_manoeuvre(text)
    model = flight_model(database())
    found = trim(model, manoeuvre.condition, MASS)
    time = np.arange(round(manoeuvre.duration / STEP)) * STEP
    series = dict(found.series)
    for target, added in manoeuvre.series(time).items():
        series[target] = series[target] + added
    if pull:  # elevator drawn up slowly, and let go at the break
        ramp = -np.deg2rad(pull) * np.clip(time - 2.0, 0.0, None)
        stalled = {**series, "delta_elevator": series["delta_elevator"] + ramp}
        alone = simulate(model, time, found.start, stalled, parts=2)
        over = int(np.argmax(alone.channels["alpha"][:, 0] > np.deg2rad(15.3)))
        ramp[over:] = ramp[over] * np.clip(1.0 - 2.0 * (time[over:] - time[over]), -0.2, 1.0)
        series["delta_elevator"] = series["delta_elevator"] + ramp
        time = time[: over + 150]
        series = {k: v[: len(time)] if np.ndim(v) else v for k, v in series.items()}
    run = simulate(model, time, found.start, series, parts=2)
    channels = {key: np.asarray(value)[:, 0] for key, value in run.channels.items()}
    n = len(time)
    alpha, V = channels["alpha"], channels["V"]
    elevator = np.broadcast_to(np.squeeze(series["delta_elevator"]), (n,))
    lift = (
        np.interp(alpha, ALPHA, LIFT)
        + PITCH_RATE * channels["q"] * CHORD / (2 * V)
        + ELEVATOR * elevator
    )
    # Buffet and turbulence in the lift, noise of the vane and the gyro.
    return Flown(
        name,
        alpha + np.deg2rad(0.05) * rng.standard_normal(n),
        (channels["q"] + np.deg2rad(0.1) * rng.standard_normal(n)) * CHORD / (2 * V),
        elevator,
        lift + 0.012 * coloured(rng, n, 0.9),
    )


def bin_equation(flown: list[Flown], bases: list[Array], names: list[str]) -> LinearEquation:
    """Lift of eq. 41: spline columns, and pitch rate and elevator fixed at their known values."""
    return LinearEquation(
        "C_lift",
        Parameters(
            (
                *(Parameter(name, 0.0) for name in names),
                Parameter("q_hat", PITCH_RATE, free=False),
                Parameter("delta_elevator", ELEVATOR, free=False),
            )
        ),
        tuple(
            EquationRecord(
                each.name,
                STEP * np.arange(len(each.lift)),
                np.column_stack([basis, each.q_hat, each.elevator]),
                each.lift,
            )
            for each, basis in zip(flown, bases, strict=True)
        ),
    )
