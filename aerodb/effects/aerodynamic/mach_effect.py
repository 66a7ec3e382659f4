"""Compressibility: lift-curve slope and static stability that grow with Mach number.

Model: ``C += k (alpha - alpha_0) M^2`` on CZ and Cm, the first term of the Prandtl-Glauert factor
``1/sqrt(1 - M^2) - 1 = M^2/2 + ...``, valid below M = .6. Believable size: half the slope itself
where M is small, all of it about M = .6, where the factor grows by .98 per M^2: up to 6 per rad.

Data needed: different Mach numbers at the same angle of attack. At one altitude it cannot be
separated from `dynamic_pressure_effect`.

>>> from aerodb.effects.template import value
>>> value("alpha*mach^2", alpha=0.1, mach=0.5)
0.025
"""

from aerodb.effects.aerodynamic.lift_like import from_zero_lift
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

SIZES = {"CZ": 6.0, "Cm": 3.0}
SOURCE = "Prandtl-Glauert rule (Anderson, Fundamentals of Aerodynamics, section 11.4)"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    return [
        additive(
            context,
            "mach_effect",
            axis,
            f"{from_zero_lift(context.database)}*mach^2",
            size=size,
            unit="1/rad",
            grows="due to angle of attack that changes with Mach number",
            name="alpha*mach^2",
            source=SOURCE,
        )
        for axis, size in SIZES.items()
    ]


TEMPLATE = Template(
    "mach_effect", "aerodynamic", "CZ, Cm += k*(alpha - alpha_0)*mach^2", SOURCE, _hypotheses
)
