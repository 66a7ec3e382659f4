"""A force or moment that grows with angle of attack at another rate than the database says.

``C += k alpha``. Size: lift slopes of preflight databases are wrong by about a tenth of 2 to 6 per
rad (003: 9-10 % of CZ, below 3 % of Cm); a third is still believed. On CX it is an exact twin of an
alpha bias, on Cm of a CG shift along x. Valid below the stall; needs alpha to move by a degree.

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
