"""Correct air data for errors of the static and total ports and of a five-hole probe's calibration.

These are the models of `sensors.models` solved for the true quantities. The module also recognises
flow angles and densities that were computed from logged pressures.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.consistency.reconstructed import ReconstructedPath
from aerodb.flight import Flight
from aerodb.physics import GRAVITY, density
from aerodb.support import Array
from aerodb.vehicle import AirData, Curve, FiveHole, Vehicle, angles_from_pressures

#: Pressure difference of a pair of holes -> the flow angle that it measures.
HOLES: Final = {"probe_dp_alpha": "alpha", "probe_dp_beta": "beta"}

#: Parameters of the pressure ports.
PORTS: Final = ("static_port_error", "static_port_offset", "total_port_error")

#: Angles that agree to this median difference were computed from the same pressures [rad].
_ALIKE = 1e-3
#: Number of samples compared.
_ENOUGH = 2000

#: Densities that agree to this relative difference were computed from the same static pressure.
_SAME = 1e-6


def angles_from_holes(flight: Flight, vehicle: Vehicle, shown: Mapping[str, Array]) -> bool:
    """Return whether alpha and beta of a flight were computed from logged five-hole probe
    pressures.

    shown : channel -> (n,), V [m/s], alpha, beta [rad] at the air-data point. False when the
    vehicle file gives no calibration.
    """
    known = all(name in flight for name in (*HOLES, "qbar", "rho", "V"))
    if vehicle.air_data.five_hole is None or not known or not {"alpha", "beta"} <= set(shown):
        return False
    told = [each.channel for each in vehicle.air_data.configurations]
    some = slice(None, None, max(1, len(flight.time) // _ENOUGH))
    thin = Flight(
        flight.id,
        flight.vehicle,
        flight.time[some],
        {name: flight[name][some] for name in (*HOLES, "qbar", *told) if name in flight},
    )
    off = np.abs(
        [
            angle - shown[name][some]
            for name, angle in angles_from_pressures(thin, vehicle.air_data).items()
        ]
    )
    off = off[:, np.isfinite(off).all(axis=0)]
    return off.size > 0 and bool(np.median(off) < _ALIKE)


def recalibrated(probe: AirData, values: Mapping[str, float]) -> AirData:
    """The probe with its calibration, of every configuration, corrected by the estimated `values`
    (name -> value, SI).

    Parameters are those of `known_names` that begin with ``probe_``; a probe without calibration
    stays.
    """
    return probe.model_copy(
        update={
            "five_hole": _corrected(probe.five_hole, values),
            "configurations": [
                each.model_copy(update={"five_hole": _corrected(each.five_hole, values)})
                for each in probe.configurations
            ],
        }
    )


def _corrected(probe: FiveHole | None, values: Mapping[str, float]) -> FiveHole | None:
    if probe is None:
        return None
    pairs = {
        name: _curve(getattr(probe, name), f"probe_{name}", values) for name in ("alpha", "beta")
    }
    return FiveHole(**pairs)


def _curve(declared: Curve, name: str, values: Mapping[str, float]) -> Curve:
    gain = 1.0 + values.get(f"{name}_slope", 0.0)
    shape = {
        part: (value + values.get(f"{name}_{part.removesuffix('_below')}", 0.0)) / gain
        for part in ("offset", "square", "across", "cross", "bend", "bend_below")
        if (value := getattr(declared, part)) is not None
    }
    return declared.model_copy(update={"slope": declared.slope * gain, **shape})


def static_pressure(flight: Flight) -> Array | None:
    """(n,) measured static pressure [Pa] if the density was computed from it; otherwise None."""
    if not all(name in flight for name in ("rho", "static_pressure", "temperature")):
        return None
    computed = density(flight["static_pressure"], flight["temperature"])
    good = np.isfinite(computed) & np.isfinite(flight["rho"])
    alike = good.any() and np.median(np.abs(flight["rho"][good] / computed[good] - 1.0)) < _SAME
    return flight["static_pressure"] if alike else None


@dataclass(frozen=True)
class PortCorrected:
    """Air data corrected for port errors, (n,) each, at the air-data point.

    V : true airspeed [m/s]. q : dynamic pressure [Pa]. rho : density [kg/m3]. excess : pressure at
    the static port minus static pressure [Pa].
    """

    V: Array
    q: Array
    rho: Array
    excess: Array


def correct_port_errors(
    speed: Array, rho: Array, pressure: Array | None, values: Mapping[str, float]
) -> PortCorrected:
    """Airspeed, dynamic pressure and density corrected for errors of the pressure ports.

    ``q = (q_m + o_s) / (1 + e_t - e_s)``, ``p = p_m - e_s q - o_s`` (003, eq. 5).

    Parameters
    ----------
    speed : (n,), measured true airspeed at the air-data point [m/s].
    rho : (n,), density used for it [kg/m3].
    pressure : (n,), measured static pressure that the density was computed from [Pa]; None: the
        density is correct.
    values : port parameters (`PORTS`) -> value, SI; absent ones are zero.

    >>> port = {"static_port_error": 0.19}
    >>> air = correct_port_errors(np.array([60.0]), np.array([1.0]), None, port)
    >>> round(float(air.V[0]), 3)
    66.667
    """
    error, offset = values.get("static_port_error", 0.0), values.get("static_port_offset", 0.0)
    q = (0.5 * rho * speed**2 + offset) / (1.0 + values.get("total_port_error", 0.0) - error)
    excess = error * q + offset
    true = rho if pressure is None else rho * (1.0 - excess / pressure)
    return PortCorrected(np.sqrt(np.maximum(2.0 * q / true, 0.0)), q, true, excess)


def correct_pressure_altitude(shown: Array, air: PortCorrected) -> Array:
    """(n,) pressure altitude [m] corrected for the static port, whose excess pressure lowers it by
    ``excess / (rho g)``."""
    return np.asarray(shown + air.excess / (air.rho * GRAVITY))


def residuals_as_angles(path: ReconstructedPath) -> ReconstructedPath:
    """The path with residuals (n,) of five-hole probe pressures [Pa] converted to alpha and beta
    [rad]."""
    record, probe = path.record, path.record.installation.five_hole
    if probe is None or record.density is None or not set(HOLES) & set(path.residuals):
        return path
    q = 0.5 * record.density * path.V**2
    sizes = {name: q * getattr(probe, angle).slope for name, angle in HOLES.items()}

    def turned(residuals: Mapping[str, Array]) -> dict[str, Array]:
        return {
            HOLES.get(name, name): values / sizes[name] if name in HOLES else values
            for name, values in residuals.items()
        }

    return replace(path, residuals=turned(path.residuals), before=turned(path.before))
