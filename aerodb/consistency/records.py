"""From a flight to the records that are reconstructed, and back: the consistent flight."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from aerodb.atmosphere import GRAVITY
from aerodb.coefficients import specific_force_at_cg
from aerodb.conditioning.differentiation import bridge, smooth
from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.parameters import OUTPUTS
from aerodb.consistency.reconstruction import Reconstruction
from aerodb.consistency.sensors import Array, Record
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import Vehicle, mass_channels

#: Inertial gaps up to this (s) are bridged; longer ones end a record.
SHORT_GAP = 0.2

#: Stretches shorter than this (s) say too little for their own first state.
SHORTEST = 5.0


def records_from_flight(
    flight: Flight, vehicle: Vehicle, *, seconds: float = 60.0, air_data: Literal["probe", "cg"] = "probe"
) -> tuple[Record, ...]:
    """Stretches of usable flight, each at most about `seconds` long, named ``<flight id>/<number>``.

    Inertial drift stays small over a minute, so every stretch has its own first state, while sensor errors and wind are
    shared. air_data : whether V, alpha, beta are those of the vehicle's air-data point or were moved to the CG already.
    Raises InputError when specific force, rates or attitude are not logged, or no stretch is long enough.
    """
    force_names = ("ax", "ay", "az") if all(f"a{axis}" in flight for axis in "xyz") else ("ax_imu", "ay_imu", "az_imu")
    absent = [name for name in (*force_names, "p", "q", "r", "phi", "theta") if name not in flight]
    if absent:
        raise InputError(f"{', '.join(absent)} not logged", f"flight {flight.id}", "kinematics need them all")
    stretches = _stretches(flight, (*force_names, "p", "q", "r"), seconds)
    if not stretches:
        raise InputError(f"no {SHORTEST:g} s without a gap", f"flight {flight.id}", "see its flags for what was lost")
    properties = mass_channels(flight, vehicle)
    cg = np.column_stack([properties[f"cg_{axis}"] for axis in "xyz"])
    inputs = np.column_stack([bridge(flight[name]) for name in (*force_names, "p", "q", "r")])
    if force_names[0] == "ax_imu" and vehicle.points.imu != "cg":
        band = min(5.0, 0.25 / flight.step)
        turning = np.column_stack([smooth(inputs[:, k], flight.step, band).rate for k in (3, 4, 5)])
        inputs[:, :3] = specific_force_at_cg(inputs[:, :3], inputs[:, 3:], turning, np.asarray(vehicle.points.imu) - cg)
    outputs = {name: np.where(flight.usable((name,)), flight[name], np.nan) for name in OUTPUTS if name in flight}
    density = flight.channels.get("rho")
    if density is None:
        outputs.pop("qbar", None)
    arm = np.zeros(3) if vehicle.points.air_data is None or air_data == "cg" else np.asarray(vehicle.points.air_data) - cg.mean(0)
    records = []
    for number, (start, stop) in enumerate(stretches):
        part = slice(start, stop)
        shown = {name: values[part] for name, values in outputs.items() if np.isfinite(values[part]).any()}
        air = None if density is None else bridge(density[part])
        point = (float(arm[0]), float(arm[1]), float(arm[2]))
        name = f"{flight.id}/{number}"
        records.append(
            Record(name, flight.step, inputs[part], shown, flight.id, point, density=air, gravity=GRAVITY, first=start)
        )
    return tuple(records)


def _stretches(flight: Flight, names: Sequence[str], seconds: float) -> list[tuple[int, int]]:
    """(start, stop) of stretches without a long gap, cut into equal windows of at most `seconds`."""
    good = flight.usable(names)
    edges = np.flatnonzero(np.diff(np.r_[False, good, False].astype(np.int8)))
    runs = [[int(a), int(b)] for a, b in edges.reshape(-1, 2)]
    merged: list[list[int]] = []
    for run in runs:
        if merged and (run[0] - merged[-1][1]) * flight.step <= SHORT_GAP:
            merged[-1][1] = run[1]
        else:
            merged.append(run)
    windows = []
    for start, stop in merged:
        if (stop - start) * flight.step >= SHORTEST:
            pieces = int(np.ceil((stop - start) * flight.step / seconds))
            cuts = np.linspace(start, stop, pieces + 1).round().astype(int)
            windows += list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))
    return windows


def consistent_flight(flight: Flight, result: Reconstruction) -> Flight:
    """The flight with V, alpha, beta, attitude, specific force and rates replaced by the reconstructed ones, all at the CG.

    Samples outside this flight's records (those of `records_from_flight`) keep their values and are flagged ``gap``. Angles
    that the log does not hold are reconstructed all the same: their standard errors, in the result's paths, say what they are
    worth.
    """
    names = ("V", "alpha", "beta", "phi", "theta", "psi", *INPUTS)
    empty = np.full(len(flight.time), np.nan)
    channels: dict[str, Array] = {name: np.array(flight.channels.get(name, empty)) for name in names}
    covered = np.zeros(len(flight.time), dtype=bool)
    for path in result.paths:
        if path.record.flight != flight.id:
            continue
        part = slice(path.record.first, path.record.first + len(path.record.inputs))
        covered[part] = True
        new = (path.V, path.alpha, path.beta, *path.states[3:6], *path.inputs.T)
        for name, values in zip(names, new, strict=True):
            channels[name][part] = values
    note = "V, alpha, beta, attitude, specific force and rates are those of the flight-path reconstruction"
    return replace(flight.with_channels(channels).with_flag("flight", "gap", ~covered), notes=(*flight.notes, note))
