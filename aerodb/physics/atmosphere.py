"""ICAO standard atmosphere, and relations between density, pressure, Mach number and airspeed.

All functions take and return arrays of one shape (or numbers) in SI. Which relation fills which
missing channel of a flight is decided in `aerodb.logs.air_data`.
"""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from aerodb.support import Array

GRAVITY: Final = 9.80665
GAS_CONSTANT: Final = 287.05287  # J/(kg K), dry air, ICAO Doc 7488
HEAT_RATIO: Final = 1.4
#: Static pressure of the standard atmosphere at sea level [Pa].
PRESSURE_0 = 101325.0
#: Temperature of the standard atmosphere at sea level [K].
TEMPERATURE_0 = 288.15
DENSITY_0: Final = PRESSURE_0 / (GAS_CONSTANT * TEMPERATURE_0)
SOUND_0: Final = float(np.sqrt(HEAT_RATIO * GAS_CONSTANT * TEMPERATURE_0))
#: Layers of ICAO Doc 7488: geopotential altitude of the base [m] and temperature gradient [K/m].
_GRADIENTS: Final = (
    (-5000.0, -0.0065),
    (11000.0, 0.0),
    (20000.0, 0.001),
    (32000.0, 0.0028),
    (47000.0, 0.0),
    (51000.0, -0.0028),
)
TOP: Final = 71000.0


class _Layer(NamedTuple):
    """A layer from `bottom` to `top` [m], its `gradient` [K/m], and the state of the air at its
    `base_altitude` [m]: temperature [K] and pressure [Pa].

    The base is the bottom; that of the lowest layer is sea level.
    """

    bottom: float
    top: float
    gradient: float
    base_altitude: float
    base_temperature: float
    base_pressure: float


def _pressure_ratio(base_temperature: float, gradient: float, rise: Array) -> Array:
    """Return pressure over that at the layer's base, `rise` [m] above it.

    Hydrostatic equation of a perfect gas; temperature [K], gradient [K/m].
    """
    if gradient == 0.0:
        return np.asarray(np.exp(-GRAVITY * rise / (GAS_CONSTANT * base_temperature)))
    return np.asarray(
        (1.0 + gradient * rise / base_temperature) ** (-GRAVITY / (GAS_CONSTANT * gradient))
    )


def _layers() -> tuple[_Layer, ...]:
    """Return the layers, with the state at each base from the layer below."""
    layers, altitude, temperature, pressure = [], 0.0, TEMPERATURE_0, PRESSURE_0
    tops = [bottom for bottom, _ in _GRADIENTS[1:]] + [TOP]
    for (bottom, gradient), top in zip(_GRADIENTS, tops, strict=True):
        layers.append(_Layer(bottom, top, gradient, altitude, temperature, pressure))
        rise = top - altitude
        pressure = float(pressure * _pressure_ratio(temperature, gradient, np.asarray(rise)))
        altitude, temperature = top, temperature + gradient * rise
    return tuple(layers)


_LAYERS: Final = _layers()
#: The layers as rows for compiled loops, and the column of each field in them.
STANDARD_LAYERS: Final = np.array(_LAYERS)
LAYER: Final[Any] = _Layer(*range(len(_Layer._fields)))


@dataclass(frozen=True)
class Air:
    """State of the air: pressure [Pa], temperature [K], density [kg/m3]."""

    pressure: Array
    temperature: Array
    density: Array


def standard_atmosphere(altitude: ArrayLike) -> Air:
    """Return the state of the ICAO standard atmosphere at an altitude.

    Below 11 km ``T = 288.15 - 0.0065 h`` and ``p = 101325 (T / 288.15)^5.2559``.

    Parameters
    ----------
    altitude : any shape, geopotential altitude from -5000 to 71000, m

    Returns
    -------
    Air of the same shape; nan outside the altitude range

    References
    ----------
    ICAO Doc 7488/3, Manual of the ICAO Standard Atmosphere, 3rd ed. (1993).

    >>> round(float(standard_atmosphere(11000.0).temperature), 6)
    216.65
    """
    h = np.asarray(altitude, dtype=np.float64)
    temperature, pressure = np.full(h.shape, np.nan), np.full(h.shape, np.nan)
    for layer in _LAYERS:
        inside = (h >= layer.bottom) & (h <= layer.top)
        if not np.count_nonzero(inside):
            continue
        rise = h[inside] - layer.base_altitude
        temperature[inside] = layer.base_temperature + layer.gradient * rise
        pressure[inside] = layer.base_pressure * _pressure_ratio(
            layer.base_temperature, layer.gradient, rise
        )
    return Air(pressure, temperature, pressure / (GAS_CONSTANT * temperature))


def density(pressure: Array, temperature: Array) -> Array:
    """Return the density of dry air [kg/m3], ``p / (R T)``.

    Parameters
    ----------
    pressure : any shape, static pressure, Pa
    temperature : same shape, static temperature, K
    """
    return np.asarray(pressure / (GAS_CONSTANT * temperature))


def speed_of_sound(temperature: Array) -> Array:
    """Return the speed of sound [m/s] at static `temperature` [K], ``sqrt(1.4 R T)``."""
    return np.asarray(np.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature))


def mach_from_calibrated(calibrated_airspeed: Array, static_pressure: Array) -> Array:
    """Return the subsonic Mach number from calibrated airspeed and static pressure.

    Calibrated airspeed gives the impact pressure ``qc = p0 ((1 + 0.2 (CAS/a0)^2)^3.5 - 1)``, and
    this gives ``M^2 = 5 ((qc/p + 1)^(2/7) - 1)``.

    Parameters
    ----------
    calibrated_airspeed : any shape, m/s
    static_pressure : same shape, Pa

    References
    ----------
    Anderson, *Fundamentals of Aerodynamics*, sec. 8.7.
    """
    impact = PRESSURE_0 * ((1.0 + 0.2 * (calibrated_airspeed / SOUND_0) ** 2) ** 3.5 - 1.0)
    return np.asarray(np.sqrt(5.0 * ((impact / static_pressure + 1.0) ** (2.0 / 7.0) - 1.0)))
