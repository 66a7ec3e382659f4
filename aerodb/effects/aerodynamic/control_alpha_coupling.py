"""Control effectiveness that changes with angle of attack.

Model: ``C += k alpha delta`` on the moment that the surface controls, and on Cn for ailerons
(adverse yaw). The tail-lift model of 000 has a term in alpha delta_e; a wake or vortex passing over
the surface has the same effect. Believable size: a surface that loses all effectiveness within 20
deg of alpha has k = 3 times its effectiveness.

Data needed: deflections at several angles of attack.

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
    """Angle of attack times deflection [rad²], (n,)."""
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
