from .atmosphere import (
    DENSITY_0,
    GAS_CONSTANT,
    GRAVITY,
    HEAT_RATIO,
    LAYER,
    STANDARD_LAYERS,
    density,
    mach_from_calibrated,
    speed_of_sound,
    standard_atmosphere,
)
from .frames import euler_321_from_enu_quaternion, euler_321_from_quaternion
from .geodesy import (
    EARTH_RATE,
    HIGHEST_LATITUDE,
    PLUMB_LINE_CURVATURE,
    Earth,
    normal_gravity,
    radii_of_curvature,
)

__all__ = [
    "DENSITY_0",
    "EARTH_RATE",
    "GAS_CONSTANT",
    "GRAVITY",
    "HEAT_RATIO",
    "HIGHEST_LATITUDE",
    "LAYER",
    "PLUMB_LINE_CURVATURE",
    "STANDARD_LAYERS",
    "Earth",
    "density",
    "euler_321_from_enu_quaternion",
    "euler_321_from_quaternion",
    "mach_from_calibrated",
    "normal_gravity",
    "radii_of_curvature",
    "speed_of_sound",
    "standard_atmosphere",
]
