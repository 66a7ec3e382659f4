"""Body-flap effectiveness: axial and normal force and pitching moment due to body-flap deflection.

Model: ``C += k delta``. Believable size: Cm_bf is -.05 per rad on Phoenix-like shapes.

Data needed: body-flap motion of its own. As a trim surface it often moves together with the speed
brake; see `speed_brake`.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=-0.1)
-0.1
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "body_flap": {"CX": 0.3, "CZ": 0.5, "Cm": 0.3},
}


def regressor(delta: str) -> str:
    """The deflection itself [rad], (n,)."""
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
