"""Flights for the guide to a build-up: an aircraft of the Caravan's size, whose build-up is written
with the errors of "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand
Caravan Engineering Simulation", swept on all controls and measured with noise."""

from pathlib import Path

import numpy as np

from aerodb.exchange.native import read_native
from aerodb.nomenclature import AXES, channel
from aerodb.simulation import Condition, parse_manoeuvre, simulate, trim, with_feedback
from aerodb.simulation.flown_vehicle import flown_of
from aerodb.support import Array
from aerodb.tables import AeroDatabase, with_parameters
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.parts import SENSORS

#: What flies instead of what is written: 30 % less drag there, tails too steep, controls too weak, and a fuselage without
#: moments.
FLOWN = {
    "wing_slope": 5.0, "body_drag": 0.36, "tail_slope": 3.5, "elevator_part": 0.9, "fin_slope": 3.0,
    "rudder_part": 0.9, "body_Cm": 1.3, "body_Cn": -1.1,
}  # fmt: skip
#: Controls that each flight sweeps after each other, and the largest frequency [Hz].
FLIGHTS = (
    (("delta_elevator",), 2.0, 1.0),
    (("delta_elevator",), 1.5, 1.5),
    (("delta_aileron", "delta_rudder"), 2.5, 1.0),
    (("delta_aileron", "delta_rudder"), 2.0, 1.5),
    (("delta_elevator", "delta_rudder"), 2.0, 1.2),
    (("delta_elevator", "delta_aileron", "delta_rudder"), 1.5, 1.2),
)
SPEED, ALTITUDE, RATE, SWEEP = 64.3, 3048.0, 25, 40.0
#: Hands of the pilot on attitude, which keep the aircraft near its trim.
PILOT = {("delta_elevator", "theta"): -0.1, ("delta_aileron", "phi"): -0.1}
_SWEEP = """
[[input]]
target = "{target}"
shape = "sweep"
start = {start}
duration = {duration}
amplitude = "{amplitude} deg"
band = ["0.08 Hz", "{high} Hz"]
"""
_HEAD = """
duration = {duration}
[trim]
V = {V}
altitude = {altitude}
"""


def write_build_up_flights(folder: Path, vehicle_text: str, database_text: str) -> list[Path]:
    """Flies `FLIGHTS` and writes ``flight-1.csv`` and so on into `folder`; returns them. A flight-test
    data system adds the components u, v and w of the airspeed.

    Raises ValueError where the build-up lacks a parameter of `FLOWN`.
    """
    written = read_native(database_text)
    lacking = FLOWN.keys() - written.parameters.keys()
    if lacking:
        raise ValueError(f"the build-up has no {sorted(lacking)}")
    truth, vehicle = with_parameters(written, FLOWN), parse_vehicle(vehicle_text)
    return [
        write_table(folder / f"flight-{k + 1}.csv", _measured(truth, vehicle, k, *each))
        for k, each in enumerate(FLIGHTS)
    ]


def _measured(
    truth: AeroDatabase, vehicle: Vehicle, seed: int, targets: tuple[str, ...], size: float, high: float
) -> dict[str, Array]:  # fmt: skip
    """What instruments show of a flight, channel -> (n,)."""
    text = _HEAD.format(duration=SWEEP * len(targets) + 5.0, V=SPEED, altitude=ALTITUDE)
    for k, target in enumerate(targets):
        text += _SWEEP.format(
            target=target, start=2.0 + SWEEP * k, duration=SWEEP, amplitude=size, high=high
        )
    manoeuvre, frame = parse_manoeuvre(text), flown_of(vehicle, truth)
    level = trim(
        frame.model,
        Condition(SPEED, ALTITUDE),
        frame.masses,
        thrust="throttle",
        limits=frame.limits,
    )
    time = np.arange(round(manoeuvre.duration * RATE)) / RATE
    series = {name: np.full(len(time), value) for name, value in level.series.items()}
    for target, added in manoeuvre.series(time).items():
        series[target] = series[target] + added
    run = simulate(with_feedback(frame.model, PILOT), time, level.start, series)
    if run.ended[0] != len(time):
        raise ValueError(f"flight {seed + 1} ends at {time[run.ended[0]]} s")
    flown = {name: values[:, 0] for name, values in run.channels.items() if name not in AXES}
    random = np.random.default_rng([36, seed])
    shown = {
        name: flown[name] + noise * random.standard_normal(len(time))
        for name, noise in SENSORS.items()
    }
    alpha, beta, speed = shown["alpha"], shown["beta"], shown["V"]
    return {
        "time": time,
        **shown,
        "u": speed * np.cos(alpha) * np.cos(beta),
        "v": speed * np.sin(beta),
        "w": speed * np.sin(alpha) * np.cos(beta),
    }


def write_table(path: Path, table: dict[str, Array]) -> Path:
    units = dict.fromkeys("uvw", "m/s") | {"throttle": "-"}
    header = ",".join(f"{name} [{units.get(name) or channel(name).unit}]" for name in table)
    np.savetxt(path, np.column_stack(list(table.values())), "%.8g", ",", header=header, comments="")
    return path
