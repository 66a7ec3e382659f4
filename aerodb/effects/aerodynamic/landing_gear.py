"""Landing gear: drag, lift and pitching moment due to gear position.

Model: ``C += k delta_gear`` with delta_gear 0 up and 1 down. Believable size: C_drag .01 to .04, a
pitching moment of a few hundredths.

Data needed: gear movement in flight, or flights with the gear up and with it down.
"""

from aerodb.effects.aerodynamic.per_surface import of_device

TEMPLATE = of_device(
    "landing_gear",
    {"CX": 0.06, "CZ": 0.1, "Cm": 0.1},
    "003, eq. 6",
    unit="1",
    grows="that comes with the {surface}",
)
