"""Cut a flight into the records that are reconstructed.

A record is a stretch without gaps, with the air data moved back to the probe and the sampling rate
reduced as far as the motion allows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from aerodb.conditioning import SETTLED, SLOW, STEADY_WIND_ALTITUDE, STEADY_WIND_TIME, local_gravity
from aerodb.consistency.earth_terms import over_flat_earth
from aerodb.consistency.pressures import HOLES, angles_from_holes, static_pressure
from aerodb.consistency.sensors import OUTPUTS, FlightRecord, installation_from_vehicle
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.physics import HIGHEST_LATITUDE, Earth, specific_force_at_cg
from aerodb.signals import FEWEST_SAMPLES, bridge, low_passed, smooth
from aerodb.support import Array
from aerodb.vehicle import Vehicle, mass_channels, probe_configuration, velocity_at_cg

#: Gaps in the inertial channels up to this length (s) are bridged; longer ones end a record.
SHORT_GAP = 0.2


#: Flights longer than this (s) are reconstructed over a rotating earth. A gyro bias, constant in
#: body axes, absorbs the earth's 15 deg/h only on a constant heading.
ROTATING_EARTH_DURATION = 600.0

#: Flags that do not exclude a sample here: a captive vehicle moves as consistently as a free one.
IGNORED_FLAGS: Final = ("captive",)

#: Two altitudes whose difference varies by no more than this (m) come from one sensor.
_LEVEL = 1e-3

#: Two channels that agree to this relative difference come from one sensor: the mapping file
#: computed one of them from the other.
_SAME = 1e-6


@dataclass(frozen=True)
class InertialInputs:
    """The integrated channels of a flight.

    names : of the six channels, specific force first.
    values : (n, 6), specific force at the CG [m/s2] and rates [rad/s], gaps bridged, otherwise as
        measured.
    arm : (3,), air-data point relative to the mean CG, body axes [m].
    cg : (3,), mean CG relative to the datum, body axes [m].
    """

    names: tuple[str, ...]
    values: Array
    arm: tuple[float, float, float]
    cg: Array


def inertial_inputs(flight: Flight, vehicle: Vehicle) -> InertialInputs:
    """Specific force [m/s^2] at the CG and angular rates [rad/s] of a flight, (n, 6).

    Specific force measured away from the CG is moved to it with the measured rates and their
    derivatives. Raises InputError when specific force, rates or attitude are not logged.
    """
    at_cg, at_imu = ("ax", "ay", "az"), ("ax_imu", "ay_imu", "az_imu")
    logged = [sum(name in flight for name in names) for names in (at_cg, at_imu)]
    force_names = at_cg if logged[0] == 3 or logged[0] > logged[1] else at_imu
    names = (*force_names, "p", "q", "r")
    absent = [name for name in (*names, "phi", "theta") if name not in flight]
    if absent:
        raise InputError(
            f"{', '.join(absent)} not logged",
            f"flight {flight.id[:12]}",
            "kinematics need them all",
        )
    empty = [name for name in names if np.isfinite(flight[name]).sum() < FEWEST_SAMPLES]
    if empty:
        raise InputError(
            f"{', '.join(empty)} hold no {SETTLED:g} s without a gap",
            f"flight {flight.id[:12]}",
        )
    properties = mass_channels(flight, vehicle)
    cg = np.column_stack([properties[f"cg_{axis}"] for axis in "xyz"])
    values = np.column_stack([bridge(flight[name]) for name in names])
    if force_names[0] == "ax_imu" and vehicle.points.imu != "cg":
        band = min(5.0, 0.25 / flight.step)
        turning = np.column_stack([smooth(values[:, k], flight.step, band).rate for k in (3, 4, 5)])
        values[:, :3] = specific_force_at_cg(
            values[:, :3], values[:, 3:], turning, np.asarray(vehicle.points.imu) - cg
        )
    arm = (
        np.zeros(3)
        if vehicle.points.air_data is None
        else np.asarray(vehicle.points.air_data) - cg.mean(0)
    )
    return InertialInputs(names, values, (float(arm[0]), float(arm[1]), float(arm[2])), cg.mean(0))


def air_data_at_probe(flight: Flight, moved: InertialInputs) -> dict[str, Array]:
    """Logged V [m/s], alpha and beta [rad] at the air-data point, (n,) each.

    The mapping file moved them to the CG with the measured rates; this undoes it, because delay,
    bias and scale are errors of the probe. Without beta the mapping took the sideslip at the probe
    as zero.
    """
    logged = {name: flight[name] for name in ("V", "alpha", "beta") if name in flight}
    if not any(moved.arm) or not {"V", "alpha"} <= set(logged):
        return logged
    speed, alpha = logged["V"], logged["alpha"]
    swing = np.cross(moved.values[:, 3:], moved.arm)
    across = speed * np.sin(logged["beta"]) if "beta" in logged else -swing[:, 1]
    ahead = np.sqrt(np.maximum(speed**2 - across**2, 0.0))
    u, v, w = np.column_stack([ahead * np.cos(alpha), across, ahead * np.sin(alpha)]).T + swing.T
    total = np.sqrt(u * u + v * v + w * w)
    with np.errstate(invalid="ignore", divide="ignore"):
        shown = {"V": total, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / total)}
    return {name: shown[name] for name in logged}


def air_data_from_probe(
    shown: dict[str, Array], rates: Array, arm: Sequence[float]
) -> dict[str, Array]:
    """V, alpha and beta at the CG from those at the probe.

    Parameters
    ----------
    shown : channel -> (n,), V [m/s], alpha and beta [rad] at the probe; an absent beta is zero.
    rates : (n, 3), p, q, r [rad/s].
    arm : (3,), probe relative to the CG, body axes [m].

    Returns
    -------
    The same channels at the CG; unchanged when V or alpha is absent.
    """
    if not any(arm) or not {"V", "alpha"} <= set(shown):
        return shown
    beta = shown.get("beta", np.zeros_like(shown["alpha"]))
    part = np.cos(beta)
    velocity = shown["V"] * np.stack(
        [part * np.cos(shown["alpha"]), np.sin(beta), part * np.sin(shown["alpha"])]
    )
    u, v, w = velocity_at_cg(velocity.T, rates, np.broadcast_to(arm, rates.shape)).T
    total = np.sqrt(u * u + v * v + w * w)
    with np.errstate(invalid="ignore", divide="ignore"):
        air_data = {"V": total, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / total)}
    return {name: air_data[name] for name in shown}


def qbar_follows_airspeed(flight: Flight, shown: Mapping[str, Array]) -> bool:
    """Return whether qbar [Pa] and V [m/s] of a flight are one measurement.

    They are if qbar = rho V^2 / 2 to the last digits, with V at the CG or at the air-data point
    (`shown`, channel -> (n,)).
    """
    if not all(name in flight for name in ("qbar", "V", "rho")):
        return "qbar" not in flight
    apart = []
    for speed in (flight["V"], shown["V"]):
        computed = 0.5 * flight["rho"] * speed**2
        good = np.isfinite(computed) & np.isfinite(flight["qbar"]) & (computed > 0)
        apart.append(
            float(np.median(np.abs(flight["qbar"][good] / computed[good] - 1.0)))
            if good.any()
            else 0.0
        )
    return min(apart) < _SAME


def records_from_flight(
    flight: Flight,
    vehicle: Vehicle,
    *,
    seconds: float = 60.0,
    decimation: int = 1,
    rotating: bool = True,
) -> tuple[FlightRecord, ...]:
    """Records of the usable stretches of a flight, named ``<flight id>/<number>``.

    Inertial drift stays small over a minute, so every record has its own initial state; sensor
    errors are common to all. The wind is constant over `STEADY_WIND_TIME` and
    `STEADY_WIND_ALTITUDE`: records with another wind have ``#<number>`` after the flight id. V,
    alpha and beta are moved back from the CG to the probe, whose errors are estimated; if they were
    computed from the raw pressures of a five-hole probe, these pressures replace them. With a
    logged latitude gravity is that of the place, and long flights are reconstructed over a rotating
    earth, because gyros measure its rate. Of others the inertial channels are those over a flat
    earth (`over_flat_earth`).

    Parameters
    ----------
    flight : mapped flight.
    vehicle : sensor positions, mounting and calibration.
    seconds : longest record, about [s].
    decimation : decimation factor; a low-pass filter is applied first.
    rotating : whether the earth may rotate below a long flight.

    Raises InputError when specific force, rates or attitude are not logged, or no stretch is long
    enough.
    """
    moved = inertial_inputs(flight, vehicle)
    runs = _gapless_runs(flight, vehicle, moved.names)
    if not runs:
        raise InputError(
            f"no {SETTLED:g} s without a gap",
            f"flight {flight.id[:12]}",
            "see its flags for what was lost",
        )
    outputs, raw = _outputs(flight, vehicle, moved)
    earth = _earth(flight) if rotating else None
    integrated = moved.values if earth is not None else _over_flat_earth(flight, moved)
    noise = _input_noise(moved.values, decimation) if decimation > 1 else None
    gravity = _gravity(flight)
    records: list[FlightRecord] = []
    number = probe_configuration(flight, vehicle.air_data)
    for start, stop in runs:
        whole = slice(start, stop)
        how = installation_from_vehicle(vehicle, moved.cg, raw, int(number[start]))
        inputs = np.column_stack(
            [_decimated(integrated[whole, k], flight.step, decimation) for k in range(6)]
        )
        shown = {
            name: _decimated(values[whole], flight.step, decimation)
            for name, values in outputs.items()
        }
        density, pressure = (
            None if values is None else _decimated(bridge(values)[whole], flight.step, decimation)
            for values in (flight.channels.get("rho"), static_pressure(flight))
        )
        for first, last in _windows(len(inputs), seconds / (flight.step * decimation)):
            part = slice(first, last)
            records.append(
                FlightRecord(
                    f"{flight.id}/{len(records)}",
                    flight.step * decimation,
                    inputs[part],
                    {
                        name: values[part]
                        for name, values in shown.items()
                        if np.isfinite(values[part]).any()
                    },
                    flight.id,
                    moved.arm,
                    density=None if density is None else density[part],
                    gravity=gravity,
                    first=start + first * decimation,
                    start=(start + first * decimation) * flight.step,
                    installation=how,
                    pressure=None if pressure is None else pressure[part],
                    earth=earth,
                    input_noise=noise,
                )
            )
    return _with_winds(records, flight.step)


def flight_of(record: FlightRecord) -> str:
    """Return the id of the flight that a record belongs to (`FlightRecord.flight`, without its
    part)."""
    return record.flight.partition("#")[0]


def _outputs(
    flight: Flight, vehicle: Vehicle, moved: InertialInputs
) -> tuple[dict[str, Array], bool]:
    """Measured channels to compare with the reconstruction, nan where they must not be used; and
    whether raw five-hole pressures replace the flow angles."""

    def measured(name: str) -> Array:
        return np.where(flight.usable((name,), despite=IGNORED_FLAGS), flight[name], np.nan)

    outputs = {name: measured(name) for name in OUTPUTS if name in flight}
    shown = air_data_at_probe(flight, moved)
    outputs |= {
        name: np.where(np.isfinite(outputs[name]), values, np.nan) for name, values in shown.items()
    }
    raw = angles_from_holes(flight, vehicle, shown)
    if raw:
        outputs = {name: values for name, values in outputs.items() if name not in HOLES.values()}
        outputs |= {name: measured(name) for name in HOLES}
    if "rho" not in flight or qbar_follows_airspeed(flight, shown):
        outputs.pop("qbar", None)
    if "altitude" in flight and "pressure_altitude" in flight and "rho" in flight:
        apart = (flight["pressure_altitude"] - flight["altitude"])[np.isfinite(outputs["altitude"])]
        if np.isfinite(apart).any() and np.nanstd(apart) > _LEVEL:
            outputs["pressure_altitude"] = measured("pressure_altitude")
    if "north" not in outputs and "latitude" in flight and "longitude" in flight:
        outputs |= _local_position(flight)
    return outputs, raw


def _local_earth(flight: Flight) -> Earth | None:
    """The earth with its local origin at the median position; None when no position is logged."""
    if "latitude" not in flight or "longitude" not in flight:
        return None
    good = flight.usable(("latitude", "longitude"), despite=IGNORED_FLAGS)
    return (
        Earth(*(float(np.median(flight[name][good])) for name in ("latitude", "longitude")))
        if good.any()
        else None
    )


def _earth(flight: Flight) -> Earth | None:
    """The rotating earth for a long flight; None for a short one or an unknown latitude."""
    return (
        _local_earth(flight) if flight.time[-1] - flight.time[0] > ROTATING_EARTH_DURATION else None
    )


def _over_flat_earth(flight: Flight, moved: InertialInputs) -> Array:
    """The inertial channels (n, 6) over a flat earth; as measured where no velocity is known."""

    def logged(name: str) -> Array | None:
        known = name in flight and np.isfinite(flight[name]).any()
        return bridge(flight[name]) if known else None

    speed, psi = logged("V"), logged("psi")
    phi, theta = logged("phi"), logged("theta")
    if speed is None or phi is None or theta is None:
        return moved.values
    still = np.zeros(len(speed))
    alpha, beta = (logged(name) for name in ("alpha", "beta"))
    alpha, beta = still if alpha is None else alpha, still if beta is None else beta
    # the wind changes the earth's terms by its share of the airspeed, which does not matter
    ahead = speed * np.cos(beta)
    velocity = np.stack([ahead * np.cos(alpha), speed * np.sin(beta), ahead * np.sin(alpha)])
    latitude = logged("latitude") if psi is not None else None
    place = None if latitude is None else float(np.median(latitude))
    if place is not None and abs(place) > HIGHEST_LATITUDE:
        place = None
    attitude = np.stack([phi, theta, still if psi is None else psi])
    return over_flat_earth(moved.values, attitude, velocity, place)


def _gravity(flight: Flight) -> float:
    """Gravity [m/s2] where the flight took place."""
    at = ("latitude", "longitude", "altitude", "pressure_altitude")
    return local_gravity(
        {
            name: flight[name][flight.usable((name,), despite=IGNORED_FLAGS)]
            for name in at
            if name in flight
        }
    )


def _local_position(flight: Flight) -> dict[str, Array]:
    """Position north and east of the flight's median position, m."""
    middle = _local_earth(flight)
    if middle is None:
        return {}
    good = flight.usable(("latitude", "longitude"), despite=IGNORED_FLAGS)
    north, east = middle.to_local(flight["latitude"], flight["longitude"])
    return {"north": np.where(good, north, np.nan), "east": np.where(good, east, np.nan)}


def _decimated(values: Array, step: float, decimation: int) -> Array:
    """Decimate samples (n,) after a low-pass filter; samples close to a non-finite one are nan."""
    if decimation == 1:
        return values
    good = np.isfinite(values)
    if not good.any():
        return values[::decimation]
    # cut-off at half the new sampling rate: the remaining noise is white at that rate
    slow = low_passed(values, step, 0.5 / (step * decimation))[::decimation]
    near = np.convolve(~good, np.ones(2 * decimation + 1), mode="same")[::decimation] > 0.5
    return np.where(near, np.nan, slow)


def _input_noise(inputs: Array, decimation: int) -> tuple[float, ...]:
    """One sigma of the white noise after the low-pass filter, from the full rate: at the decimated
    rate, second differences would mistake motion for noise."""
    sigma = np.sqrt(np.mean(np.diff(inputs, 2, axis=0) ** 2, axis=0) / 6.0 / decimation)
    return tuple(float(value) for value in sigma)


def _gapless_runs(flight: Flight, vehicle: Vehicle, names: Sequence[str]) -> list[tuple[int, int]]:
    """(start, stop) of the stretches that are long enough, have no long gap, and in which the
    probe's configuration stays the same."""
    good = flight.usable(names, despite=IGNORED_FLAGS)
    if "V" in flight and np.isfinite(flight["V"]).any():
        # at rest there are no flow angles; a short loss of airspeed does not end a record
        speed = bridge(flight["V"])
        good = good & (speed > SLOW * np.percentile(speed, 90))
    edges = np.flatnonzero(np.diff(np.r_[False, good, False].astype(np.int8)))
    merged: list[list[int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if merged and (start - merged[-1][1]) * flight.step <= SHORT_GAP:
            merged[-1][1] = stop
        else:
            merged.append([start, stop])
    changes = np.flatnonzero(np.diff(probe_configuration(flight, vehicle.air_data))) + 1
    least = max(SETTLED / flight.step, FEWEST_SAMPLES)
    parts = [
        pair
        for start, stop in merged
        for pair in pairwise([start, *changes[(changes > start) & (changes < stop)].tolist(), stop])
    ]
    return [(start, stop) for start, stop in parts if stop - start >= least]


def _windows(n: int, longest: float) -> list[tuple[int, int]]:
    """Equal windows of at most `longest` samples."""
    cuts = np.linspace(0, n, int(np.ceil(n / longest)) + 1).round().astype(int).tolist()
    return list(pairwise(cuts))


def _with_winds(records: Sequence[FlightRecord], step: float) -> tuple[FlightRecord, ...]:
    """The records of one flight; ``#<number>`` marks each new wind, by time or altitude."""
    split, number = [], 0
    began, height = records[0].first, _height(records[0])
    for record in records:
        here = _height(record)
        late = (record.first - began) * step > STEADY_WIND_TIME
        if late or abs(here - height) > STEADY_WIND_ALTITUDE:
            number, began, height = number + 1, record.first, here
        split.append(replace(record, flight=f"{record.flight}#{number}") if number else record)
    return tuple(split)


def _height(record: FlightRecord) -> float:
    values = record.outputs.get("altitude")
    return float(np.nanmean(values)) if values is not None else 0.0
