"""WGS-84 earth: radii of curvature, normal gravity, and positions in metres from a local origin.

The functions take numbers or arrays, and compiled code may call them (`register_jitable` there):
who needs one number need not wait for a compiler. Latitude is geodetic [rad], height is above the
ellipsoid [m]. Sources: NIMA TR8350.2 (2000), chapters 3 and 4; Groves, *Principles of GNSS,
Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed. (2013), section 2.4.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array

SEMI_MAJOR: Final = 6378137.0  # m
FLATTENING: Final = 1.0 / 298.257223563
ECCENTRICITY_SQUARED: Final = FLATTENING * (2.0 - FLATTENING)
EARTH_RATE: Final = 7.292115e-5  # rad/s
GRAVITATION: Final = 3.986004418e14  # m3/s2
#: Gravity on the ellipsoid at the equator [m/s^2].
_EQUATOR = 9.7803253359
#: Constant k of Somigliana's formula.
_SOMIGLIANA = 0.00193185265241
#: m = omega^2 a^2 b / GM, the ratio of centrifugal acceleration to gravitation at the equator.
_RATIO: Final = EARTH_RATE**2 * SEMI_MAJOR**3 * (1.0 - FLATTENING) / GRAVITATION
#: Curvature of the plumb line: gravity has a northward component of this times height times
#: sin(2 latitude), 1/s2 (Groves, eq. 2.140).
PLUMB_LINE_CURVATURE: Final = -8.08e-9

#: Largest absolute latitude of a local origin [rad]: north and east are undefined at the poles.
HIGHEST_LATITUDE: Final = float(np.deg2rad(89.0))


@dataclass(frozen=True)
class Earth:
    """A rotating oblate earth with a local origin.

    North and east are differences of latitude and longitude, scaled to metres at the origin: a path
    that returns to a place returns to the same numbers.

    Parameters
    ----------
    latitude, longitude : geodetic, of the point where north = east = 0, rad
    height : above the ellipsoid, of altitude zero there, m: the undulation of the geoid when
        altitudes are above mean sea level

    Raises InputError within one degree of a pole.
    """

    latitude: float
    longitude: float = 0.0
    height: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.latitude) < HIGHEST_LATITUDE:
            raise InputError(
                f"latitude of {np.rad2deg(self.latitude):.1f} deg is too close to a pole",
                "local origin",
                "choose an origin at least one degree from the poles; latitude is in radians",
            )

    @property
    def metres_per_radian(self) -> tuple[float, float]:
        """Metres per radian [m/rad], scalars, of latitude and of longitude at the origin."""
        radii = radii_of_curvature(self.latitude)
        to_east = (radii.normal + self.height) * np.cos(self.latitude)
        return float(radii.meridian + self.height), float(to_east)

    def to_local(self, latitude: Array, longitude: Array) -> tuple[Array, Array]:
        """Return north and east [m] of positions [rad], each (n,); longitudes may pass 180 deg."""
        to_north, to_east = self.metres_per_radian
        turn = np.remainder(longitude - self.longitude + np.pi, 2.0 * np.pi) - np.pi
        return (latitude - self.latitude) * to_north, turn * to_east


class CurvatureRadii(NamedTuple):
    """Radii of curvature of the ellipsoid; a named tuple, which compiled functions can return.

    meridian, normal : radii in the meridian and across it (prime vertical), m
    meridian_by_latitude, normal_by_latitude : their derivatives, m/rad
    """

    meridian: float
    normal: float
    meridian_by_latitude: float
    normal_by_latitude: float


class NormalGravity(NamedTuple):
    """Normal gravity and its derivatives; a named tuple, which compiled functions can return.

    gravity : along the ellipsoid's normal, positive down, m/s2
    by_latitude, by_height : its derivatives, m/s2 per rad and 1/s2
    north_by_height : derivative by height of the northward component, which is zero at the
        ellipsoid, 1/s2
    """

    gravity: float
    by_latitude: float
    by_height: float
    north_by_height: float


def radii_of_curvature(latitude: float) -> CurvatureRadii:
    """Return the radii of curvature of the ellipsoid and their derivatives by latitude.

    Parameters
    ----------
    latitude : geodetic, rad

    References
    ----------
    Groves (2013), eqs. 2.105-2.106.
    """
    s, c = np.sin(latitude), np.cos(latitude)
    square = 1.0 - ECCENTRICITY_SQUARED * s * s
    normal = SEMI_MAJOR / np.sqrt(square)
    meridian = normal * (1.0 - ECCENTRICITY_SQUARED) / square
    growth = ECCENTRICITY_SQUARED * s * c / square
    return CurvatureRadii(meridian, normal, 3.0 * growth * meridian, growth * normal)


def normal_gravity(latitude: float, height: float) -> NormalGravity:
    """Return normal gravity and its derivatives by latitude and height.

    Somigliana's formula at the ellipsoid and its second-order expansion in height.

    Parameters
    ----------
    latitude : geodetic, rad
    height : above the ellipsoid, m

    References
    ----------
    NIMA TR8350.2 (2000), eqs. 4-1 and 4-3; Groves (2013), eq. 2.140.
    """
    s, c = np.sin(latitude), np.cos(latitude)
    square = 1.0 - ECCENTRICITY_SQUARED * s * s
    ground = _EQUATOR * (1.0 + _SOMIGLIANA * s * s) / np.sqrt(square)
    by_latitude = (
        2.0 * _EQUATOR * _SOMIGLIANA * s * c / np.sqrt(square)
        + ground * ECCENTRICITY_SQUARED * s * c / square
    )
    fall = -2.0 / SEMI_MAJOR * (1.0 + FLATTENING + _RATIO - 2.0 * FLATTENING * s * s)
    bend = 3.0 / SEMI_MAJOR**2
    share = 1.0 + (fall + bend * height) * height
    turn = 8.0 * FLATTENING * s * c * height / SEMI_MAJOR
    return NormalGravity(
        ground * share,
        by_latitude * share + ground * turn,
        ground * (fall + 2.0 * bend * height),
        PLUMB_LINE_CURVATURE * np.sin(2.0 * latitude),
    )
