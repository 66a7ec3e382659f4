"""Landing gear: drag, lift and pitching moment due to gear position.

Model: ``C += k delta_gear`` with delta_gear 0 up and 1 down. Believable size: C_drag .01 to .04, a
pitching moment of a few hundredths.

Data needed: gear movement in flight, or flights with the gear up and with it down.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=1.0)
1.0
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "landing_gear": {"CX": 0.06, "CZ": 0.1, "Cm": 0.1},
}


def regressor(delta: str) -> str:
    """The gear's position itself, 0 up to 1 down (dimensionless), (n,)."""
    return delta


TEMPLATE = per_surface(
    "landing_gear",
    regressor,
    SIZES,
    unit="1",
    grows="that comes with the {surface}",
    name="{surface}",
    source="003, eq. 6",
    named=False,
)
