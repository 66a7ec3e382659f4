"""A light aircraft made of 40 strips, fuselage and propeller, as its file is written."""

from dataclasses import replace
from functools import cache

import numpy as np

from aerodb.coefficients import total_coefficients
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.simulation import Condition, flight_model, simulate, trim, with_feedback
from aerodb.support import Array
from aerodb.tables import AeroDatabase, with_parameters
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.flights_in_memory import FlightsInMemory
from tests.support.tracing_flights import FLOOR, coloured

RATE, SECONDS = 50.0, 40.0
#: Steps of the engine between two samples of a log: deflections are linear within a step, and the motion
#: that a log holds is that of smooth ones (at 50 Hz straight lines have 0.1 % less effect than their samples say).
STEPS = 4
#: Deflection -> size of its test input [deg].
SIZES = {"delta_elevator": 2.0, "delta_aileron": 3.0, "delta_rudder": 4.0}


HEAD = """\
name = "light aircraft of parts"
[reference]
area = 16.0
chord = 1.5
span = 11.0
moment_reference = [-2.0, 0.0, 0.0]
"""

TEXT = (
    HEAD
    + """\
[parameters]
wing_slope = { value = 5.0, unit = "1/rad", bounds = [3.0, 7.0], description = "lift slope of the wing's strips" }
wing_zero = { value = 0.28, bounds = [-0.2, 0.8], description = "lift of the wing's strips at no angle of attack" }
wing_drag = { value = 0.011, bounds = [0.004, 0.04], description = "least drag of the wing's strips" }
tail_slope = { value = 3.8, unit = "1/rad", bounds = [1.0, 7.0], description = "lift slope of the tail" }
tail_downwash = { value = 0.38, bounds = [0.0, 0.8], description = "downwash at the tail by alpha" }
fin_slope = { value = 3.0, unit = "1/rad", bounds = [0.5, 6.0], description = "lift slope of the fin" }
elevator_part = { value = 0.8, bounds = [0.2, 1.2], description = "efficiency of the elevator" }
aileron_part = { value = 0.7, bounds = [0.2, 1.2], description = "efficiency of the ailerons" }
rudder_part = { value = 0.75, bounds = [0.2, 1.2], description = "efficiency of the rudder" }
body_drag = { value = 0.16, bounds = [0.02, 0.6], description = "drag of the fuselage over its cross section" }

[tables.THRUST]                      # N, over airspeed and throttle
arguments = ["V", "throttle"]
breakpoints = [[0.0, 20.0, 40.0, 60.0, 80.0], [0.0, 0.5, 1.0]]
values = [
    [0.0, 1400.0, 2600.0], [-60.0, 1150.0, 2250.0], [-160.0, 800.0, 1850.0],
    [-300.0, 380.0, 1350.0], [-480.0, -100.0, 800.0],
]

[parts.propeller]
kind = "engine"
position = [0.0, 0.0, 0.1]
thrust = "THRUST(V, throttle)"
diameter = 1.9

[parts.wing]
kind = "surface"
mirror = true
root = [-1.95, 0.3, -0.7]
tip = [-1.95, 5.5, -0.85]
root_chord = 1.55
tip_chord = 1.35
incidence = "1 deg"
twist = "-2 deg"
strips = 14
lift = "wing_slope*alpha + wing_zero"
drag = "wing_drag + 0.045*lift^2"
moment = "-0.04"
[parts.wing.control.delta_aileron]
chord_ratio = 0.22
efficiency = "side*aileron_part"     # right and left move against each other, (R - L)/2
span = [0.6, 0.95]

[parts.tail]
kind = "surface"
mirror = true
root = [-6.6, 0.0, -0.4]
tip = [-6.7, 1.7, -0.4]
root_chord = 1.0
tip_chord = 0.8
incidence = "-1 deg"
strips = 4
lift = "tail_slope*alpha"
drag = "0.01 + 0.08*lift^2"
downwash = "0.02 + tail_downwash*alpha"
slipstream = "propeller"
control = { delta_elevator = { chord_ratio = 0.35, efficiency = "elevator_part" } }

[parts.fin]
kind = "surface"
root = [-6.5, 0.0, -0.5]
tip = [-6.9, 0.0, -2.0]
root_chord = 1.3
tip_chord = 0.8
strips = 4
lift = "fin_slope*alpha"
drag = "0.01 + 0.1*lift^2"
control = { delta_rudder = { chord_ratio = 0.3, efficiency = "-rudder_part" } }   # positive to the left

[parts.fuselage]
kind = "fuselage"
position = [-2.4, 0.0, 0.1]
area = 1.5
drag = "body_drag"
sideforce = "-0.35*beta"
volume = 4.5
inertia_factor = 0.85
"""
)

MASSES = {"mass": 1100.0, "cg_x": -2.0, "Ixx": 1300.0, "Iyy": 1800.0, "Izz": 2700.0, "Ixz": 90.0}


def aircraft(values: dict[str, float] | None = None) -> AeroDatabase:
    """The aircraft, with other values of some parameters."""
    return with_parameters(_read(), values or {})


@cache
def _read() -> AeroDatabase:
    return read_native(TEXT)


VEHICLE = """\
name = "light-aircraft"
[reference]
area = 16.0
chord = 1.5
span = 11.0
[points]
moment_reference = [-2.0, 0.0, 0.0]
imu = [-2.0, 0.0, 0.0]
air_data = [-2.0, 0.0, 0.0]
[mass]
source = "constant"
mass = 1100.0
cg = [-2.0, 0.0, 0.0]
Ixx = 1300.0
Iyy = 1800.0
Izz = 2700.0
Ixz = 90.0
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
[surfaces.aileron]
limits = ["-20 deg", "20 deg"]
[surfaces.rudder]
limits = ["-25 deg", "25 deg"]
"""


def vehicle() -> Vehicle:
    return parse_vehicle(VEHICLE)


def flown(seed: int, truth: AeroDatabase, steps: int = 1) -> tuple[Array, dict[str, Array]]:
    """Time and channels (n,) of a flight by the engine, from the trim under test inputs on all
    controls; `steps` of the engine between two samples."""
    model = flight_model(truth)
    time = np.arange(round(SECONDS * RATE) * steps) / (RATE * steps)
    rng = np.random.default_rng(seed)
    speed, height = rng.uniform(45.0, 62.0), rng.uniform(500.0, 1500.0)
    level = trim(
        model, Condition(speed, height), MASSES, thrust="throttle",
        limits={"throttle": (0.0, 1.0)},
    )  # fmt: skip
    series = {name: np.full(len(time), value) for name, value in level.series.items()}
    for name, size in SIZES.items():
        series[name] = series[name] + wave(rng, time, np.deg2rad(size))
    series["throttle"] = np.clip(series["throttle"] + 0.2 * np.sin(0.4 * time), 0.0, 1.0)
    gains = {("delta_elevator", "theta"): -0.2, ("delta_aileron", "phi"): -0.3}
    run = simulate(with_feedback(model, gains), time, level.start, series)
    assert run.ended[0] == len(time)
    return time[::steps], {n: x[::steps, 0] for n, x in run.channels.items() if n not in AXES}


def flights(seeds: range, truth: AeroDatabase, noise: float = 1.0) -> FlightsInMemory:
    """Flights of `flown`, one per seed; coloured and white noise on their coefficients, `noise`
    times as large as usual."""
    of, found = vehicle(), {}
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        time, channels = flown(seed, truth)
        flight = Flight(f"parts-{seed}", of.name, time, channels)
        made = total_coefficients(flight, of, angular_acceleration="logged")
        n = len(time)
        noisy = {
            axis: values
            + noise * FLOOR[axis] * (coloured(rng, n, step=flight.step) + rng.standard_normal(n))
            for axis, values in made.values.items()
        }
        found[flight.id] = (flight, replace(made, values=noisy))
    return FlightsInMemory(of, found)


def wave(rng: np.random.Generator, time: Array, size: float) -> Array:
    """A multisine of 0.1 to 1.5 Hz with random phases; `size` is its largest share [rad]."""
    frequencies = np.linspace(0.1, 1.5, 12) + rng.uniform(0.0, 0.05, 12)
    phases = rng.uniform(0.0, 2.0 * np.pi, 12)
    waves = np.sin(2.0 * np.pi * np.outer(time, frequencies) + phases)
    return np.asarray(size * waves.sum(axis=1) / np.sqrt(12.0))


#: Logged channel -> white noise (SI): boom, inertial unit and potentiometers of a flight test.
SENSORS = {
    "V": 0.1, "qbar": 5.0, "rho": 0.0, "alpha": 1e-3, "beta": 1e-3, "altitude": 0.5,
    **dict.fromkeys("pqr", 5e-4), **dict.fromkeys(("phi", "theta", "psi"), 1e-3),
    **dict.fromkeys(("ax", "ay", "az"), 0.02),
    **dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), 5e-4), "throttle": 0.0,
}  # fmt: skip


def log(seed: int, truth: AeroDatabase) -> dict[str, Array]:
    """What instruments log of a flight of `flown`."""
    rng = np.random.default_rng([seed, 2])
    time, channels = flown(seed, truth, STEPS)
    noise = {name: size * rng.standard_normal(len(time)) for name, size in SENSORS.items()}
    return {"time": time, **{name: channels[name] + noise[name] for name in SENSORS}}
