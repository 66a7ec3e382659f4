"""Cross-rate derivatives: roll due to yaw rate (Cl_r), yaw due to roll rate (Cn_p), CY_p and CY_r.

Model: ``Cl += k r_hat``, ``Cn += k p_hat``, ``CY += k p_hat``, ``CY += k r_hat``. Believable size:
Cl_r .1 to .3, more at high lift; Cn_p -.1 to .1; CY_r up to 1 (Twin Otter .96, as flown).

Data needed: rolling and yawing that are not both part of one Dutch roll.

>>> from aerodb.effects.template import value
>>> value("r_hat", r_hat=0.02)
0.02
"""

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

#: (axis, rate) -> largest believable correction.
SIZES = {("CY", "p"): 0.5, ("CY", "r"): 1.5, ("Cl", "r"): 0.6, ("Cn", "p"): 0.4}
WORDS = {"p": "roll", "r": "yaw"}
SOURCE = "Klein & Morelli 2006, eq. 3.2"


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    return [
        additive(
            context,
            "cross_rate",
            axis,
            f"{rate}_hat",
            size=size,
            unit="1",
            grows=f"that grows with {WORDS[rate]} rate",
            name=rate,
            subject=rate,
            source=SOURCE,
        )
        for (axis, rate), size in SIZES.items()
    ]


TEMPLATE = Template(
    "cross_rate", "aerodynamic", "CY, Cl += k*r_hat; CY, Cn += k*p_hat", SOURCE, _hypotheses
)
