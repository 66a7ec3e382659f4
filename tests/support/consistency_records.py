"""Measured records as the reconstruction takes them: ATTAS, F/A-18 HARV and HFB-320 in SI, at the
CG."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from aerodb.consistency.sensors import FlightRecord
from aerodb.physics import specific_force_at_cg
from aerodb.vehicle import parse_vehicle

FOOT = 0.3048
SENSOR = np.array([-1.010, 0.886, 0.103])  # accelerometers of ATTAS from the CG, m
BOOM = (13.080, -0.010, -0.027)
TWIN_OTTER = parse_vehicle(
    (Path(__file__).parent / "vehicles" / "twin_otter.toml").read_text(encoding="utf-8")
)
ATTAS_BIASES = ("ax_bias", "ay_bias", "az_bias", "p_bias", "q_bias", "r_bias")


def attas(
    path: Path, airspeed_at: str = "boom", rate_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> FlightRecord:
    """One ATTAS manoeuvre: alpha, beta at the boom, attitude, pressure altitude (columns as in the
    data's SOURCE.md). Inputs are linear between samples, as the published analysis takes them.

    airspeed_at : where the airspeed column is taken to be, "boom" or "cg". rate_bias : removed from
    the rates that move the accelerometers to the CG.
    """
    data = (
        np.loadtxt(path)
        if path.suffix == ".asc"
        else next(v for k, v in loadmat(path).items() if not k.startswith("_"))
    )
    rates = np.deg2rad(data[:, 6:9])
    turning, arm = np.deg2rad(data[:, 16:19]), np.broadcast_to(SENSOR, rates.shape)
    force = specific_force_at_cg(data[:, 1:4], rates - rate_bias, turning, arm)
    angles = {
        name: np.deg2rad(data[:, column])
        for column, name in enumerate(("phi", "theta", "psi", "alpha", "beta"), start=9)
    }
    speed = (
        data[:, 14] if airspeed_at == "boom" else _at_boom(data[:, 14], angles, rates - rate_bias)
    )
    outputs = {"V": speed, "altitude": data[:, 15] * FOOT, **angles}
    return FlightRecord(
        path.stem, 0.04, np.column_stack([force, rates]), outputs, path.stem, BOOM, gravity=9.80,
        between="linear",
    )  # fmt: skip


def _at_boom(speed: np.ndarray, angles: dict[str, np.ndarray], rates: np.ndarray) -> np.ndarray:
    """Airspeed at the boom, where alpha and beta are measured, from that at the CG: ``|s d - w x r|
    = V`` solved for s."""
    cos = np.cos(angles["beta"])
    along = np.column_stack(
        [cos * np.cos(angles["alpha"]), np.sin(angles["beta"]), cos * np.sin(angles["alpha"])]
    )
    swing = np.cross(rates, BOOM)
    part = np.sum(along * swing, axis=1)
    return np.asarray(part + np.sqrt(part**2 - np.sum(swing**2, axis=1) + speed**2))


def harv(path: Path) -> tuple[FlightRecord, np.ndarray]:
    """A HARV record and its first state; the states that its published analysis took from
    measurement are given.

    The published accelerometer and gyro biases are corrections to *add*; the published scales act
    about the first state.
    """
    data = loadmat(path, squeeze_me=True)
    u, z, step = data["u"], data["z"], float(data["dt"])
    inputs = np.column_stack([u[:, :3] * FOOT, u[:, 3:6]])
    if "lon" in path.stem:
        outputs = {"V": z[:, 0] * FOOT, "alpha": z[:, 1], "theta": z[:, 2]}
        given = {"v": u[:, 7] * FOOT, "phi": u[:, 9], "psi": u[:, 11]}
    else:
        outputs = dict(zip(("beta", "phi", "psi"), z.T, strict=True))
        given = {"u": u[:, 6] * FOOT, "w": u[:, 7] * FOOT, "theta": u[:, 8]}
    first = np.r_[data["x0"][:3] * FOOT, data["x0"][3:6], np.zeros(3)]
    pivot = {
        "alpha": data["z0"][2],
        "beta": data["z0"][1],
        **dict(zip(("phi", "theta", "psi"), data["z0"][3:6], strict=True)),
    }
    return FlightRecord(
        path.stem,
        step,
        inputs,
        outputs,
        path.stem,
        given=given,
        pivot=pivot,
        gravity=32.174 * FOOT,
        between="held",
    ), first


def hfb320(path: Path) -> FlightRecord:
    """HFB-320 in turbulence (10 Hz); heading is not logged."""
    data = np.loadtxt(path)
    inputs = data[:, [9, 11, 10, 12, 7, 13]]
    outputs = {
        "V": data[:, 4],
        "alpha": data[:, 5],
        "theta": data[:, 6],
        "beta": data[:, 16],
        "phi": data[:, 17],
    }
    return FlightRecord("hfb320", 0.1, inputs, outputs, "hfb320")


def twin_otter(path: Path) -> FlightRecord:
    """A Twin Otter record (columns as in the data's SOURCE.md); channels that never change are not
    logged."""
    data = loadmat(path, squeeze_me=True)["fdata"]
    angles = {
        name: np.deg2rad(data[:, column])
        for name, column in zip(
            ("beta", "alpha", "phi", "theta", "psi"), (2, 3, 7, 8, 9), strict=True
        )
    }
    outputs = {"V": data[:, 1] * FOOT, "altitude": data[:, 29] * FOOT, **angles}
    inputs = np.column_stack([data[:, 10:13] * 9.80665, np.deg2rad(data[:, 4:7])])
    moving = {name: values for name, values in outputs.items() if np.ptp(values) > 0}
    return FlightRecord(path.stem, float(np.mean(np.diff(data[:, 0]))), inputs, moving, path.stem)


def windows(record: FlightRecord, number: int) -> list[FlightRecord]:
    """A long record in equal parts of one flight."""
    edges = np.linspace(0, len(record.inputs), number + 1).astype(int)
    return [
        replace(
            record,
            name=f"{record.name}/{k}",
            flight=record.name,
            inputs=record.inputs[start:stop],
            outputs={name: values[start:stop] for name, values in record.outputs.items()},
        )
        for k, (start, stop) in enumerate(pairwise(edges))
    ]
