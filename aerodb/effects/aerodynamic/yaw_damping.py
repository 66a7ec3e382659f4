"""A yawing moment due to yaw rate other than the database says.

``Cn += k r_hat``, ``r_hat = r b/(2V)``. The total is negative, -.05 to -.4; the correction has
either sign. Needs rudder doublets.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, r_hat=0.02)
0.02
"""

from aerodb.effects.template import per_axis

REGRESSOR = "r_hat"

TEMPLATE = per_axis(
    "yaw_damping",
    REGRESSOR,
    {"Cn": 0.6},
    unit="1",
    grows="that grows with yaw rate",
    name="r",
    source="Klein & Morelli 2006, eq. 3.2",
)
