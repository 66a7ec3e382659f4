"""A force or moment that follows the rate of change of alpha: the wing's downwash reaches the tail
late.

``C += k alphadot_hat``, ``alphadot_hat = alphadot c/(2V)``. Size: Cm_alphadot is a quarter to a
half of Cm_q, -2 to -15. In pitching alone q and alphadot are one motion; they are told apart where
the flight path curves without pitching against it: plunging, turbulence, rolling at alpha, steady
turns (000).

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
