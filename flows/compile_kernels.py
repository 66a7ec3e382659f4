"""Compile the numerical kernels: ``python -m aerodb.flows.compile_kernels``, a step of ``make
install``.

Numba compiles a kernel at its first call and keeps the code beside the source file. For reading
logs, flight-path reconstruction, tables, simulation and filters that takes about 40 s of processor
time, which every process would spend that starts before the code is there. The same holds for
Prefect's empty database, which a new workspace gets as a copy.
"""

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from aerodb.consistency import make_consistent
from aerodb.estimation import Parameter, Parameters, TimeHistory, filter_error, state_space
from aerodb.examples.phoenix import read_example
from aerodb.exchange import read_native
from aerodb.flight import Flight
from aerodb.flows.prefect_server import make_template
from aerodb.identification import flight_dynamics
from aerodb.signals import played
from aerodb.simulation import FlightStretch, flight_model, simulate
from aerodb.storage.readers import prepare_reader
from aerodb.tracing import prepare_elimination
from aerodb.vehicle import parse_vehicle

#: Duration of the flight [s]: enough for a reconstruction, and no more.
_DURATION = 12.0
#: Time step of the flight [s]: that of common logs.
_STEP = 0.05


def compile_kernels() -> None:
    """Use the kernels in processes of their own, one for each core, so that later processes find
    the compiled code."""
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as processes:
        for begun in [processes.submit(each) for each in (_reconstructed, _simulated)]:
            begun.result()


def _reconstructed() -> None:
    """Read logs, and reconstruct a short flight of the built-in example."""
    for suffix in (".ulg", ".bin"):
        prepare_reader(suffix)
    prepare_elimination()
    played(np.zeros(2), 1.0)
    vehicle = parse_vehicle(read_example("vehicle.toml"))
    make_consistent(_flight(vehicle.name), vehicle)


def _simulated() -> None:
    """Predict, simulate and filter a short flight of the built-in example."""
    flight = _flight("any")
    database = read_native(read_example("preflight.toml"))
    database.predict({name: np.zeros(len(flight.time)) for name in database.inputs})
    model = flight_model(database)
    body = {"mass": 100.0, "Ixx": 100.0, "Iyy": 200.0, "Izz": 300.0}
    still = dict.fromkeys(model.inputs, 0.0)
    time, start, series = flight.time[:20], {"V": 60.0, "altitude": 1000.0}, {**body, **still}
    run = simulate(model, time, start, series)
    flown = {name: run.channels[name][:, 0] + 1e-3 * np.sin(99.0 * time) for name in ("V", "q")}
    held = {name: np.full(len(time), value) for name, value in series.items()}
    stretch = FlightStretch(time, start, held, flown, (), {})
    dynamics, records = flight_dynamics(
        model, {"any": stretch}, (), outputs=("V", "q"), initial=("V",)
    )
    filter_error(dynamics, records, process_noise=("q",), most_iterations=2)
    rate = Parameters((Parameter("rate", -1.0),))
    linear = state_space(["x"], ["u"], ["x"], rate, a=[["rate"]], b=[[1.0]], c=[[1.0]])
    record = TimeHistory("any", flight.time, {"u": flight.time}, {"x": flight.time})
    linear.derivatives(rate.values(rate.start()), record, rate.names)
    filter_error(linear, [record], most_iterations=2)


def _flight(vehicle: str) -> Flight:
    """Level flight at 60 m/s with a small oscillation in pitch, and noise."""
    time = np.arange(0.0, _DURATION, _STEP)
    rng, n = np.random.default_rng(0), len(time)
    pitch = 0.05 + 0.01 * np.sin(time)
    names = ("ax", "ay", "p", "r", "beta", "phi", "psi", "velocity_east", "velocity_down")
    level = dict.fromkeys(names, np.zeros(n)) | {
        "az": np.full(n, -9.81),
        "q": 0.01 * np.cos(time),
        "V": np.full(n, 60.0),
        "alpha": pitch,
        "theta": pitch,
        "velocity_north": np.full(n, 60.0),
        "altitude": np.full(n, 1000.0),
    }
    channels = {name: values + 1e-3 * rng.standard_normal(n) for name, values in level.items()}
    channels["rho"] = np.full(n, 1.1)
    channels["qbar"] = 0.5 * channels["rho"] * channels["V"] ** 2
    return Flight("0" * 64, vehicle, time, channels)


if __name__ == "__main__":
    compile_kernels()
    make_template()
