"""Logs of simulated instruments, with their positions, rates, delays, biases and noise."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerodb.physics import DENSITY_0
from aerodb.recording import Topic
from aerodb.simulation.closed_loop import History
from aerodb.support import Array
from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class SensorSignal:
    """One logged field: its true channel and the errors of the instrument.

    ``logged = scale * (true + bias + noise) + offset``; bias and noise are in the channel's SI
    unit. Fields with `held` are logged commands or states: exact and not interpolated.
    """

    field: str
    channel: str
    noise: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    offset: float = 0.0
    dtype: str = "float32"
    held: bool = False


@dataclass(frozen=True)
class Instrument:
    """One topic of the log.

    rate : [Hz]. delay : age of the value at its time stamp [s]. phase : time of the first sample
    [s].
    """

    topic: str
    rate: float
    signals: tuple[SensorSignal, ...]
    delay: float = 0.0
    phase: float = 0.0


def at_instruments(channels: Mapping[str, Array], vehicle: Vehicle) -> dict[str, Array]:
    """Return `channels` with the values at the positions of the instruments added.

    ``ax_imu ay_imu az_imu`` are the specific force at the IMU, ``a + wdot x r + w x (w x r)``.
    ``V_probe alpha_probe beta_probe`` are the air-relative velocity at the air-data probe, ``v + w
    x r``, and ``calibrated_airspeed`` is that there (low Mach number: equivalent airspeed).

    Parameters
    ----------
    channels : name to array of any shape
    vehicle : positions of IMU, probe and CG

    References
    ----------
    Klein & Morelli, Aircraft System Identification (2006), chapter 10.
    """
    cg = np.asarray(vehicle.mass.cg, dtype=np.float64)
    rates = [channels[n] for n in ("p", "q", "r")]
    accelerations = [channels[n] for n in ("pdot", "qdot", "rdot")]
    imu = np.zeros(3) if vehicle.points.imu == "cg" else np.asarray(vehicle.points.imu) - cg
    probe = (
        np.zeros(3) if vehicle.points.air_data is None else np.asarray(vehicle.points.air_data) - cg
    )
    turning = _cross(rates, _cross(rates, imu))
    tangential = _cross(accelerations, imu)
    local = {
        f"a{x}_imu": channels[f"a{x}"] + t + c
        for x, t, c in zip("xyz", tangential, turning, strict=True)
    }
    speed, alpha, beta = channels["V"], channels["alpha"], channels["beta"]
    at_cg = (
        speed * np.cos(beta) * np.cos(alpha),
        speed * np.sin(beta),
        speed * np.cos(beta) * np.sin(alpha),
    )
    u, v, w = (a + b for a, b in zip(at_cg, _cross(rates, probe), strict=True))
    local["V_probe"] = np.sqrt(u * u + v * v + w * w)
    local["alpha_probe"] = np.arctan2(w, u)
    local["beta_probe"] = np.arcsin(v / local["V_probe"])
    local["calibrated_airspeed"] = local["V_probe"] * np.sqrt(channels["rho"] / DENSITY_0)
    return {**channels, **local}


def _cross(a: list[Array], b: Array | list[Array]) -> list[Array]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def measure(
    history: History,
    channels: Mapping[str, Array],
    flight: int,
    instruments: tuple[Instrument, ...],
    generator: np.random.Generator,
    start: float = 0.0,
) -> tuple[Topic, ...]:
    """Return the log topics of one simulated flight.

    Time stamps are whole microseconds. Samples earlier than the delayed signal are not logged.

    Parameters
    ----------
    history : simulated flights
    channels : name to (n, k), the channels of the signals
    flight : index of the flight
    instruments : topics to log
    generator : source of the noise
    start : float, log clock at the beginning of the flight [s]
    """
    samples = int(history.samples[flight])
    clock = history.time[:samples]
    topics = []
    for instrument in instruments:
        count = int(np.floor((clock[-1] - instrument.phase) * instrument.rate + 1e-9)) + 1
        stamp = instrument.phase + np.arange(count) / instrument.rate
        stamp = stamp[stamp >= instrument.delay]
        fields = {}
        for signal in instrument.signals:
            true = channels[signal.channel][:samples, flight]
            value = (
                _held(clock, true, stamp)
                if signal.held
                else np.interp(stamp - instrument.delay, clock, true)
            )
            noise = signal.noise * generator.standard_normal(stamp.shape) if signal.noise else 0.0
            fields[signal.field] = (
                signal.scale * (value + signal.bias + noise) + signal.offset
            ).astype(signal.dtype)
        micro = np.round((start + stamp) * 1e6)
        topics.append(Topic(instrument.topic, micro * 1e-6, fields))
    return tuple(topics)


def _held(clock: Array, values: Array, stamp: Array) -> Array:
    """The latest value at each time stamp, with a tolerance of 1e-9 s for equal instants."""
    result: Array = values[np.searchsorted(clock, stamp + 1e-9, side="right") - 1]
    return result
