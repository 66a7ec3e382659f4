"""Correct every sample of a flight with its reconstruction, or replace a channel by the smoother's.

The source with the smaller expected error is used. A corrected sensor has its own noise and the
uncertainty of its bias; the smoother (`smoother`) weighs it against the inertial motion and the
gusts that it finds, and gives a standard error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.plan import NO_WEIGHT
from aerodb.consistency.pressures import (
    HOLES,
    PORTS,
    angles_from_holes,
    correct_port_errors,
    correct_pressure_altitude,
    recalibrated,
    residuals_as_angles,
    static_pressure,
)
from aerodb.consistency.reconstructed import Reconstruction
from aerodb.consistency.records import (
    IGNORED_FLAGS,
    InertialInputs,
    air_data_at_probe,
    air_data_from_probe,
    inertial_inputs,
    qbar_follows_airspeed,
)
from aerodb.consistency.sensors import delayed, delays_of
from aerodb.consistency.smoother import (
    Gusts,
    Intensities,
    SmoothedFlight,
    SmoothedPath,
    Source,
    StateNoise,
    intensities_of,
    smooth_flight,
    state_noise,
)
from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.support import Array, in_threads
from aerodb.vehicle import Vehicle, angles_from_pressures

#: A channel without a sensor is given if its standard error is within this many accuracy limits of
#: the vehicle.
LIMITS = 2.0

#: Number of draws of the smoother's error for its spectrum.
DRAWS = 8
#: Largest number of wind stretches to draw from.
MOST_DRAWN = 3

_AIR: Final = ("V", "alpha", "beta")
_ATTITUDE: Final = ("phi", "theta", "psi")
_WIND: Final = ("wind_north", "wind_east", "wind_down")
_OTHERS: Final = ("velocity_north", "velocity_east", "velocity_down")


class Origin(Enum):
    """Where the values of a channel come from: its sensor, the smoother (with or without a sensor),
    or nowhere. The values are its words in documents, the names in lower case their
    ``origins``."""

    SENSOR = "corrected sensor"
    SENSOR_AND_MOTION = "smoothed: sensor and motion together"
    MOTION = "smoothed: it has no sensor"
    MOTION_ALONE = "smoothed: motion without its sensor"
    NOT_GIVEN = "not given: it has no sensor"


@dataclass(frozen=True)
class ChannelSource:
    """The `origin` of a channel's values; `because` says why a channel is not given."""

    origin: Origin
    because: str = ""

    @property
    def smoothed(self) -> bool:
        """Whether the values are the smoother's (`Origin`)."""
        return self.origin in (Origin.SENSOR_AND_MOTION, Origin.MOTION, Origin.MOTION_ALONE)

    @property
    def text(self) -> str:
        """As text, as stored in documents."""
        return f"{self.origin.value}, and {self.because}" if self.because else self.origin.value


@dataclass(frozen=True)
class CorrectedFlight:
    """A corrected flight.

    flight : with corrected channels.
    sigma : channel -> (n,), standard errors, SI.
    changed : channels that differ from the measured ones.
    used : channel -> where its values come from.
    beyond : channel -> (n,), what the smoother gives and the flight does not take, SI: wind, gusts
        included, and flow angles whose standard errors are too large; nan outside the records.
    noise : error spectrum of the channels, for the source (smoother or sensor) used for alpha.
    result : the reconstruction, with the standard errors of its winds enlarged for gusts.
    """

    flight: Flight
    sigma: Mapping[str, Array]
    changed: tuple[str, ...]
    used: Mapping[str, ChannelSource]
    beyond: Mapping[str, Array]
    noise: StateNoise
    result: Reconstruction


def corrected_flight(
    flight: Flight,
    vehicle: Vehicle,
    result: Reconstruction,
    values: Mapping[str, float],
    held: Mapping[str, float],
) -> CorrectedFlight:
    """Correct every sample of a mapped flight at its full rate.

    V, alpha, beta and attitude come from the smoother where its expected error is smaller
    (`_choose_source`), or where no sensor measures them and the standard error is within `LIMITS`.
    Dynamic pressure follows the airspeed if both are one measurement. Velocity over the earth stays
    that of its own point (the antenna).

    Parameters
    ----------
    flight : mapped flight, n samples.
    vehicle : sensor positions, noise, priors and accuracy limits.
    result : reconstruction of the flight.
    values : sensor corrections to apply, name -> value, SI.
    held : parameters that were fixed in the reconstruction, name -> value, SI.
    """
    moved = inertial_inputs(flight, vehicle)
    sensors = _sensors(flight, vehicle, moved, values)
    scopes = list(dict.fromkeys(path.record.flight for path in result.paths))
    by = intensities_of(result, scopes, fixed=held)
    result = with_gusty_winds(result, by.gusts)
    stretches = _smoothed(result, scopes, by, held)
    smoothed = [path for stretch in stretches for path in stretch.paths]
    channels, used, sigma, flags = dict(sensors), {}, {}, dict(flight.flags)
    beyond: dict[str, Array] = {}
    for name in _WIND if any(e.parameter.kind == "wind" for e in result.estimates) else ():
        beyond[name], sigma[name] = _at_full_rate(flight, smoothed, name)
    source: Source = "smoother"
    for name in (*_AIR, *_ATTITUDE):
        if name == "V" and name not in sensors:
            continue
        smooth_channel, error = _at_full_rate(flight, smoothed, name)
        own = sensors.get(name)
        choice = _choose_source(flight, result, vehicle, name, values, smooth_channel, error, own)
        used[name] = choice.source
        if name == "alpha" and own is not None and not choice.source.smoothed:
            source = "sensor"
        if choice.source.smoothed:
            here = np.isfinite(smooth_channel)
            channels[name] = smooth_channel if own is None else np.where(here, smooth_channel, own)
            sigma[name] = np.where(here, np.hypot(error, choice.beside), choice.sensor)
            sigma[name] = np.hypot(sigma[name], _by_vertical_air(result, name, values))
            if name in flags:
                flags[name] = np.where(here, 0, flags[name]).astype(flags[name].dtype)
        elif own is not None:
            size = np.hypot(choice.sensor, _by_vertical_air(result, name, values))
            sigma[name] = np.where(np.isfinite(own), size, np.nan)
        elif name in _AIR:
            beyond[name] = smooth_channel
            sigma[name] = np.hypot(error, _by_vertical_air(result, name, values))
    channels |= _pressure(flight, moved, channels, values)
    changed = tuple(
        name
        for name, smooth_channel in channels.items()
        if not _unchanged(smooth_channel, flight.channels.get(name))
    )
    note = (
        f"{', '.join(changed)} are those of the flight-path reconstruction"
        if changed
        else "no channel needed a correction"
    )
    made_flight = replace(
        flight, channels={**flight.channels, **channels}, flags=flags, notes=(*flight.notes, note)
    )
    return CorrectedFlight(
        made_flight, sigma, changed, used, beyond, _noise(stretches, source, used), result
    )


def air_data_of_sensors(
    flight: Flight, vehicle: Vehicle, values: Mapping[str, float]
) -> dict[str, Array]:
    """Return V, alpha and beta (n,) [m/s, rad] of the sensors at the CG, corrected by the errors
    `values` (name -> value, SI), as logged: nothing is smoothed, no wild point is replaced.

    For what is as fast as the sensors, such as the core of a vortex. Raises InputError as
    `inertial_inputs`, where the flight lacks rates or accelerations.
    """
    shown = _sensors(flight, vehicle, inertial_inputs(flight, vehicle), values)
    return {name: shown[name] for name in _AIR if name in shown}


def _smoothed(
    result: Reconstruction, scopes: Sequence[str], by: Intensities, held: Mapping[str, float]
) -> list[SmoothedFlight]:
    """Smooth every stretch of constant wind with common intensities; some of them, spread over the
    flight, with draws."""
    drawn = set(np.linspace(0, len(scopes) - 1, MOST_DRAWN).round().astype(int).tolist())

    def smoothed(number: int) -> SmoothedFlight:
        draws = DRAWS if number in drawn else 0
        return smooth_flight(result, scopes[number], fixed=held, intensities=by, draws=draws)

    return in_threads(smoothed, range(len(scopes)))


def with_gusty_winds(result: Reconstruction, gusts: Gusts) -> Reconstruction:
    """The reconstruction with the variances of its winds enlarged by the mean of the gusts.

    The mean over a time T of a process with standard deviation s and correlation time tau has the
    variance ``2 s^2 tau / T`` (Bartlett 1946). Residuals do not show it, because the wind estimate
    has absorbed it. Without beta only the wind component along the path is observed, so each
    horizontal component is observed for half of the time.

    Parameters
    ----------
    result : reconstruction with winds.
    gusts : standard deviations [m/s] and correlation times [s] of the gusts.
    """
    spread, still = result.covariance.copy(), result.still.copy()
    estimates = list(result.estimates)
    for number, entry in enumerate(result.estimates):
        if entry.parameter.kind == "wind":
            records = [
                path.record for path in result.paths if path.record.flight == entry.parameter.scope
            ]
            blind = not any({"beta", "probe_dp_beta"} & set(record.outputs) for record in records)
            down = entry.parameter.subject == "down"
            size, time = (
                (gusts.vertical, gusts.vertical_time)
                if down
                else (gusts.horizontal, gusts.horizontal_time)
            )
            observed_time = sum(len(record.inputs) * record.step for record in records) * (
                0.5 if blind else 1.0
            )
            more = 2.0 * size**2 * min(time / observed_time, 0.5)
            spread[number, number] += more
            still[number, number] += more
            estimates[number] = replace(
                entry, standard_error=float(np.hypot(entry.standard_error, np.sqrt(more)))
            )
    return replace(result, covariance=spread, still=still, estimates=tuple(estimates))


def _noise(
    stretches: Sequence[SmoothedFlight], source: Source, used: Mapping[str, ChannelSource]
) -> StateNoise:
    own: dict[str, Source] = {
        name: "smoother" if each.smoothed else "sensor" for name, each in used.items()
    }
    drawn = [stretch for stretch in stretches if stretch.drawn]
    paths = tuple(
        replace(entry, path=residuals_as_angles(entry.path))
        for stretch in drawn
        for entry in stretch.paths
    )
    return state_noise(replace(drawn[0], paths=paths), source, own=own)


def _sensors(
    flight: Flight, vehicle: Vehicle, moved: InertialInputs, values: Mapping[str, float]
) -> dict[str, Array]:
    """The measured channels corrected; V, alpha and beta at the probe, then moved to the CG."""
    corrected = {
        raw: _corrected_sensor(flight[raw], name, values, flight.step)
        for name, raw in zip(INPUTS, moved.names, strict=True)
    }
    for name in (*_ATTITUDE, *_OTHERS):
        if name in flight:
            corrected[name] = _corrected_sensor(flight[name], name, values, flight.step)
    rates = np.column_stack([bridge(corrected[name]) for name in moved.names[3:]])
    arm = [
        known + values.get(f"air_data_{axis}", 0.0)
        for known, axis in zip(moved.arm, "xyz", strict=True)
    ]
    at_point = air_data_at_probe(flight, moved)
    shown = {
        name: _corrected_sensor(air, name, values, flight.step) for name, air in at_point.items()
    }
    ports = _without_port_errors(flight, shown, values)
    shown |= {name: ports[name] for name in ("V",) if name in ports}
    if any(
        values.get(name, 0.0) for name in values if name.startswith("probe_")
    ) and angles_from_holes(flight, vehicle, at_point):
        shown |= _angles(flight, vehicle, shown["V"], ports.get("rho", flight["rho"]), values)
    if any(arm) or any(
        not np.array_equal(shown[name], air, equal_nan=True) for name, air in at_point.items()
    ):
        return corrected | ports | air_data_from_probe(shown, rates, arm)
    return corrected | {name: flight[name] for name in shown}


def _without_port_errors(
    flight: Flight, shown: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, Array]:
    """V at the air-data point, density, static pressure and pressure altitude, corrected for errors
    of the pressure ports."""
    if not any(values.get(name, 0.0) for name in PORTS) or "V" not in shown or "rho" not in flight:
        return {}
    pressure = static_pressure(flight)
    air = correct_port_errors(shown["V"], flight["rho"], pressure, values)
    corrected = {"V": air.V} if pressure is None else {"V": air.V, "rho": air.rho}
    if "static_pressure" in flight:
        corrected["static_pressure"] = flight["static_pressure"] - air.excess
    if "pressure_altitude" in flight:
        corrected["pressure_altitude"] = correct_pressure_altitude(flight["pressure_altitude"], air)
    return corrected


def _angles(
    flight: Flight, vehicle: Vehicle, speed: Array, rho: Array, values: Mapping[str, float]
) -> dict[str, Array]:
    """Alpha and beta at the air-data point from raw pressures, with the corrected dynamic pressure
    and calibration."""
    holes = {name: _corrected_sensor(flight[name], name, values, flight.step) for name in HOLES}
    raw = flight.with_channels({**holes, "qbar": 0.5 * rho * speed**2})
    return angles_from_pressures(raw, recalibrated(vehicle.air_data, values))


def _corrected_sensor(shown: Array, name: str, values: Mapping[str, float], step: float) -> Array:
    """``(shown(t + delay) - bias) / (1 + scale)``; non-finite where the sensor was."""
    delay = sum(values.get(each, 0.0) for each in delays_of(name))
    if delay and np.isfinite(shown).any():
        shown = np.where(np.isfinite(shown), delayed(bridge(shown), -delay / step), np.nan)
    return np.asarray(
        (shown - values.get(f"{name}_bias", 0.0)) / (1.0 + values.get(f"{name}_scale", 0.0))
    )


def _pressure(
    flight: Flight,
    moved: InertialInputs,
    channels: Mapping[str, Array],
    values: Mapping[str, float],
) -> dict[str, Array]:
    """Corrected dynamic pressure: from the airspeed if both are one measurement, otherwise from its
    own sensor."""
    if "qbar" not in flight:
        return {}
    if not qbar_follows_airspeed(flight, air_data_at_probe(flight, moved)):
        own = _corrected_sensor(flight["qbar"], "qbar", values, flight.step)
        gain = 1.0 + values.get("total_port_error", 0.0) - values.get("static_port_error", 0.0)
        return {"qbar": (own + values.get("static_port_offset", 0.0)) / gain}
    if "V" not in channels or _unchanged(channels["V"], flight["V"]):
        return {}
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(flight["V"] > 0, channels["V"] / flight["V"], 1.0)
        thinner = channels["rho"] / flight["rho"] if "rho" in channels else 1.0
    return {"qbar": flight["qbar"] * ratio**2 * thinner}


@dataclass(frozen=True)
class _SourceChoice:
    """The `source` of a channel. `sensor`: expected error of its sensor (SI; nan: no sensor);
    `beside`: error of the smoother in addition to its standard error, SI."""

    source: ChannelSource
    sensor: float
    beside: float


def _choose_source(
    flight: Flight,
    result: Reconstruction,
    vehicle: Vehicle,
    name: str,
    values: Mapping[str, float],
    smooth_channel: Array,
    error: Array,
    own: Array | None,
) -> _SourceChoice:
    """The source with the smaller expected error for one channel.

    Expected error of the sensor: white noise and uncertainty of the bias. Expected error of the
    smoother: its standard error, and the part of its difference from the sensor that exceeds the
    sensor's noise, which is gusts too fast for the smoother.

    smooth_channel, error : (n,), smoothed channel and its standard error, SI.
    own : (n,), corrected sensor, SI; None: no sensor.
    """
    size = float(np.sqrt(np.nanmean(error**2)))
    if own is None:
        if not _estimated_start(result, name):
            size = float("nan")  # its initial value was set, not estimated
        limit = LIMITS * (
            vehicle.accuracy.attitude if name in _ATTITUDE else vehicle.accuracy.flow_angle
        )
        known = (
            f"its standard error would be {np.rad2deg(size):.2g} deg"
            if np.isfinite(size)
            else "nothing determines it"
        )
        chosen = (
            ChannelSource(Origin.MOTION)
            if size <= limit
            else ChannelSource(Origin.NOT_GIVEN, known)
        )
        return _SourceChoice(chosen, float("nan"), 0.0)
    good = flight.usable((name,), despite=IGNORED_FLAGS) & np.isfinite(smooth_channel)
    white = _white(flight, vehicle, name, good)
    apart = float(np.var((own - smooth_channel)[good])) if good.any() else np.inf
    if result.noise.get(name, 0.0) >= NO_WEIGHT:  # it has left the estimate: the error is its own
        sensor = float(np.sqrt(apart))
        better = size < sensor and _estimated_start(result, name)
        origin = Origin.MOTION_ALONE if better else Origin.SENSOR
        return _SourceChoice(ChannelSource(origin), sensor, 0.0)
    beside = float(
        np.sqrt(max(apart - white**2 + size**2, 0.0))
    )  # the sensor's noise is in both, with covariance size^2
    sensor = float(np.hypot(white, _uncertain(result, vehicle, name, values)))
    if np.hypot(size, beside) < sensor:
        return _SourceChoice(ChannelSource(Origin.SENSOR_AND_MOTION), sensor, beside)
    return _SourceChoice(ChannelSource(Origin.SENSOR), sensor, beside)


def _estimated_start(result: Reconstruction, name: str) -> bool:
    """Return whether the initial value of a heading was estimated; true for every other channel."""
    return name != "psi" or any(entry.parameter.name == "initial_psi" for entry in result.estimates)


def _white(flight: Flight, vehicle: Vehicle, name: str, good: NDArray[np.bool_]) -> float:
    """One sigma of a sensor's white noise: from the vehicle file, otherwise from second differences
    (variance 6 s^2) of usable samples."""
    declared = vehicle.sensors[name].noise if name in vehicle.sensors else 0.0
    if declared > 0:
        return declared
    second = np.diff(flight[name], 2)[good[:-2] & good[1:-1] & good[2:]]
    return float(np.sqrt(np.mean(second**2) / 6.0)) if len(second) else float("nan")


def _uncertain(
    result: Reconstruction, vehicle: Vehicle, name: str, values: Mapping[str, float]
) -> float:
    """Standard error of a sensor's bias after correction, in air without vertical motion: that of
    the estimate, or the vehicle file's prior if none is applied."""
    number = _bias(result, name, values)
    if number is not None:
        return float(np.sqrt(result.still[number, number]))
    return vehicle.sensors[name].bias_prior if name in vehicle.sensors else 0.0


def _bias(result: Reconstruction, name: str, values: Mapping[str, float]) -> int | None:
    """Number of the estimate of a channel's bias that is applied; None if there is none."""
    for number, entry in enumerate(result.estimates):
        item = entry.parameter
        if item.name in (f"{name}_bias", f"probe_{name}_offset") and item.name in values:
            return number
    return None


def _by_vertical_air(result: Reconstruction, name: str, values: Mapping[str, float]) -> float:
    """Standard error of a channel because vertical air may be part of its bias: the same for the
    sensor and for the smoother, whose path takes the air as still."""
    number = _bias(result, name, values)
    if number is None:
        return 0.0
    both = result.covariance[number, number] - result.still[number, number]
    return float(np.sqrt(max(both, 0.0)))


def _at_full_rate(
    flight: Flight, smoothed: Sequence[SmoothedPath], name: str
) -> tuple[Array, Array]:
    """A smoothed channel and its standard error at every sample of the records, nan elsewhere."""
    values, sigma = np.full(len(flight.time), np.nan), np.full(len(flight.time), np.nan)
    for entry in smoothed:
        record = entry.path.record
        many = round(record.step / flight.step)
        shown = _smoothed_channel(entry, name)
        at = record.first + many * np.arange(len(shown))
        index = np.arange(record.first, min(record.first + many * len(shown), len(values)))
        values[index] = CubicSpline(at, shown)(index) if many > 1 else shown[: len(index)]
        sigma[index] = np.interp(index, at, entry.sigma[name])
    return values, sigma


def _smoothed_channel(entry: SmoothedPath, name: str) -> Array:
    if name in _WIND:
        return np.asarray(entry.wind[_WIND.index(name)])
    if name in _AIR:
        return np.asarray(getattr(entry.path, name))
    return np.asarray(entry.path.states[STATES.index(name)])


def _unchanged(smooth_channel: Array, measured: Array | None) -> bool:
    return measured is not None and np.array_equal(smooth_channel, measured, equal_nan=True)
