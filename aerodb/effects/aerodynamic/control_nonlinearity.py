"""Control nonlinearity: effectiveness lost or gained at large deflections (cubic term).

Model: ``C += k delta^3`` on the moment that the surface controls; 000 writes tail lift as linear
plus cubic in deflection. Believable size: delta^3 is .08 at 25 deg, so losing a third of a Cm_de of
-1.5 there gives k = 1.6; larger where the surface stalls.

Data needed: small and large deflections; near zero the effect is invisible.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.4)
0.064
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "pitch": {"Cm": 15.0},
    "roll": {"Cl": 3.0},
    "yaw": {"Cn": 3.0},
}


def regressor(delta: str) -> str:
    """The cube of the deflection [rad³], (n,)."""
    return f"{delta}^3"


TEMPLATE = per_surface(
    "control_nonlinearity",
    regressor,
    SIZES,
    unit="1/rad^3",
    grows="that grows with the cube of {surface} deflection",
    name="{surface}^3",
    source="000, tail lift in delta and delta^3",
)
