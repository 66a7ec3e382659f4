"""Zero terms: constant forces and moments (CX_0, CY_0, CZ_0, Cl_0, Cm_0, Cn_0).

Model: ``C += k`` on every body axis. Forces stay on body axes even if the database writes them on
wind axes: each flight's own constants are on body axes, and beside them a constant lift would
appear in CX alone, as a force that changes with alpha. Instrument biases look alike, so that
tracing usually assigns the offset to each flight's own constant. Believable size: 003, section
IV.D, reports zero terms of a few thousandths to hundredths, of either sign.

Data needed: none in particular; the effect is present in all flight conditions.

>>> from aerodb.effects.template import value
>>> value(REGRESSOR)
1.0
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import AXIS_WORDS, LibraryContext, Template, on_axis
from aerodb.tables import parse

REGRESSOR = "1"
SIZES = {"CX": 0.05, "CY": 0.05, "CZ": 0.2, "Cl": 0.02, "Cm": 0.1, "Cn": 0.02}
SOURCE = "003, eq. 7 and section IV.D"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
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
