"""A constant force or moment that the database lacks.

``C += k`` on every axis, forces along the body also where the database writes them along the wind:
there each flight's own constants stand, and a constant lift beside them would be seen in CX alone,
as a force that changes with alpha. Instrument constants look alike, so that tracing usually leaves
it to each flight's own constant. Size: 003, section IV.D, reports zero terms of some thousandths to
hundredths, of either sign. Valid everywhere.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR)
1.0
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import AXIS_WORDS, Scene, Template, on_axis
from aerodb.tables import parse

REGRESSOR = "1"
SIZES = {"CX": 0.05, "CY": 0.05, "CZ": 0.2, "Cl": 0.02, "Cm": 0.1, "Cn": 0.02}
SOURCE = "003, eq. 7 and section IV.D"


def _hypotheses(scene: Scene) -> list[Hypothesis]:
    return [
        on_axis(
            "zero_offset",
            axis,
            parse(REGRESSOR),
            unit="1",
            plausible=(-size, size),
            because=f"{AXIS_WORDS[axis]} that is always there",
            parameter=f"{axis}_0",
            source=SOURCE,
        )
        for axis, size in SIZES.items()
    ]


TEMPLATE = Template(
    "zero_offset", "aerodynamic", "CX, CY, CZ, Cl, Cm, Cn += k", SOURCE, _hypotheses, version=2
)
