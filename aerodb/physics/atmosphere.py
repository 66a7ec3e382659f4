"""The atmosphere: ICAO standard atmosphere, and the relations between density, pressure, Mach
number and airspeeds.

All functions take and give arrays of one shape (or numbers), SI. Which relation fills which missing
channel of a flight is decided in `air_data`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from aerodb.support import Array

GRAVITY: Final = 9.80665
GAS_CONSTANT: Final = 287.05287  # J/(kg K), dry air, ICAO Doc 7488
HEAT_RATIO: Final = 1.4
PRESSURE_0, TEMPERATURE_0 = 101325.0, 288.15
DENSITY_0: Final = PRESSURE_0 / (GAS_CONSTANT * TEMPERATURE_0)
SOUND_0: Final = float(np.sqrt(HEAT_RATIO * GAS_CONSTANT * TEMPERATURE_0))
#: Layers of ICAO Doc 7488: geopotential altitude of the base [m] and temperature gradient [K/m].
_LAYERS: Final = (
    (-5000.0, -0.0065),
    (11000.0, 0.0),
    (20000.0, 0.001),
    (32000.0, 0.0028),
    (47000.0, 0.0),
    (51000.0, -0.0028),
)
TOP: Final = 71000.0


@dataclass(frozen=True)
class Air:
    """State of the air: pressure [Pa], temperature [K], density [kg/m3]."""

    pressure: Array
    temperature: Array
    density: Array


def standard_atmosphere(altitude: ArrayLike) -> Air:
    """The ICAO standard atmosphere at geopotential `altitude` [m], any shape, -5 to 71 km; nan
    outside.

    Below 11 km ``T = 288.15 - 0.0065 h`` and ``p = 101325 (T / 288.15)^5.2559``; ICAO Doc 7488/3
    (1993).

    >>> round(float(standard_atmosphere(11000.0).temperature), 6)
    216.65
    """
    h = np.asarray(altitude, dtype=np.float64)
    temperature, pressure = np.full(h.shape, np.nan), np.full(h.shape, np.nan)
    base_t, base_p, base_h = TEMPERATURE_0, PRESSURE_0, 0.0
    for number, (bottom, gradient) in enumerate(_LAYERS):
        top = _LAYERS[number + 1][0] if number + 1 < len(_LAYERS) else TOP
        inside = (h >= bottom) & (h <= top)
        rise = h[inside] - base_h
        temperature[inside] = base_t + gradient * rise
        pressure[inside] = base_p * _pressure_ratio(base_t, gradient, rise)
        base_p = float(base_p * _pressure_ratio(base_t, gradient, np.asarray(top - base_h)))
        base_t, base_h = base_t + gradient * (top - base_h), top
    return Air(pressure, temperature, pressure / (GAS_CONSTANT * temperature))


def _pressure_ratio(base_temperature: float, gradient: float, rise: Array) -> Array:
    """p over p at the layer's base, `rise` [m] above it (hydrostatic equation of a perfect gas)."""
    if gradient == 0.0:
        return np.asarray(np.exp(-GRAVITY * rise / (GAS_CONSTANT * base_temperature)))
    return np.asarray(
        (1.0 + gradient * rise / base_temperature) ** (-GRAVITY / (GAS_CONSTANT * gradient))
    )


def density(pressure: Array, temperature: Array) -> Array:
    """Density [kg/m3] of dry air from static pressure [Pa] and static temperature [K]: ``p / (R
    T)``."""
    return np.asarray(pressure / (GAS_CONSTANT * temperature))


def speed_of_sound(temperature: Array) -> Array:
    """Speed of sound [m/s] at static `temperature` [K]: ``sqrt(1.4 R T)``."""
    return np.asarray(np.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature))


def mach_from_calibrated(calibrated_airspeed: Array, static_pressure: Array) -> Array:
    """Mach number (subsonic) from calibrated airspeed [m/s] and static pressure [Pa].

    The pitot tube's impact pressure ``qc = p0 ((1 + 0.2 (CAS/a0)^2)^3.5 - 1)`` is the same at both
    ends: ``M^2 = 5 ((qc/p + 1)^(2/7) - 1)``. Anderson, *Fundamentals of Aerodynamics*, sec. 8.7.
    """
    impact = PRESSURE_0 * ((1.0 + 0.2 * (calibrated_airspeed / SOUND_0) ** 2) ** 3.5 - 1.0)
    return np.asarray(np.sqrt(5.0 * ((impact / static_pressure + 1.0) ** (2.0 / 7.0) - 1.0)))
