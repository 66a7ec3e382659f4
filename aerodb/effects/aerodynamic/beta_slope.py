"""Side-force slope, dihedral effect and weathercock stability (CY_beta, Cl_beta, Cn_beta).

Model: ``C += k beta``. Believable size: the Twin Otter has CY_beta -.85, Cl_beta -.11 and
Cn_beta .085 per rad; one handbook database was off by .42 in Cn_beta (DHC6.xml).

Data needed: at least one degree of sideslip.

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
