"""Aeroelasticity: lift-curve slope and static stability that change with dynamic pressure.

Model: ``C += k (alpha - alpha_0) qbar`` on CZ and Cm, the first term of the divergence series
``1/(1 - qbar/qbar_D)``. Believable size: a swept wing loses a tenth of its lift-curve slope at
10 kPa, k = 5e-5 per rad Pa.

Data needed: different dynamic pressures at the same angle of attack. At one altitude it cannot be
separated from `mach_effect`.

>>> from aerodb.effects.template import value
>>> value("alpha*qbar", alpha=0.1, qbar=5000.0)
500.0
"""

from aerodb.effects.aerodynamic.lift_like import from_zero_lift
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

SIZES = {"CZ": 4e-4, "Cm": 2e-4}
SOURCE = "Bisplinghoff, Ashley, Halfman, Aeroelasticity, chapter 8"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    return [
        additive(
            context,
            "dynamic_pressure_effect",
            axis,
            f"{from_zero_lift(context.database)}*qbar",
            size=size,
            unit="1/(rad Pa)",
            grows="due to angle of attack that changes with dynamic pressure",
            name="alpha*qbar",
            source=SOURCE,
        )
        for axis, size in SIZES.items()
    ]


TEMPLATE = Template(
    "dynamic_pressure_effect",
    "aerodynamic",
    "CZ, Cm += k*(alpha - alpha_0)*qbar",
    SOURCE,
    _hypotheses,
)
