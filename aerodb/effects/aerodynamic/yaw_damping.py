"""Yaw damping: yawing moment due to yaw rate (Cn_r).

Model: ``Cn += k r_hat`` with ``r_hat = r b/(2V)``. Believable size: the total is negative, -.05 to
-.4; the correction may have either sign.

Data needed: rudder doublets.

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
