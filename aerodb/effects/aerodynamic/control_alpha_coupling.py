"""A control surface whose effect changes with angle of attack.

``C += k alpha delta``, on the moment that the surface is for, and on Cn for ailerons (adverse yaw).
Source 000 has alpha delta_e in the tail lift; a wake or vortex over the surface does the same.
Size: a surface that loses its effect within 20 deg of alpha has k = 3 times its effectiveness.
Needs deflections at several angles of attack.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), alpha=0.2, delta=0.1)
0.02
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "pitch": {"Cm": 8.0},
    "roll": {"Cl": 1.5, "Cn": 1.0},
    "yaw": {"Cn": 1.5},
}


def regressor(delta: str) -> str:
    """Angle of attack times deflection."""
    return f"alpha*{delta}"


TEMPLATE = per_surface(
    "control_alpha_coupling",
    regressor,
    SIZES,
    unit="1/rad^2",
    grows="due to {surface} deflection that changes with angle of attack",
    name="alpha*{surface}",
    source="000, tail lift in alpha*delta",
)
