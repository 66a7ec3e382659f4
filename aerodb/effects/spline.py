"""Spline refinement of a hypothesis: its regressor times a piecewise-linear function of a variable.

``R (g + d_1 s_1(u) + d_2 s_2(u) + ...)`` with ramps ``s_j``, 0 below node j and 1 above node j + 1:
g is the gain at the lowest node, d_j its change over interval j. With all d = 0 it is the original
hypothesis. These are linear B-splines (de Boor, 1978) in the basis in which a penalty on the
differences of neighbouring coefficients (Eilers & Marx, Stat. Sci. 11(2), 1996) is a penalty on
each d_j.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.support import Array
from aerodb.tables import Expression, number, parse

#: Intervals of a spline.
INTERVALS: Final = 6
#: Part of a term's sum of squares that may lie beyond the outer nodes, on each side: there the gain
#: is held.
_BEYOND: Final = 0.005
#: Variables whose functions a coefficient is known to be, beside the deflections.
_VARIABLES: Final = frozenset({"alpha", "beta", "mach", "height_above_ground"})


@dataclass(frozen=True)
class Spline:
    """variable : channel. nodes : increasing, SI; at least two."""

    variable: str
    nodes: tuple[float, ...]

    def ramps(self, values: Array) -> Array:
        """(n, intervals) of values (n,): how much of each interval lies below.

        >>> Spline("alpha", (0.0, 0.1, 0.3)).ramps(np.array([0.05, 0.2, 0.5])).round(2).tolist()
        [[0.5, 0.0], [1.0, 0.5], [1.0, 1.0]]
        """
        low, high = np.array(self.nodes[:-1]), np.array(self.nodes[1:])
        return np.asarray(np.clip((values[:, None] - low) / (high - low), 0.0, 1.0))

    def expressions(self, regressor: Expression) -> tuple[Expression, ...]:
        """Return ``regressor * s_j`` for every interval; s_j is (n,), dimensionless, 0 to 1."""
        return tuple(
            parse(
                f"({regressor})*(clip({self.variable}, {number(a)}, {number(b)}) -"
                f" ({number(a)}))/{number(b - a)}"
            )
            for a, b in zip(self.nodes[:-1], self.nodes[1:], strict=True)
        )


def variables_of(hypothesis: Hypothesis) -> tuple[str, ...]:
    """Return the variables over which the shape of a term may be made finer: alpha, and those of
    its own that are no rates."""
    names = frozenset[str]().union(*(regressor.names for _, regressor in hypothesis.increment))
    return tuple(
        sorted({"alpha", *(n for n in names if n in _VARIABLES or n.startswith("delta_"))})
    )


def spline_over(
    variable: str, hypothesis: Hypothesis, views: Sequence[FlightView]
) -> Spline | None:
    """Return nodes (in the variable's SI unit) where the term itself acts: each interval holds the
    same part of its sum of squares over the flights.

    None where the flights lack the variable or it does not move while the term acts. Columns are
    (n,).
    """
    values, weights = [], []
    for view in views:
        columns = hypothesis.columns(view)
        if variable not in view.channels or not columns:
            return None
        good = np.logical_and.reduce([view.usable[axis] for axis in columns])
        values.append(view[variable][good])
        weights.append(np.sum([column[good] ** 2 for column in columns.values()], axis=0))
    value, weight = np.concatenate(values), np.concatenate(weights)
    order = np.argsort(value)
    share = np.cumsum(weight[order])
    if not len(share) or share[-1] <= 0.0:
        return None
    wanted = np.linspace(_BEYOND, 1.0 - _BEYOND, INTERVALS + 1)
    nodes = value[order][np.minimum(np.searchsorted(share / share[-1], wanted), len(order) - 1)]
    span = float(nodes[-1] - nodes[0])
    apart = [float(nodes[0])]
    for node in nodes[1:]:
        if node - apart[-1] > 0.02 * span > 0.0:
            apart.append(float(node))
    return Spline(variable, tuple(round(node, 5) for node in apart)) if len(apart) > 2 else None


def ramp_terms(hypothesis: Hypothesis, spline: Spline) -> tuple[Hypothesis, ...]:
    """Return the hypotheses that refine the shape of `hypothesis`: one per interval, of one
    increment each."""
    ((axis, regressor),) = hypothesis.increment
    terms = []
    for place, expression in enumerate(spline.expressions(regressor)):
        where = f"{spline.variable} {spline.nodes[place]:g} to {spline.nodes[place + 1]:g}"
        terms.append(
            replace(
                hypothesis,
                subject=f"{hypothesis.subject} {where}".strip(),
                parameter=f"{hypothesis.parameter}, change over {where}",
                increment=((axis, expression),),
                tangent=partial(_ramped, hypothesis=hypothesis, spline=spline, place=place),
                formula=f"{axis} += k*({expression})",
                needs=tuple(sorted({*hypothesis.needs, spline.variable})),
            )
        )
    return tuple(terms)


def _ramped(view: FlightView, *, hypothesis: Hypothesis, spline: Spline, place: int) -> Columns:
    ramp = spline.ramps(view[spline.variable])[:, place]
    return {axis: column * ramp for axis, column in hypothesis.columns(view).items()}
