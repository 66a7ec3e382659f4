"""Even sideslip effect: side force or lateral moment alike for left and right sideslip.

Model: ``C += k |beta|``. Symmetry forbids it. A database acquires it through a lost sign; it is
then exactly aliased with `table_sign` where that table is linear in beta. A damaged or asymmetric
aircraft really has it. Believable size: as for `beta_slope`.

Data needed: sideslip in both directions.

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
