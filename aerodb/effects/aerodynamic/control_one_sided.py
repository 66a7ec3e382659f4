"""Control effectiveness of deflections to one side only: a spoiler, a tail that stalls at one sign,
a surface shadowed at one side.

Model: ``C += k max(delta, 0)`` or ``C += k min(delta, 0)``. Believable size: as for
`control_effectiveness`: a surface that loses all of it to one side.

Data needed: deflections to both sides.

>>> from aerodb.effects.template import value
>>> value(positive("delta"), delta=-0.1), value(negative("delta"), delta=-0.1)
(0.0, -0.1)
"""

from aerodb.effects.aerodynamic.control_effectiveness import SIZES as BOTH_SIDES
from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface
from aerodb.effects.template import Template

#: Of the moment that a surface controls, and of what a rudder does besides.
SIZES: Sizes = {
    "pitch": {"Cm": BOTH_SIDES["pitch"]["Cm"]},
    "roll": BOTH_SIDES["roll"],
    "yaw": BOTH_SIDES["yaw"],
}
SOURCE = "control_effectiveness, by side"


def positive(delta: str) -> str:
    """The deflection [rad] where it is positive, (n,)."""
    return f"max({delta}, 0)"


def negative(delta: str) -> str:
    """The deflection [rad] where it is negative, (n,)."""
    return f"min({delta}, 0)"


_SIDES = tuple(
    per_surface(
        "control_one_sided",
        regressor,
        SIZES,
        unit="1/rad",
        grows=f"that grows with {regressor.__name__} {{surface}} deflection only",
        name=f"{{surface}}_{regressor.__name__}",
        side=regressor.__name__,
        source=SOURCE,
    )
    for regressor in (positive, negative)
)
TEMPLATE = Template(
    "control_one_sided",
    "aerodynamic",
    "CY, Cl, Cm, Cn += k*max(delta, 0); k*min(delta, 0)",
    SOURCE,
    lambda context: [each for side in _SIDES for each in side.hypotheses(context)],
)
