"""Sideslip coupling: longitudinal effects of sideslip, and lateral ones that vary with alpha.

Model: ``C += k |beta|`` on CX, CZ and Cm (terms of 003, eq. 6), and ``C += k alpha beta`` on CY, Cl
and Cn (in DHC6.xml, Cn_beta grows with alpha by 4 to 6 per rad2, which the Twin Otter's flights do
not confirm). Believable size: up to a few per rad2.

Data needed: sideslip at several angles of attack.

>>> from aerodb.effects.template import value
>>> value(LONGITUDINAL, beta=-0.1), value(LATERAL, alpha=0.1, beta=-0.1)
(0.1, -0.01)
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

LONGITUDINAL = "abs(beta)"
LATERAL = "alpha*beta"
SIZES = {"CX": 0.3, "CZ": 0.6, "Cm": 0.3, "CY": 5.0, "Cl": 5.0, "Cn": 6.0}
SOURCE = "003, eq. 6; DHC6.xml against the Twin Otter records"
EFFECT = "sideslip_coupling"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    grows = {
        "abs_beta": "that grows with sideslip to either side",
        "alpha_beta": "due to sideslip that changes with angle of attack",
    }
    hypotheses = []
    for axis, size in SIZES.items():
        name, regressor = (
            ("abs_beta", LONGITUDINAL) if axis in ("CX", "CZ", "Cm") else ("alpha_beta", LATERAL)
        )
        unit = "1/rad" if name == "abs_beta" else "1/rad^2"
        hypotheses.append(
            additive(
                context,
                EFFECT,
                axis,
                regressor,
                size=size,
                unit=unit,
                grows=grows[name],
                name=name,
                source=SOURCE,
            )
        )
    return hypotheses


TEMPLATE = Template(
    EFFECT, "aerodynamic", "CX, CZ, Cm += k*|beta|; CY, Cl, Cn += k*alpha*beta", SOURCE, _hypotheses
)
