"""Body-flap effectiveness: axial and normal force and pitching moment due to body-flap deflection.

Model: ``C += k delta``. Believable size: Cm_bf is -.05 per rad on Phoenix-like shapes.

Data needed: body-flap motion of its own. As a trim surface it often moves together with the speed
brake; see `speed_brake`.
"""

from aerodb.effects.aerodynamic.per_surface import of_device

TEMPLATE = of_device("body_flap", {"CX": 0.3, "CZ": 0.5, "Cm": 0.3}, "003, section IV.D")
