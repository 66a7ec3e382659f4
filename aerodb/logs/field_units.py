"""Unit of a field by the size of its values, and sizes that a channel cannot have."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.nomenclature import SHARES
from aerodb.support import Array


@dataclass(frozen=True)
class Sized:
    """A unit and its reason; the value is `scale` times the field in `unit`.

    assumed : whether the size of the values leaves other units open.
    """

    unit: str
    reason: str
    scale: float = 1.0
    assumed: bool = False


#: Largest size of an angle in radians that a full turn or less allows.
_TURN: Final = 6.3
#: Largest size of other angles in radians.
_ANGLE: Final = 1.6
#: Channel -> largest size [deg] in flight; a larger one may be another unit, as hundredths of it.
_DEGREES: Final = {"phi": 181.0, "psi": 361.0, "latitude": 90.0, "longitude": 180.0}
#: The same of other angles [deg].
_STEEP: Final = 90.0
#: The same of a rate [deg/s].
_FASTEST: Final = 400.0
#: Rates of most aircraft are slower [rad/s].
_SLOW: Final = 6.0
#: Rates of aerobatic models are slower [rad/s].
_RATE: Final = 20.0
#: Channel -> unit, and the sizes by which it is that. Celsius may be Fahrenheit.
_SIZES: Final = {
    "rho": (("slug/ft^3", 0.0, 0.01), ("kg/m^3", 0.01, 2.0)),
    "temperature": (("degC", 0.0, 100.0), ("K", 200.0, 340.0)),
    "static_pressure": (("Pa", 1e4, 1.2e5), ("hPa", 100.0, 1200.0), ("inHg", 3.0, 35.0)),
    "mach": (("1", 0.0, 8.0),),
    **dict.fromkeys(("throttle", *SHARES), (("1", 0.0, 1.01), ("percent", 1.01, 110.0))),
}
#: Channel -> unit, and the sizes up to which values of that unit in flight may be those of
#: another: of psi, of kPa or mmHg, of lb/ft^3.
_MIXED: Final = {
    "static_pressure": {"inHg": 16.0, "hPa": 800.0},
    "rho": {"kg/m^3": 0.09},
}
#: Standard gravity [m/s^2].
_GRAVITY: Final = 9.80665
#: MAVLink and ArduPilot write latitude and longitude as whole numbers of 1e-7 deg.
_MAVLINK: Final = 1e-7
#: Channel -> least and largest believable value, SI: beyond it unit or meaning are asked.
_BELIEVABLE: Final[dict[str, tuple[float, float]]] = {
    **{"V": (-5.0, 1000.0), "calibrated_airspeed": (-5.0, 700.0), "mach": (-0.1, 8.0)},
    **dict.fromkeys(("alpha", "beta", "theta"), (-3.2, 3.2)),
    **dict.fromkeys(("phi", "psi"), (-60.0, 60.0)),
    **dict.fromkeys(("p", "q", "r"), (-25.0, 25.0)),
    **dict.fromkeys(("ax_imu", "ay_imu", "az_imu"), (-300.0, 300.0)),
    **{"altitude": (-500.0, 40000.0), "height_above_ground": (-100.0, 40000.0)},
    **{"latitude": (-1.58, 1.58), "longitude": (-6.3, 6.3)},
    **dict.fromkeys(("velocity_north", "velocity_east"), (-1000.0, 1000.0)),
    **{"velocity_down": (-300.0, 300.0), "temperature": (180.0, 340.0)},
    **{"static_pressure": (200.0, 115000.0), "qbar": (-500.0, 300000.0), "rho": (0.003, 1.6)},
}
#: Angle of the airflow that few wings hold for half of a flight [rad]: 25 deg, beyond most stalls.
#: Gauges named after it show shares of the stall, or per cents.
_HELD: Final = 0.44
#: Specific force along x or y that no aeroplane holds for half of a flight [g]; an axis that points
#: up shows 1 g.
_SIDEWAYS: Final = 0.5
#: Largest believable deflection of a surface [rad]: of 60 deg. Servo pulses and per cents are more.
_DEFLECTION: Final = 1.05


def unit_by_size(channel: str, si: str, size: float, values: Array) -> Sized:
    """Return the unit that the size of values (n,) decides, else the likeliest, as assumed.

    size : 99th percentile of their sizes.
    """
    if si == "rad":
        most = _TURN if channel in ("phi", "psi", "longitude") else _ANGLE
        if channel in ("latitude", "longitude") and 1e6 < size <= 180.0 / _MAVLINK:
            return Sized("deg", f"up to {size:.4g}: whole numbers of 1e-7 deg", _MAVLINK)
        if size > most:
            is_share = channel.startswith("delta_")  # of full travel, in per cent
            return Sized(
                "deg",
                f"up to {size:.4g}: too large for rad",
                assumed=is_share or size > _DEGREES.get(channel, _STEEP),
            )
    if si == "rad/s" and size > _SLOW:
        too_large = f"up to {size:.4g}: too large for rad/s"
        counts = bool(np.all(values[np.isfinite(values)] % 1.0 == 0.0))  # of a sensor
        return Sized("deg/s", too_large, assumed=counts or not _RATE <= size <= _FASTEST)
    if channel == "az_imu":
        level = abs(float(np.nanmedian(values)))
        for unit, of in (("m/s^2", _GRAVITY), ("g", 1.0), ("ft/s^2", 32.2)):
            if 0.7 * of < level < 1.3 * of:
                return Sized(unit, f"about {level:.3g} in level flight")
    for unit, low, high in _SIZES.get(channel, ()):
        if low < size < high:
            mixed = unit == "degC" or size < _MIXED.get(channel, {}).get(unit, 0.0)
            return Sized(unit, f"up to {size:.4g}", assumed=mixed)
    why = f"assumed: neither log nor name says so, and values up to {size:.3g} allow other units"
    return Sized(si or "1", why, assumed=True)


def believable(channel: str, values: Array) -> str:
    """Return what speaks against values (n,), SI, of a channel, '' for nothing.

    >>> believable("temperature", np.array([15.0, 16.0]))
    '15.01 to 15.99 (SI) is not believable'
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ""
    low, high = (float(each) for each in np.percentile(finite, (1.0, 99.0)))
    limits = _BELIEVABLE.get(channel)
    if channel.startswith("delta_") and channel != "delta_landing_gear":
        limits = (-_DEFLECTION, _DEFLECTION)
    if limits is not None and not (limits[0] <= low and high <= limits[1]):
        return f"{low:.4g} to {high:.4g} (SI) is not believable"
    if channel == "az_imu" and not 0.5 * _GRAVITY < abs(float(np.median(finite))) < 2 * _GRAVITY:
        return f"a median of {float(np.median(finite)):.3g} m/s^2 is no level flight"
    if channel in ("ax_imu", "ay_imu") and abs(float(np.median(finite))) > _SIDEWAYS * _GRAVITY:
        return f"a median of {float(np.median(finite)):.3g} m/s^2 is that of an axis up or down"
    if channel in ("alpha", "beta") and abs(float(np.median(finite))) > _HELD:
        return f"a median of {np.rad2deg(float(np.median(finite))):.3g} deg is not believable"
    return ""
