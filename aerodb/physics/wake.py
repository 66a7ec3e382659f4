"""Wake of an aircraft: a pair of counter-rotating vortices, frozen in the air.

The axis of the pair is a straight line: a point of it, the heading of the aircraft that made it,
and its slope. Between the vortices the air goes down. The velocity about one vortex of the
circulation G and the core radius rc, at the distance r, is

- Lamb-Oseen: ``G/(2 pi r) (1 - exp(-1.2544 r^2/rc^2))``,
- Burnham-Hallock: ``G/(2 pi) r/(rc^2 + r^2)``.

Both have the circulation G far away; at ``r = rc`` they have 0.715 and 0.5 of ``G/(2 pi rc)``.

References
----------
Lamb, Hydrodynamics (1932), article 334a; Burnham & Hallock, FAA-RD-79-103 (1982); Fischenberg, AIAA
2002-4484, for the pair identified in flight.
"""

from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import numpy as np

from aerodb.physics.frames import to_body, to_earth
from aerodb.support import Array

Core = Literal["lamb_oseen", "burnham_hallock"]
CORES: Final[tuple[Core, ...]] = get_args(Core)
#: Exponent that puts the greatest velocity of Lamb-Oseen's vortex at the core radius.
LAMB_OSEEN_EXPONENT: Final = 1.2544


@dataclass(frozen=True)
class VortexPair:
    """A wake.

    Parameters
    ----------
    circulation : G [m2/s]. core_radius : rc [m]. spacing : of the vortices [m].
    place : north, east [m] and altitude [m] of a point of the axis between them.
    heading : of the aircraft that made it [rad]. slope : of the axis, upwards ahead [rad].
    core : which of `CORES`.
    """

    circulation: float
    core_radius: float
    spacing: float
    place: tuple[float, float, float]
    heading: float
    slope: float = 0.0
    core: Core = "burnham_hallock"

    def across(self, points: Array) -> tuple[Array, Array]:
        """Return where points (3, n) north, east, altitude [m] lie across the axis: to the right
        (n,) and below (n,) [m]."""
        right, below = self._axes()
        away = points - np.array(self.place)[:, None]
        away[2] *= -1.0
        return right @ away, below @ away

    def nearest(self, points: Array) -> float:
        """Return the least distance [m] of points (3, n) [m] from either vortex."""
        y, z = self.across(points)
        return float(np.hypot(np.abs(y) - 0.5 * self.spacing, z).min())

    def along(self, track: float) -> "VortexPair":
        """Return the pair in axes [m] of which the first points along a track [rad from north].

        >>> pair = VortexPair(200.0, 1.0, 30.0, (0.0, 50.0, 900.0), np.pi / 2)
        >>> turned = pair.along(np.pi / 2)
        >>> tuple(round(value, 9) for value in (*turned.place, turned.heading))
        (50.0, 0.0, 900.0, 0.0)
        """
        (north, east, up), cos, sin = self.place, float(np.cos(track)), float(np.sin(track))
        heading = float(np.angle(np.exp(1j * (self.heading - track))))
        place = (cos * north + sin * east, cos * east - sin * north, up)
        return replace(self, place=place, heading=heading)

    def velocity(self, points: Array) -> Array:
        """Return the velocity of the air (3, n) [m/s] north, east, down at points (3, n): north,
        east, altitude [m]."""
        y, z = self.across(points)
        right, below = np.zeros_like(y), np.zeros_like(z)
        for side in (-1.0, 1.0):
            # Seen from behind, the right vortex turns against the clock: at its left the air sinks.
            dy = y - 0.5 * side * self.spacing
            over = side * self.circulation / (2.0 * np.pi) * self._over_square(dy * dy + z * z)
            right, below = right + over * z, below - over * dy
        to_right, to_below = self._axes()
        return np.asarray(to_right[:, None] * right + to_below[:, None] * below)

    def _over_square(self, square: Array) -> Array:
        """Velocity over (G/2 pi) and over r, by the square of r."""
        if self.core == "burnham_hallock":
            return np.asarray(1.0 / (self.core_radius**2 + square))
        square = np.maximum(square, 1e-12 * self.core_radius**2)
        return np.asarray(-np.expm1(-LAMB_OSEEN_EXPONENT * square / self.core_radius**2) / square)

    def _axes(self) -> tuple[Array, Array]:
        """Unit vectors north, east, down across the axis: to the right, and below."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        up, flat = np.sin(self.slope), np.cos(self.slope)
        return np.array([-s, c, 0.0]), np.array([c * up, s * up, flat])


def air_at_stations(
    pair: VortexPair, place: Array, attitude: Array, span: float
) -> dict[str, Array]:
    """Return gust (n,) [m/s] and rotation (n,) [rad/s] of the air, body axes, that an aircraft
    without parts feels in a wake, as gust_u ... gust_r.

    Parameters
    ----------
    place : (3, n) north, east, altitude of the CG [m].
    attitude : quaternion (4, n), body to earth.
    span : [m].

    Stations are along the span, weighted like an elliptic wing, and along the fuselage from half a
    span behind the CG to a quarter before it. The gust is the mean over the wing of u and w, and
    that along the fuselage of v. p and r are the slopes of w and u over the span, q that of w along
    the fuselage, in least squares.
    """
    lateral = 0.5 * span * np.sin(0.5 * np.pi * np.linspace(-0.95, 0.95, _STATIONS))
    ahead = span * np.linspace(-0.5, 0.25, _STATIONS)
    weight = np.sqrt(1.0 - (2.0 * lateral / span) ** 2) * np.gradient(lateral)
    weight /= weight.sum()

    def air(x: float, y: float) -> Array:
        arm = np.broadcast_to(np.array([[x], [y], [0.0]]), place.shape)
        offset = to_earth(attitude, arm)
        points = place + np.stack([offset[0], offset[1], -offset[2]])
        return to_body(attitude, pair.velocity(points))

    wing = np.stack([air(0.0, y) for y in lateral])  # station, axis, sample
    body = np.stack([air(x, 0.0) for x in ahead])
    mean, along = np.einsum("s,san->an", weight, wing), body.mean(axis=0)
    by_y = np.einsum("s,san->an", weight * lateral, wing) / (weight @ lateral**2)
    from_mean = ahead - ahead.mean()
    by_x = np.einsum("s,san->an", from_mean, body) / (from_mean @ from_mean)
    return {
        "gust_u": mean[0], "gust_v": along[1], "gust_w": mean[2],
        "gust_p": by_y[2], "gust_q": -by_x[2], "gust_r": -by_y[0],
    }  # fmt: skip


def air_at_centre(pair: VortexPair, place: Array, attitude: Array) -> dict[str, Array]:
    """Return the gust (n,) [m/s] of `air_at_stations` at the CG alone: what V, alpha and beta show
    of a wake whose other velocities the parts of an aircraft feel at their own places."""
    air = to_body(attitude, pair.velocity(place))
    return dict(zip(("gust_u", "gust_v", "gust_w"), air, strict=True))


#: Stations of the wing, and of the fuselage.
_STATIONS: Final = 15
