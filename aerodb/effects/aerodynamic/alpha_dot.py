"""Downwash lag: normal force and pitching moment due to alphadot (CZ_alphadot, Cm_alphadot).

Model: ``C += k alphadot_hat`` with ``alphadot_hat = alphadot c/(2V)``; the downwash of the wing
reaches the tail late. Believable size: Cm_alphadot is a quarter to a half of Cm_q, -2 to -15.

Data needed: manoeuvres in which q and alphadot differ, i.e. in which the flight path curves
without pitching to match: plunging, turbulence, rolling at angle of attack, steady turns (000). In
pure pitching, q and alphadot are one motion.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, alphadot_hat=0.004)
0.004
"""

from aerodb.effects.template import per_axis

REGRESSOR = "alphadot_hat"

TEMPLATE = per_axis(
    "alpha_dot",
    REGRESSOR,
    {"CZ": 20.0, "Cm": 20.0},
    unit="1",
    grows="that follows the rate of change of angle of attack",
    name="alphadot",
    source="000, separation of Cm_q and Cm_alphadot; Klein & Morelli 2006, section 3.3",
)
