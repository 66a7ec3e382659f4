"""Total aerodynamic force and moment coefficients of a flight, with their uncertainty (003, eqs.
1-4).

Newton's and Euler's equations for a rigid body, solved for the aerodynamic part. Two equations are
misprinted in 003 (a square on z in eq. 1, a missing division in eq. 4); those used are derived
from ``a_P = a_CG + wdot x r + w x (w x r)``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aerodb.coefficients.angular_acceleration import choose_angular_accelerations
from aerodb.coefficients.thrust import (
    THRUST_REMEDY,
    ThrustShare,
    thrust_loads,
    thrust_share,
    without_thrust,
)
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import (
    FORCE_AXES,
    MOMENT_AXES,
    hinge_moment_of,
    hinge_surface,
    in_order,
    is_hinge_axis,
)
from aerodb.physics import inertial_moment, specific_force_at_cg
from aerodb.signals import FEWEST_SAMPLES, bridge, smooth
from aerodb.support import Array
from aerodb.tables import ReferenceGeometry, transfer_moments
from aerodb.vehicle import Vehicle, cg_positions, mass_channels

#: Bandwidth of the differentiated rates [Hz] when the vehicle file states none: above the
#: rigid-body modes of manned and larger unmanned aircraft. Limited to a quarter of the sampling
#: rate.
DEFAULT_BANDWIDTH = 5.0

#: Dynamic pressure [Pa] below which the aircraft is at rest and the value counts as zero.
STILL = 1e-6

RateSource = Literal["differentiated", "logged", "chosen"]


@dataclass(frozen=True)
class Coefficients:
    """Total coefficients of one flight, positive along the body axes.

    Parameters
    ----------
    time : (n,) s.
    values : axis -> (n,). An axis that the flight cannot give is absent; the reason is in `notes`.
    sigma : axis -> (n,), one standard deviation due to sensor noise.
    usable : axis -> (n,).
    moment_reference : (n, 3) m, body axes from the datum; the point that moments refer to.
    bandwidth : Hz, of the moments when their angular accelerations were differentiated from rates;
        None when they were logged. Whatever is compared with band-limited moments must be limited
        alike, or slopes are estimated too small.
    notes : what was assumed or is missing.
    thrust : where the thrust is known and what it can add; None where none is expected in the log.
    left_out : axes that are absent because they contain a thrust that the flight lacks.
    """

    flight: str
    time: Array
    values: Mapping[str, Array]
    sigma: Mapping[str, Array]
    usable: Mapping[str, NDArray[np.bool_]]
    moment_reference: Array
    bandwidth: float | None
    notes: tuple[str, ...]
    thrust: ThrustShare | None = None
    left_out: tuple[str, ...] = ()


def bandwidth_of(flight: Flight, vehicle: Vehicle, requested: float | None = None) -> float:
    """Bandwidth [Hz] of a flight's differentiated rates: `requested`, else the vehicle's, else
    DEFAULT_BANDWIDTH; at most a quarter of the sampling rate."""
    return min(requested or vehicle.processing.bandwidth or DEFAULT_BANDWIDTH, 0.25 / flight.step)


def total_coefficients(
    flight: Flight,
    vehicle: Vehicle,
    *,
    bandwidth: float | None = None,
    angular_acceleration: RateSource = "differentiated",
) -> Coefficients:
    """Total coefficients CX CY CZ Cl Cm Cn of a flight, about the vehicle's moment reference, over
    the dynamic pressure or the vehicle's constant reference pressure; and Ch_<surface> of the hinge
    moments that it logs, over the area and chord of each surface behind its hinge line.

    Parameters
    ----------
    bandwidth : Hz, of the differentiated rates; None: the vehicle's, else DEFAULT_BANDWIDTH.
    angular_acceleration : ``differentiated`` from p q r, ``logged`` as pdot qdot rdot as they are,
        or ``chosen`` by evidence (`choose_angular_accelerations`), at the bandwidth.

    Raises InputError where no axis can be computed, and where logged accelerations are missing.

    References
    ----------
    003, eqs. 1-4, with the two corrections of the module docstring.
    """
    notes: list[str] = []
    if len(flight.time) < FEWEST_SAMPLES:
        raise InputError(
            f"{len(flight.time)} samples are too few",
            f"flight {flight.id}",
            f"{FEWEST_SAMPLES} are needed",
        )
    band = bandwidth_of(flight, vehicle, bandwidth)
    constant = vehicle.reference.pressure
    if "qbar" not in flight and constant is None:
        what = "no dynamic pressure: no coefficient can be computed"
        raise InputError(what, f"flight {flight.id}", "log qbar, or airspeed and density")
    qbar = bridge(flight["qbar"]) if constant is None else np.full(len(flight.time), constant)
    if np.median(qbar) <= 0:
        raise InputError(
            "dynamic pressure is not positive", f"flight {flight.id}", "check the mapping of qbar"
        )
    # Division by a dynamic pressure near zero would overflow.
    qbar = np.where(np.abs(qbar) > STILL, qbar, 0.0)
    area, chord, span = vehicle.reference.area, vehicle.reference.chord, vehicle.reference.span
    # Only the lengths are used: the moment reference moves with the CG.
    geometry = ReferenceGeometry(area, chord, span, (0.0, 0.0, 0.0))
    properties = mass_channels(flight, vehicle)
    cg = cg_positions(flight, vehicle)
    reference = (
        cg
        if vehicle.points.moment_reference == "cg"
        else np.broadcast_to(vehicle.points.moment_reference, cg.shape)
    )
    rates = _rates(flight, vehicle, band, angular_acceleration, notes)
    force = _force_at_cg(flight, vehicle, rates, cg, notes)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(qbar > 0, 1.0 / (qbar * area), np.nan)
        noise = 0.0 if constant is not None else _noise(flight, vehicle, "qbar", band)
        qbar_fraction = noise / qbar
    thrust_force, thrust_moment = thrust_loads(flight, vehicle.thrust, cg, notes)
    values: dict[str, Array] = {}
    sigma: dict[str, Array] = {}
    if force is not None:
        forces, force_sigma = force
        aerodynamic = properties["mass"][:, None] * forces - thrust_force
        for k, axis in enumerate(FORCE_AXES):
            values[axis] = aerodynamic[:, k] * scale
            sigma[axis] = np.hypot(
                properties["mass"] * force_sigma[k] * scale, values[axis] * qbar_fraction
            )
    if rates is not None:
        moment = inertial_moment(rates.omega, rates.acceleration, properties) - thrust_moment
        for k, (axis, length) in enumerate(zip(MOMENT_AXES, (span, chord, span), strict=True)):
            values[axis] = moment[:, k] * scale / length
            inertia = properties[("Ixx", "Iyy", "Izz")[k]]
            sigma[axis] = np.hypot(
                inertia * rates.acceleration_sigma[k] * scale / length, values[axis] * qbar_fraction
            )
        if force is not None:
            values = dict(transfer_moments(values, cg, reference, geometry))
        elif vehicle.points.moment_reference != "cg":
            notes.append(
                "moments are about the CG: without specific force they cannot be moved to the"
                " moment reference"
            )
            reference = cg
    hinges = _hinge_moments(flight, vehicle, scale * area, qbar_fraction, notes)
    values |= {axis: value for axis, (value, _) in hinges.items()}
    sigma |= {axis: error for axis, (_, error) in hinges.items()}
    if not values:
        raise InputError(
            "no axis can be computed",
            f"flight {flight.id}",
            "specific force or body rates are needed",
        )
    usable = {
        axis: _usable(flight, axis, constant is None) & np.isfinite(values[axis])
        for axis in in_order(values)
    }
    share = thrust_share(flight, vehicle, np.asarray(reference))
    left_out: tuple[str, ...] = ()
    if share is not None:
        loaded = share.loaded(values)
        usable = {axis: u & share.known if axis in loaded else u for axis, u in usable.items()}
        if loaded and not share.known.any():
            left_out = loaded
            values = {axis: v for axis, v in values.items() if axis not in loaded}
            usable = {axis: usable[axis] for axis in values}
            notes.append(without_thrust(loaded))
        if not values:
            raise InputError(
                "every axis contains thrust, which is not logged",
                f"flight {flight.id}",
                THRUST_REMEDY,
            )
    limited = None if angular_acceleration == "logged" else band
    return Coefficients(
        flight.id,
        flight.time,
        values,
        {axis: sigma[axis] for axis in values},
        usable,
        np.asarray(reference),
        limited,
        tuple(notes),
        share,
        left_out,
    )


@dataclass(frozen=True)
class _Rates:
    """Body rates (n, 3) [rad/s], angular accelerations (n, 3) [rad/s2] and the standard deviation
    of the latter (3,)."""

    omega: Array
    acceleration: Array
    acceleration_sigma: Array


def _rates(
    flight: Flight, vehicle: Vehicle, band: float, source: RateSource, notes: list[str]
) -> _Rates | None:
    """Body rates and angular accelerations, with the standard deviation of the latter; None where a
    rate is not logged."""
    absent = [name for name in "pqr" if name not in flight]
    if absent:
        notes.append(f"no moments: {', '.join(absent)} not logged")
        return None
    smoothed = [
        smooth(flight[name], flight.step, band, _declared_noise(vehicle, name)) for name in "pqr"
    ]
    omega = np.column_stack([bridge(flight[name]) for name in "pqr"])
    if source == "chosen" and any(f"{name}dot" in flight for name in "pqr"):
        choice = choose_angular_accelerations(flight, band)
        if choice.because:
            notes.append(choice.because)
        if choice.source == "logged":
            return _Rates(omega, choice.acceleration, choice.sigma)
    logged = [f"{name}dot" for name in "pqr"]
    if source == "logged":
        lacking = [name for name in logged if name not in flight]
        if lacking:
            raise InputError(
                f"{', '.join(lacking)} not logged",
                f"flight {flight.id}",
                "use differentiated rates",
            )
        acceleration = np.column_stack([bridge(flight[name]) for name in logged])
        notes.append(
            "angular accelerations taken from the log; their noise taken as that of differentiated"
            " rates"
        )
    else:
        acceleration = np.column_stack([s.rate for s in smoothed])
        notes.append(f"angular accelerations: rates differentiated at a bandwidth of {band:g} Hz")
    return _Rates(omega, acceleration, np.array([s.rate_sigma for s in smoothed]))


def _force_at_cg(
    flight: Flight, vehicle: Vehicle, rates: _Rates | None, cg: Array, notes: list[str]
) -> tuple[Array, Array] | None:
    """Specific force at the CG (n, 3) [m/s2] and its standard deviation (3,); None where it is not
    logged."""
    band = 0.25 / flight.step
    if all(name in flight for name in ("ax", "ay", "az")):
        names = ("ax", "ay", "az")
        force = np.column_stack([bridge(flight[name]) for name in names])
        notes.append("specific force at the CG taken from the log")
        return force, np.array([_noise(flight, vehicle, name, band) for name in names])
    names = ("ax_imu", "ay_imu", "az_imu")
    absent = [name for name in names if name not in flight]
    if absent:
        notes.append(f"no forces: {', '.join(absent)} not logged")
        return None
    force = np.column_stack([bridge(flight[name]) for name in names])
    noise = np.array([_noise(flight, vehicle, name, band) for name in names])
    if vehicle.points.imu == "cg":
        return force, noise
    if rates is None:
        notes.append(
            "no forces: the accelerometer is off the CG and the body rates that move it there are"
            " not logged"
        )
        return None
    arm = np.asarray(vehicle.points.imu) - cg
    moved = specific_force_at_cg(force, rates.omega, rates.acceleration, arm)
    x, y, z = np.abs(arm).mean(axis=0)
    a, b, c = rates.acceleration_sigma
    lever = np.array([np.hypot(b * z, c * y), np.hypot(c * x, a * z), np.hypot(a * y, b * x)])
    return moved, np.hypot(noise, lever)


def _hinge_moments(
    flight: Flight, vehicle: Vehicle, over_qbar: Array, qbar_fraction: Array, notes: list[str]
) -> dict[str, tuple[Array, Array]]:
    """Axis -> coefficient of the hinge moment (n,) and its standard deviation (n,).

    over_qbar : (n,) [1/Pa], one over the pressure that coefficients are over. qbar_fraction : (n,)
    noise of that pressure as a share.
    """
    found = {}
    for channel_name in filter(hinge_surface, flight.channels):
        surface = hinge_surface(channel_name)
        hinge = vehicle.surfaces[surface].hinge if surface in vehicle.surfaces else None
        if hinge is None:
            notes.append(
                f"{channel_name} is logged and not used: state area and chord behind the hinge line"
                f" in [surfaces.{surface}.hinge] of the vehicle file"
            )
            continue
        axis, scale = hinge_moment_of(surface)[1], over_qbar / (hinge.area * hinge.chord)
        value = bridge(flight[channel_name]) * scale
        noise = _noise(flight, vehicle, channel_name, 0.25 / flight.step)
        found[axis] = value, np.hypot(noise * scale, value * qbar_fraction)
        notes.append(
            f"{axis} is of the moment as logged: friction of the control, and weight and inertia of"
            " the surface, are part of it"
        )
    return found


def _usable(flight: Flight, axis: str, over_qbar: bool) -> NDArray[np.bool_]:
    """(n,) where all channels that an axis is computed from are usable."""
    if is_hinge_axis(axis):
        return flight.usable(
            [*(("qbar",) if over_qbar else ()), hinge_moment_of(hinge_surface(axis))[0]]
        )
    wanted = [*(("qbar",) if over_qbar else ()), "p", "q", "r"]
    if axis in FORCE_AXES:
        letter = axis[1].lower()
        wanted += [name for name in (f"a{letter}", f"a{letter}_imu") if name in flight][:1]
    return flight.usable(name for name in wanted if name in flight)


def _declared_noise(vehicle: Vehicle, name: str) -> float | None:
    sensor = vehicle.sensors.get(name)
    return sensor.noise if sensor is not None and sensor.noise > 0 else None


def _noise(flight: Flight, vehicle: Vehicle, name: str, band: float) -> float:
    """Standard deviation of a channel's noise: declared in the vehicle file, else measured above
    the bandwidth."""
    declared = _declared_noise(vehicle, name)
    return declared if declared is not None else smooth(flight[name], flight.step, band).noise
