"""A side force or lateral moment that grows with sideslip at another rate than the database says.

``C += k beta``: weathercock stability, dihedral effect, side force. Size: for the Twin Otter, CY
-.85, Cl -.11, Cn .085 per rad; a handbook database was off by .42 in Cn (DHC6.xml). Needs sideslip
of a degree.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, beta=-0.05)
-0.05
"""

from aerodb.effects.template import per_axis

REGRESSOR = "beta"

TEMPLATE = per_axis(
    "beta_slope",
    REGRESSOR,
    {"CY": 1.5, "Cl": 0.4, "Cn": 0.6},
    unit="1/rad",
    grows="that grows with sideslip",
    name="beta",
    source="Klein & Morelli 2006, table 5.1",
)
