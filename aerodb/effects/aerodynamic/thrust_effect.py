"""Power effects: lift, pitching, yawing and rolling moment due to thrust.

Model: ``C += k CT`` with ``CT = thrust/(qbar S)`` on CZ, Cm, Cn and Cl: the jet or slipstream
changes lift and pitching moment and, on a single-engined propeller aircraft, yawing and rolling
moment. CX is left out, because there the effect is the thrust itself (`thrust_scale`). Believable
size: a thrust line one chord off the CG gives k = 1 in Cm.

Data needed: throttle changes at nearly constant speed.

>>> from aerodb.effects.template import value
>>> value(regressor(40.0), thrust=8000.0, qbar=2000.0)
0.1
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

SIZES = {"CZ": 2.0, "Cl": 0.2, "Cm": 1.0, "Cn": 0.2}
SOURCE = "000; DHC6.xml, term CmT"


def regressor(area: float) -> str:
    """Thrust coefficient; `area` [m2]."""
    return f"thrust/(qbar*{area!r})"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    if context.vehicle.thrust.source != "channel":
        return []
    return [
        additive(
            context,
            "thrust_effect",
            axis,
            regressor(context.database.reference.area),
            size=size,
            unit="1",
            grows="that grows with thrust",
            name="thrust",
            source=SOURCE,
        )
        for axis, size in SIZES.items()
    ]


TEMPLATE = Template(
    "thrust_effect", "aerodynamic", "CZ, Cl, Cm, Cn += k*thrust/(qbar*S)", SOURCE, _hypotheses
)
