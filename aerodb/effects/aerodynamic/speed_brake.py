"""A speed brake that acts otherwise than the database says.

``C += k delta``. 003 found its drag overestimated. Size: C_drag .05 to .3 per rad. 003 and 000
disagree about speed brake and body flap in the pitching moment: where both move together they are
one alias group. Needs brakes in and out in like conditions.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.5)
0.5
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "speed_brake": {"CX": 0.3, "CZ": 0.5, "Cm": 0.3},
}


def regressor(delta: str) -> str:
    """The deflection itself."""
    return delta


TEMPLATE = per_surface(
    "speed_brake",
    regressor,
    SIZES,
    unit="1/rad",
    grows="that grows with {surface} deflection",
    name="{surface}",
    source="003, section IV.D",
    named=False,
)
