"""A force due to pitch rate that the database lacks: the effect that 003 found undeclared in CX.

``C += k q_hat``, ``q_hat = q c/(2V)``. Size: CZ_q is 0 to -40 (tail volume; Twin Otter C_lift_q
20), CX_q a tenth of it to a third; either sign as a correction. Needs pitch rate that alpha does
not follow at once.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR, q_hat=0.01)
0.01
"""

from aerodb.effects.template import per_axis

REGRESSOR = "q_hat"

TEMPLATE = per_axis(
    "pitch_rate_force",
    REGRESSOR,
    {"CX": 15.0, "CZ": 40.0},
    unit="1",
    grows="that grows with pitch rate",
    name="q",
    source="003, section IV.D; Klein & Morelli 2006, eq. 3.2",
)
