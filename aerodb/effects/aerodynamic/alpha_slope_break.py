"""Slope break: the slope over angle of attack changes where the database's does not, or vice versa.

Model: ``C += k max(alpha - alpha_break, 0)``. The break is fixed before any flight is looked at: at
0.175 rad (003, eq. 7), and at the sharpest kink of the database's own curve within attached flow,
which flight may not confirm (the Twin Otter's lift in DHC6.xml bends at alpha = 0). Believable
size: as for `alpha_slope`.

Data needed: flight on both sides of the break.

>>> from aerodb.effects.template import value
>>> value(regressor(0.175), alpha=0.2), value(regressor(0.0), alpha=-0.01)
(0.025, 0.0)
"""

import numpy as np

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, additive
from aerodb.support import Array
from aerodb.tables import WIND_AXES, body_to_wind, breakpoints_over, neutral_point, vary

SIZES = {"CX": 1.0, "CZ": 2.0, "Cm": 1.0}
SOURCE = "003, eq. 7"
#: A kink counts when it is at least this share of the largest slope,
_SHARE = 0.05
#: and this many times the median kink.
_TIMES = 3.0


def regressor(at: float) -> str:
    """Zero up to `at` [rad], alpha - `at` beyond."""
    return (
        "max(alpha, 0)"
        if at == 0.0
        else f"max(alpha - {at!r}, 0)"
        if at > 0
        else f"max(alpha + {-at!r}, 0)"
    )


def sharpest_kink(context: LibraryContext, axis: str, widest: float = 0.21) -> float | None:
    """Alpha [rad] within +-`widest` at which the database's own curve bends most, if it bends there
    and hardly elsewhere."""
    points = breakpoints_over("alpha", context.database)
    if not points:
        return None
    alpha: Array = np.unique(np.round(np.concatenate(points), 9))
    alpha = alpha[np.abs(alpha) <= widest]
    if alpha.size < 4:
        return None
    curves = context.database.predict(
        vary(neutral_point(context.database), {"alpha": alpha})
    ).coefficients
    if axis in WIND_AXES:
        wind = body_to_wind(curves["CX"], curves["CY"], curves["CZ"], alpha, 0.0)
        curves = dict(zip(WIND_AXES, wind, strict=True))
    slopes = np.diff(curves[axis]) / np.diff(alpha)
    kinks = np.abs(np.diff(slopes))
    sharpest = int(np.argmax(kinks))
    sharp = kinks[sharpest] > max(_SHARE * np.max(np.abs(slopes)), _TIMES * np.median(kinks))
    return float(alpha[sharpest + 1]) + 0.0 if sharp else None


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    hypotheses = []
    for axis, size in SIZES.items():
        kink = sharpest_kink(context, context.axis(axis))
        breaks = {*context.settings.alpha_breaks, *(() if kink is None else (kink,))}
        for at in sorted(breaks):
            text = f"{at:.4g}"
            hypotheses.append(
                additive(
                    context,
                    "alpha_slope_break",
                    axis,
                    regressor(at),
                    size=size,
                    unit="1/rad",
                    grows=f"whose slope changes at an angle of attack of {np.rad2deg(at):.1f} deg",
                    name=f"alpha > {text}",
                    subject=text,
                    source=SOURCE,
                )
            )
    return hypotheses


TEMPLATE = Template(
    "alpha_slope_break",
    "aerodynamic",
    "CX, CZ, Cm += k*max(alpha - alpha_break, 0)",
    SOURCE,
    _hypotheses,
)
