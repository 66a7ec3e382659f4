"""A body flap that acts otherwise than the database says.

``C += k delta``. Size: Cm_bf -.05 per rad on Phoenix-like shapes. Moves as a trim surface, often
together with the speed brake: see there. Needs its own motion.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=-0.1)
-0.1
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "body_flap": {"CX": 0.3, "CZ": 0.5, "Cm": 0.3},
}


def regressor(delta: str) -> str:
    """The deflection itself."""
    return delta


TEMPLATE = per_surface(
    "body_flap",
    regressor,
    SIZES,
    unit="1/rad",
    grows="that grows with {surface} deflection",
    name="{surface}",
    source="003, section IV.D",
    named=False,
)
