"""Ground effect: lift, induced drag and pitching moment that change within a span of the ground.

Model: ``C += k sigma (alpha - alpha_0)`` on CZ (C_lift) and Cm, ``C += k sigma (alpha -
alpha_0)^2`` on CX (C_drag), with Wieselsberger's influence factor ``sigma = exp(-2.48
(2h/b)^0.768)`` in its usual fit (h height above ground, b span) and alpha_0 the database's own
zero-lift angle. Above REACH spans sigma is set to zero, so that the small value left there (5e-5)
does not compete with every slope in alpha. Believable size: a tenth to a quarter of the lift-curve
slope.

Data needed: flight within half a span of the ground at several angles of attack.

>>> from aerodb.effects.template import value
>>> value(influence(10.0), height_above_ground=5.0), value(influence(10.0), height_above_ground=1.0)
(0.083743, 0.486502)
"""

from aerodb.effects.aerodynamic.lift_like import from_zero_lift
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive

SIZES = {"CX": 5.0, "CZ": 3.0, "Cm": 2.0}
SOURCE = (
    "Wieselsberger, NACA TM-77, 1922; fit as in Torenbeek, Synthesis of Subsonic Airplane Design,"
    " 1982"
)


#: Height in spans beyond which there is no ground.
REACH = 3.0


def influence(span: float) -> str:
    """sigma, 1 on the ground and 0 from REACH spans upwards; `span` [m]."""
    return (
        f"step({REACH * span!r} - height_above_ground)*exp(-2.48*(2*max(height_above_ground,"
        f" 0)/{span!r})^0.768)"
    )


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    sigma, lifting = influence(context.database.reference.span), from_zero_lift(context.database)
    return [
        additive(
            context,
            "ground_effect",
            axis,
            f"{sigma}*{lifting}^2" if axis == "CX" else f"{sigma}*{lifting}",
            size=size,
            unit="1/rad^2" if axis == "CX" else "1/rad",
            grows="that changes near the ground",
            name="ground",
            source=SOURCE,
        )
        for axis, size in SIZES.items()
    ]


FORMULA = "CX += k*sigma(h/b)*(alpha - alpha_0)^2; CZ, Cm += k*sigma(h/b)*(alpha - alpha_0)"
TEMPLATE = Template("ground_effect", "aerodynamic", FORMULA, SOURCE, _hypotheses, version=2)
