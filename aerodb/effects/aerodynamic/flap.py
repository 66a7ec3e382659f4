"""High-lift flaps: lift, drag and pitching moment due to flap deflection.

Model: ``C += k delta``. Believable size: lift 1 to 3 per rad, drag .1 to .4 per rad, with a
nose-down moment.

Data needed: flight at several flap settings; within one setting the effect is a constant.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.35)
0.35
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "flap": {"CX": 0.5, "CZ": 1.5, "Cm": 0.8},
}


def regressor(delta: str) -> str:
    """The deflection itself [rad], (n,)."""
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
