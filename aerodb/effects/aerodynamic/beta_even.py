"""A side force or lateral moment that is the same for sideslip to either side: what symmetry
forbids.

``C += k |beta|``. No symmetric aircraft has it. A database gains it by a lost sign, with which it
is then an exact twin of `table_sign` where that table is linear in beta; a damaged or asymmetric
aircraft has it truly. Size: as `beta_slope`. Needs sideslip to both sides.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, beta=-0.05)
0.05
"""

from aerodb.effects.template import per_axis

REGRESSOR = "abs(beta)"

TEMPLATE = per_axis(
    "beta_even",
    REGRESSOR,
    {"CY": 1.5, "Cl": 0.8, "Cn": 0.6},
    unit="1/rad",
    grows="that is the same for sideslip to either side",
    name="abs_beta",
    source="DHC6.xml against the Twin Otter records",
)
