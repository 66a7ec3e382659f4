from .atmosphere import (
    DENSITY_0,
    GRAVITY,
    density,
    mach_from_calibrated,
    speed_of_sound,
    standard_atmosphere,
)
from .frames import euler_321_from_enu_quaternion, euler_321_from_quaternion
from .geodesy import PLUMB, RATE, Earth, curvature, normal_gravity

__all__ = [
    "DENSITY_0",
    "GRAVITY",
    "PLUMB",
    "RATE",
    "Earth",
    "curvature",
    "density",
    "euler_321_from_enu_quaternion",
    "euler_321_from_quaternion",
    "mach_from_calibrated",
    "normal_gravity",
    "speed_of_sound",
    "standard_atmosphere",
]
