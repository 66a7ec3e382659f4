"""Roll damping: rolling moment due to roll rate (Cl_p).

Model: ``Cl += k p_hat`` with ``p_hat = p b/(2V)``. Believable size: the total is negative, -.1
(slender) to -.6; the correction may have either sign.

Data needed: aileron doublets.

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
