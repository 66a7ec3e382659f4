"""A control surface that loses (or gains) effect at large deflection: tail lift has a cubic part.

``C += k delta^3``, on the moment that the surface is for. Source 000 writes tail lift as linear
plus cubic in deflection. Size: at 25 deg, delta^3 is .08; a third of a Cm_de of -1.5 lost there is
k = 1.6; larger where the surface stalls. Needs large and small deflections: near zero nothing is
seen of it.

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
    """The cube of the deflection."""
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
