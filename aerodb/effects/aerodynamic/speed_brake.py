"""Speed-brake effectiveness: drag, lift and pitching moment due to speed-brake deflection.

Model: ``C += k delta``. Believable size: C_drag .05 to .3 per rad; 003 found the preflight
database to overestimate it.

Data needed: brakes in and out under the same conditions. 003 and 000 disagree about the split of
the pitching moment between speed brake and body flap; where both move together they form one alias
group.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.5)
0.5
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "speed_brake": {"CX": 0.3, "CZ": 0.5, "Cm": 0.3},
}


def regressor(delta: str) -> str:
    """The deflection itself [rad], (n,)."""
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
