"""Unequal left and right surfaces: roll due to symmetric, pitch due to asymmetric deflection.

Model: ``Cl += k delta_symmetric``, ``Cm += k delta_asymmetric``; a symmetric aircraft has neither,
and |delta_asymmetric| in Cm is no asymmetry. Believable size: the share by which one side is
weaker, times the effectiveness of the pair; all of it for a jammed surface, which
`surface_calibration` treats as a fault of the vehicle instead.

Data needed: independent motion of both deflections of the pair.

>>> from aerodb.effects.template import value
>>> value("delta_elevator", delta_elevator=-0.1)
-0.1
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

#: Kind of combination -> axis on which symmetry forbids an odd effect, and the largest believable
#: one.
FORBIDDEN = {"symmetric": ("Cl", 0.2), "asymmetric": ("Cm", 1.0)}
SOURCE = "symmetry; 003, below eq. 6, for the combinations"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    hypotheses = []
    for surface in context.surfaces:
        combination = context.vehicle.combinations.get(surface.name)
        if combination is None:
            continue
        axis, size = FORBIDDEN[combination.kind]
        hypotheses.append(
            additive(
                context,
                "surface_asymmetry",
                axis,
                surface.channel,
                size=size,
                unit="1/rad",
                grows=(
                    f"out of {combination.kind} {surface.words} deflection: left and right are not"
                    " alike"
                ),
                name=surface.channel,
                subject=surface.name,
                source=SOURCE,
            )
        )
    return hypotheses


FORMULA = "Cl += k*delta_symmetric; Cm += k*delta_asymmetric"
TEMPLATE = Template("surface_asymmetry", "aerodynamic", FORMULA, SOURCE, _hypotheses)
