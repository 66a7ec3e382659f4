"""Pitch damping: pitching moment due to pitch rate (Cm_q).

Model: ``Cm += k q_hat`` with ``q_hat = q c/(2V)``. Believable size: the total is negative, -5 to
-40; the correction may have either sign. Where alphadot is not separated (000), the estimate
includes Cm_alphadot.

Data needed: pitch manoeuvres faster than the decay of the short period.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, q_hat=-0.01)
-0.01
"""

from aerodb.effects.template import per_axis

REGRESSOR = "q_hat"

TEMPLATE = per_axis(
    "pitch_damping",
    REGRESSOR,
    {"Cm": 40.0},
    unit="1",
    grows="that grows with pitch rate",
    name="q",
    source="Klein & Morelli 2006, eq. 3.2; 000",
)
