"""A pitching moment due to pitch rate other than the database says.

``Cm += k q_hat``. The total is negative, -5 to -40; the correction has either sign. With alpha-dot
not separated (000) it takes over Cm_alphadot too. Needs pitch manoeuvres faster than the short
period is damped.

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
