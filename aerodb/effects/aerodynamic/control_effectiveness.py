"""Control effectiveness: force or moment due to surface deflection (Cm_de, Cl_da, Cn_dr, ...).

Model: ``C += k delta``. Believable size: the effectiveness in preflight databases is seldom off by
more than a third (Cm_de -1 to -2, Cl_da -.2, Cn_dr -.13 per rad).

Data needed: at least one degree of surface motion that is separable from the motion it causes. On
Cm it is nearly aliased with the calibration of the surface, with Iyy and with the CG; only several
axes together separate them.

>>> from aerodb.effects.template import value
>>> value(regressor("delta"), delta=0.1)
0.1
"""

from aerodb.effects.aerodynamic.per_surface import Sizes, per_surface

SIZES: Sizes = {
    "pitch": {"CX": 0.5, "CZ": 1.0, "Cm": 2.0},
    "roll": {"Cl": 0.3, "Cn": 0.2},
    "yaw": {"CY": 0.5, "Cl": 0.2, "Cn": 0.3},
    "other": {"CX": 0.5, "CY": 0.5, "CZ": 1.0, "Cl": 0.3, "Cm": 1.0, "Cn": 0.3},
}


def regressor(delta: str) -> str:
    """The deflection itself [rad], (n,)."""
    return delta


TEMPLATE = per_surface(
    "control_effectiveness",
    regressor,
    SIZES,
    unit="1/rad",
    grows="that grows with {surface} deflection",
    name="{surface}",
    source="003, eq. 7",
)
