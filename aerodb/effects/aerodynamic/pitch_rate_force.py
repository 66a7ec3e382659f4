"""Pitch-rate forces: axial and normal force due to pitch rate (CX_q, CZ_q).

Model: ``C += k q_hat`` with ``q_hat = q c/(2V)``; 003 found CX_q missing from the preflight
database. Believable size: CZ_q 0 to -40 (tail volume; Twin Otter C_lift_q 20), CX_q a tenth to a
third of that; the correction may have either sign.

Data needed: pitch rate that angle of attack does not follow immediately.

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
