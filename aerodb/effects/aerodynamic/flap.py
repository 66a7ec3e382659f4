"""High-lift flaps: lift, drag and pitching moment due to flap deflection.

Model: ``C += k delta``. Believable size: lift 1 to 3 per rad, drag .1 to .4 per rad, with a
nose-down moment.

Data needed: flight at several flap settings; within one setting the effect is a constant.
"""

from aerodb.effects.aerodynamic.per_surface import of_device

TEMPLATE = of_device("flap", {"CX": 0.5, "CZ": 1.5, "Cm": 0.8}, "003, eq. 7")
