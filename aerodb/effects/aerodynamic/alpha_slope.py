"""Lift-curve slope and static stability: slopes over angle of attack (CX, CZ, Cm_alpha).

Model: ``C += k alpha``. Believable size: lift-curve slopes of preflight databases, 2 to 6 per rad,
are off by about a tenth (003: 9-10 % of CZ, below 3 % of Cm); a third is still accepted.

Data needed: angle-of-attack changes of at least one degree below the stall. Aliases: on CX exactly
an alpha bias; on Cm exactly a CG shift along x.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, alpha=0.1)
0.1
"""

from aerodb.effects.template import per_axis

REGRESSOR = "alpha"

TEMPLATE = per_axis(
    "alpha_slope",
    REGRESSOR,
    {"CX": 1.0, "CZ": 2.0, "Cm": 1.0},
    unit="1/rad",
    grows="that grows with angle of attack",
    name="alpha",
    source="003, eq. 7 and section IV.D",
)
