"""A lift curve that is wrong by a share: the column is the database's own curve over alpha.

Model: ``C += k (C_lift(alpha) - C_lift(0))`` of the clean aircraft. As with `alpha_slope`, whether
the curve's constant is wrong too is seen when the effect is added. Walls of a tunnel, a reference
area and the Reynolds number change a curve by a share of itself, with its bends. Believable size:
as `alpha_slope`, a third. Where the curve is straight, `alpha_slope` is the same effect.

Data needed: angles of attack on both sides of a bend; below it, it cannot be told from
`alpha_slope`.
"""

import numpy as np

from aerodb.effects.aerodynamic.lift_like import lift_curve
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.interpolation_terms import as_expression
from aerodb.effects.template import AXIS_WORDS, LibraryContext, Template, on_axis
from aerodb.support import Array
from aerodb.tables import Name

SIZE = 0.35
SOURCE = "003, section IV.D: 9-10 % of CZ"
#: Largest distance of the column from the curve, and of a curve that counts as straight from a
#: line, as parts of the curve's range.
_NEAR, _STRAIGHT = 0.001, 0.01


def corners(x: Array, y: Array, near: float) -> list[int]:
    """Return which points (n,) of a curve a broken line within `near` [unit of y] goes through:
    the farthest from each straight piece, until none is farther (Ramer, 1972).

    >>> corners(np.arange(4.0), np.array([0.0, 1.0, 2.0, 2.0]), 0.1)
    [0, 2, 3]
    """
    kept, open_pieces = {0, len(x) - 1}, [(0, len(x) - 1)]
    while open_pieces:
        a, b = open_pieces.pop()
        apart = np.abs(y[a : b + 1] - np.interp(x[a : b + 1], x[[a, b]], y[[a, b]]))
        far = a + int(apart.argmax())
        if apart[far - a] > near:
            kept.add(far)
            open_pieces += [(a, far), (far, b)]
    return sorted(kept)


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    axis = context.axis("CZ")
    alpha, curve = lift_curve(context.database, axis)
    size = float(np.ptp(curve)) if np.isfinite(curve).all() else 0.0
    if size == 0.0 or len(corners(alpha, curve, _STRAIGHT * size)) == 2:
        return []
    at = corners(alpha, curve, _NEAR * size)
    from_zero = curve[at] - np.interp(0.0, alpha, curve)
    regressor = as_expression([Name("alpha")], [np.round(alpha[at], 6)], np.round(from_zero, 6))
    return [
        on_axis(
            "lift_scale",
            axis,
            regressor,
            unit="1",
            plausible=(-SIZE, SIZE),
            because=f"{AXIS_WORDS[axis]} in proportion to the database's curve over alpha",
            parameter=f"{axis}_scale",
            source=SOURCE,
        )
    ]


TEMPLATE = Template(
    "lift_scale", "aerodynamic", "CZ += k*(CZ(alpha) - CZ(0)) of the database", SOURCE, _hypotheses
)
