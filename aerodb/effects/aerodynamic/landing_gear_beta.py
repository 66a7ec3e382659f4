"""Landing gear in sideslip: sideslip derivatives that change with gear position.

Model: ``C += k delta_gear beta`` on CY and Cn, ``C += k delta_gear |beta|`` on CZ; the terms of
003, eq. 6. Believable size: a gear ahead of the CG reduces Cn_beta by a few hundredths per rad.

Data needed: sideslip with the gear down and with it up.

>>> from aerodb.effects.template import value
>>> value(regressor("delta", "Cn"), beta=-0.1, delta=1.0)
-0.1
>>> value(regressor("delta", "CZ"), beta=-0.1, delta=0.5)
0.05
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

SIZES = {"CZ": 0.4, "CY": 0.4, "Cn": 0.1}
SOURCE = "003, eq. 6"


def regressor(delta: str, axis: str) -> str:
    """Gear position times sideslip, to either side alike on CZ; [rad], (n,)."""
    return f"{delta}*abs(beta)" if axis == "CZ" else f"{delta}*beta"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    gears = [surface for surface in context.surfaces if surface.role == "landing_gear"]
    return [
        additive(
            context,
            "landing_gear_beta",
            axis,
            regressor(gear.channel, axis),
            size=size,
            unit="1/rad",
            grows=f"due to sideslip that comes with the {gear.words}",
            name=f"{gear.channel}*beta",
            subject=gear.name if len(gears) > 1 else "",
            source=SOURCE,
        )
        for gear in gears
        for axis, size in SIZES.items()
    ]


FORMULA = "CY, Cn += k*delta_gear*beta; CZ += k*delta_gear*|beta|"
TEMPLATE = Template("landing_gear_beta", "aerodynamic", FORMULA, SOURCE, _hypotheses)
