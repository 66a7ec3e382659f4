"""Angle of attack from zero lift, the regressor of ground, Mach and dynamic-pressure effects.

These effects scale the lift, not the angle of attack itself.
"""

from functools import lru_cache

import numpy as np

from aerodb.support import Array
from aerodb.tables import AeroDatabase, body_to_wind, neutral_point, vary


@lru_cache(maxsize=64)
def lift_curve(database: AeroDatabase, axis: str = "C_lift") -> tuple[Array, Array]:
    """Return alpha [rad] from -20 to 40 deg and the clean aircraft's C_lift, or CZ, there, both
    (n,); zeros where nothing depends on alpha."""
    alpha = np.linspace(-0.35, 0.7, 211)
    if "alpha" not in database.inputs:
        return alpha, np.zeros(len(alpha))
    at = neutral_point(database)
    if "height_above_ground" in at:
        at["height_above_ground"] = 1e4
    curves = database.predict(vary(at, {"alpha": alpha})).coefficients
    if axis == "CZ":
        return alpha, curves["CZ"]
    return alpha, body_to_wind(curves["CX"], curves["CY"], curves["CZ"], alpha, 0.0)[2]


@lru_cache(maxsize=64)
def zero_lift_alpha(database: AeroDatabase) -> float:
    """Return the alpha [rad] (a scalar) in +-20 deg, nearest to zero, at which the database's clean
    lift vanishes, to 1e-4; 0 where it never does."""
    if "alpha" not in database.inputs:
        return 0.0
    alpha, lift = (values[:141] for values in lift_curve(database))
    crossings = np.flatnonzero(lift[:-1] * lift[1:] <= 0.0)
    roots = [
        alpha[k] - lift[k] * (alpha[k + 1] - alpha[k]) / ((lift[k + 1] - lift[k]) or 1.0)
        for k in crossings
    ]
    return round(float(min(roots, key=abs, default=0.0)), 4) + 0.0


def from_zero_lift(database: AeroDatabase) -> str:
    """``(alpha - alpha_0)`` [rad] as an expression; see `zero_lift_alpha`.

    >>> from aerodb.tables.reference import ReferenceGeometry
    >>> from_zero_lift(AeroDatabase("empty", ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))))
    'alpha'
    """
    at = zero_lift_alpha(database)
    return "alpha" if at == 0.0 else f"(alpha - {at!r})" if at > 0 else f"(alpha + {-at!r})"
