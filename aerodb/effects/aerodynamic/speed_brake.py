"""Speed-brake effectiveness: drag, lift and pitching moment due to speed-brake deflection.

Model: ``C += k delta``. Believable size: C_drag .05 to .3 per rad; 003 found the preflight
database to overestimate it.

Data needed: brakes in and out under the same conditions. 003 and 000 disagree about the split of
the pitching moment between speed brake and body flap; where both move together they form one alias
group.
"""

from aerodb.effects.aerodynamic.per_surface import of_device

TEMPLATE = of_device("speed_brake", {"CX": 0.3, "CZ": 0.5, "Cm": 0.3}, "003, section IV.D")
