"""High-lift flaps that act otherwise than the database says.

``C += k delta``. Size: lift 1 to 3 per rad, drag .1 to .4, a nose-down moment with it. Needs flight
with several flap settings: within one setting it is a constant.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.35)
0.35
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "flap": {"CX": 0.5, "CZ": 1.5, "Cm": 0.8},
}


def regressor(delta: str) -> str:
    """The deflection itself."""
    return delta


TEMPLATE = per_surface(
    "flap",
    regressor,
    SIZES,
    unit="1/rad",
    grows="that grows with {surface} deflection",
    name="{surface}",
    source="003, eq. 7",
    named=False,
)
