"""A rolling moment due to roll rate other than the database says.

``Cl += k p_hat``, ``p_hat = p b/(2V)``. The total is negative, -.1 (slender) to -.6; the correction
has either sign. Needs aileron doublets.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, p_hat=0.02)
0.02
"""

from aerodb.effects.template import per_axis

REGRESSOR = "p_hat"

TEMPLATE = per_axis(
    "roll_damping",
    REGRESSOR,
    {"Cl": 0.8},
    unit="1",
    grows="that grows with roll rate",
    name="p",
    source="Klein & Morelli 2006, eq. 3.2",
)
