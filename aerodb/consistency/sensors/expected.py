"""Detect gross faults of inertial sensors: signs, units, swapped axes, missing gravity.

The specific force and rates that attitude and velocity imply are compared with the measured ones.
They come from differentiation and are rough, but gross faults stand out. Each is named in one
sentence.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.sensors.prediction import FlightRecord, earth_to_body
from aerodb.signals import bridge, smooth
from aerodb.support import Array

#: Bandwidth of the differentiation, Hz; at most an eighth of the sampling rate is used.
BANDWIDTH = 1.5

#: Smallest standard deviation of the motion (rad/s; m/s2) that can show a fault.
_LEAST = (0.01, 0.2)


@dataclass(frozen=True)
class SensorFault:
    """A gross fault: the channels concerned and one sentence that names the likely cause."""

    channels: tuple[str, ...]
    sentence: str


def expected_inputs(record: FlightRecord) -> Array:
    """Specific force and rates that the other channels imply.

    Rates follow from phi, theta and psi: ``p = phi' - psi' sin theta`` etc. Specific force follows
    from attitude and velocity over the earth, ``C (v' - g)``, or otherwise from the air data,
    ``v' + omega x v - C g`` in still air.

    Parameters
    ----------
    record : n samples with attitude, and velocity over the earth or V and alpha.

    Returns
    -------
    (n, 6), specific force [m/s2] and rates [rad/s]; columns that cannot be computed are nan.

    References
    ----------
    Klein & Morelli (2006), Aircraft System Identification, chapter 10.
    """
    n = len(record.inputs)
    expected = np.full((n, 6), np.nan)
    known = {
        name: bridge(values) for name, values in record.outputs.items() if np.isfinite(values).any()
    }
    known.update({name: bridge(values) for name, values in record.given.items()})
    if not {"phi", "theta"} <= set(known):
        return expected
    limit = min(BANDWIDTH, 0.125 / record.step)

    def rate(values: Array) -> Array:
        return smooth(values, record.step, limit).rate

    phi, theta = known["phi"], known["theta"]
    states = np.zeros((9, n))
    states[3], states[4] = phi, theta
    if "psi" in known:
        psi = np.unwrap(known["psi"])
        states[5] = psi
        turn, pitch = rate(psi), rate(theta)
        expected[:, 3] = rate(np.unwrap(phi)) - turn * np.sin(theta)
        expected[:, 4] = pitch * np.cos(phi) + turn * np.cos(theta) * np.sin(phi)
        expected[:, 5] = -pitch * np.sin(phi) + turn * np.cos(theta) * np.cos(phi)
    rotation = earth_to_body(states)
    gravity = rotation[:, 2] * record.gravity
    earth = [f"velocity_{axis}" for axis in ("north", "east", "down")]
    if set(earth) <= set(known) and "psi" in known:
        change = np.stack([rate(known[name]) for name in earth])
        expected[:, :3] = (np.einsum("ijn,jn->in", rotation, change) - gravity).T
    elif {"V", "alpha"} <= set(known):
        alpha, beta = known["alpha"], known.get("beta", np.zeros(n))
        air = known["V"] * np.stack(
            [np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)]
        )
        turning = expected[:, 3:] if "psi" in known else record.inputs[:, 3:]
        air = air - np.cross(turning, record.arm).T
        change = np.stack([rate(part) for part in air])
        expected[:, :3] = (change + np.cross(turning, air.T).T - gravity).T
    return expected


def detect_faults(record: FlightRecord) -> tuple[SensorFault, ...]:
    """Return gross faults of a record's sensors, inputs (n, 6) [m/s²], [rad/s].

    Stuck channels and angles in degrees are tested first; only if there are none, missing gravity,
    then signs, units and swapped axes of the inertial sensors.
    """
    faults = [*_stuck(record), *_units(record)]
    if faults:
        return tuple(faults)  # the further tests would report the same faults again
    expected = expected_inputs(record)
    for first, names, least in ((3, INPUTS[3:], _LEAST[0]), (0, INPUTS[:3], _LEAST[1])):
        block = slice(first, first + 3)
        if np.isfinite(expected[:, block]).all():
            smoothed = np.column_stack(
                [_low(record.inputs[:, k], record.step) for k in range(first, first + 3)]
            )
            if first == 0:
                faults += _gravity(expected, smoothed, record.gravity)
            if not faults:
                faults += _axes(expected[:, block], smoothed, names, least)
    return tuple(faults)


def _low(values: Array, step: float) -> Array:
    return smooth(values, step, min(BANDWIDTH, 0.125 / step)).value


def _stuck(record: FlightRecord) -> list[SensorFault]:
    channels = {**{name: record.inputs[:, k] for k, name in enumerate(INPUTS)}, **record.outputs}
    still = []
    for name, values in channels.items():
        finite = values[np.isfinite(values)]
        if len(finite) and np.ptp(finite) == 0.0:
            still.append(name)
    if len(still) == len(channels):
        return []
    return [
        SensorFault((name,), f"{name} does not change at all: the sensor is stuck or not connected")
        for name in still
    ]


def _units(record: FlightRecord) -> list[SensorFault]:
    faults = []
    for name in ("phi", "theta", "alpha", "beta"):
        values = record.outputs.get(name)
        if (
            values is not None
            and np.nanmax(np.abs(values)) > (np.pi if name == "phi" else np.pi / 2) * 1.05
        ):
            faults.append(
                SensorFault(
                    (name,),
                    f"{name} reaches {np.nanmax(np.abs(values)):.0f} rad: degrees declared as"
                    " radians",
                )
            )
    return faults


def _gravity(expected: Array, shown: Array, gravity: float) -> list[SensorFault]:
    """Faults seen in the mean specific force (n, 3) minus the expected one, in g: gravity missing,
    inverted, or on another axis."""
    across, down = np.mean(shown - expected[:, :3], axis=0)[1:] / gravity
    if 0.8 < down < 1.2 and -1.2 < across < -0.8:
        return [SensorFault(("ay", "az"), "ay and az are swapped: ay shows gravity, az does not")]
    if 0.8 < down < 1.2:
        sentence = (
            "az lacks gravity: its mean is 1 g above what attitude and velocity imply (logged as nz"
            " - 1?); subtract g"
        )
        return [SensorFault(("az",), sentence)]
    if 1.6 < down < 2.4:
        return [
            SensorFault(("az",), "az has the wrong sign: at rest and level it must show -9.81 m/s2")
        ]
    return []


def _axes(expected: Array, shown: Array, names: Sequence[str], least: float) -> list[SensorFault]:
    """Compare each expected axis with each sensor (n, 3): the correlation tells which belong
    together, the slope tells sign and unit."""
    moves = expected - expected.mean(axis=0)
    deviation = shown - shown.mean(axis=0)
    size, answer = moves.std(axis=0), deviation.std(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.nan_to_num((moves.T @ deviation) / len(moves) / np.outer(size, answer))
    faults: list[SensorFault] = []
    for k, name in enumerate(names):
        best = int(np.argmax(np.abs(alike[k])))
        if size[k] < least or abs(alike[k, best]) < 0.8:
            continue
        slope = alike[k, best] * answer[best] / size[k]
        if best != k and int(np.argmax(np.abs(alike[best]))) == k and abs(alike[k, k]) < 0.6:
            if k < best:
                faults.append(
                    SensorFault(
                        (name, names[best]),
                        f"{name} and {names[best]} are swapped: each shows the other's motion",
                    )
                )
        elif best == k and slope < 0:
            faults.append(
                SensorFault(
                    (name,),
                    f"{name} has the wrong sign: it runs against the motion that the other sensors"
                    " show",
                )
            )
        elif best == k and 30.0 < slope < 90.0:
            faults.append(
                SensorFault(
                    (name,), f"{name} is {slope:.0f} times too large: degrees declared as radians"
                )
            )
        elif best == k and 1 / 90.0 < slope < 1 / 30.0:
            faults.append(
                SensorFault(
                    (name,),
                    f"{name} is {1 / slope:.0f} times too small: radians converted to radians once"
                    " more",
                )
            )
    return faults
