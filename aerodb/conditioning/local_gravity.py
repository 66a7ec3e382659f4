"""Gravity where a flight took place."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.physics import GRAVITY, normal_gravity
from aerodb.support import Array

#: Channels of the height above the ellipsoid, the better one first; the geoid's undulation, 100 m
#: at most, changes gravity by 3e-4 m/s2.
_HEIGHTS: Final = ("altitude", "pressure_altitude")


def local_gravity(channels: Mapping[str, Array]) -> float:
    """Return gravity [m/s2] at the medians of latitude [rad] and altitude [m].

    Somigliana's formula at the ellipsoid and its expansion in height (`normal_gravity`). Where no
    latitude is known, standard gravity, from which gravity at sea level differs by up to 0.026
    m/s2; a receiver without a fix that writes zero latitude and longitude gives none.

    >>> round(local_gravity({"latitude": np.array([np.pi / 4]), "altitude": np.zeros(1)}), 6)
    9.806198
    >>> local_gravity({})
    9.80665
    """
    latitude = _median(channels, "latitude")
    fixed = any(np.any(channels[name]) for name in ("latitude", "longitude") if name in channels)
    if latitude is None or not fixed or not abs(latitude) <= np.pi / 2.0:
        return GRAVITY
    heights = (_median(channels, name) for name in _HEIGHTS)
    return float(normal_gravity(latitude, next((h for h in heights if h is not None), 0.0)).gravity)


def _median(channels: Mapping[str, Array], name: str) -> float | None:
    """Median of the finite samples; None without any."""
    values = np.asarray(channels.get(name, np.empty(0)))
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None
