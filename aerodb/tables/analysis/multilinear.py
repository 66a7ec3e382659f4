"""Breakpoints between which an expression is multilinear, so that a table represents it exactly.

A sum or product of functions of one variable each, every one of them continuous and piecewise
linear (``alpha``, ``max(alpha - 0.175, 0)*beta``, ``abs(beta)``), is multilinear between its
breakpoints. Anything else is refused with the reason, which `consolidation` reports.
"""

from collections.abc import Mapping

import numpy as np

from aerodb.support import Array
from aerodb.tables.expression import Call, Expression, Name, Negation, Number, Operation, number
from aerodb.tables.program import evaluate

#: Breakpoints closer than this, relative to the axis, differ only by rounding and are merged.
MERGED = 1e-14


class NotMultilinearError(ValueError):
    """An expression that no table can represent exactly; the message gives the reason."""


def breaks(
    expression: Expression, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, set[float]]:
    """Per variable of `expression`, the breakpoints inside its range (low, high) between which it
    is multilinear.

    >>> from aerodb.tables.expression import parse
    >>> breaks(parse("max(alpha - 0.25, 0)*abs(beta)"), {"alpha": (0.0, 1.0), "beta": (-1.0, 1.0)})
    {'alpha': {0.25}, 'beta': {0.0}}

    Raises NotMultilinearError naming the part of the expression that is not multilinear.
    """
    if isinstance(expression, Number):
        return {}
    if isinstance(expression, Name):
        return {expression.name: set()}
    if isinstance(expression, Negation):
        return breaks(expression.operand, ranges)
    if isinstance(expression, Operation):
        return _operation(expression, ranges)
    if isinstance(expression, Call):
        return _call(expression, ranges)
    raise NotMultilinearError(f"'{expression}' is not piecewise linear")


def _operation(
    expression: Operation, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, set[float]]:
    left, right = breaks(expression.left, ranges), breaks(expression.right, ranges)
    if expression.operator == "*" and left.keys() & right.keys():
        raise NotMultilinearError(
            f"'{expression}' is not linear in {', '.join(sorted(left.keys() & right.keys()))}"
        )
    if expression.operator == "^" or (expression.operator == "/" and right):
        raise NotMultilinearError(f"'{expression}' is not piecewise linear")
    return {
        name: left.get(name, set()) | right.get(name, set())
        for name in sorted(left.keys() | right.keys())
    }


def _call(expression: Call, ranges: Mapping[str, tuple[float, float]]) -> dict[str, set[float]]:
    """Breakpoints of abs, min, max and clip of functions of one variable: those of the arguments,
    and where the pieces intersect."""
    pieces = expression.arguments
    if expression.function == "abs":
        pieces = (*pieces, number(0.0))
    elif expression.function not in ("min", "max", "clip"):
        raise NotMultilinearError(f"'{expression}' is not piecewise linear")
    if len(expression.names) > 1:
        raise NotMultilinearError(
            f"'{expression}' bends along a line that follows no single variable"
        )
    points: set[float] = set()
    for piece in pieces:
        points = points.union(*breaks(piece, ranges).values())
    for name in expression.names:
        low, high = ranges[name]
        grid = np.array(sorted({low, high} | points))
        for k, one in enumerate(pieces):
            for other in pieces[k + 1 :]:
                points |= _crossings(Operation("-", one, other), name, grid)
        return {name: {x for x in points if low < x < high}}
    return {}


def _crossings(difference: Expression, name: str, grid: Array) -> set[float]:
    """Zeros of a function that is linear between the points of `grid`."""
    y = np.broadcast_to(evaluate(difference, {name: grid}), grid.shape)
    crossings = set(grid[y == 0.0].tolist())
    for k in np.flatnonzero(y[:-1] * y[1:] < 0.0):
        crossings.add(float(grid[k] - y[k] * (grid[k + 1] - grid[k]) / (y[k + 1] - y[k])))
    return crossings


def merged(points: Array, others: set[float]) -> Array:
    """Merge `points` (increasing) and `others` into one increasing axis; values that differ only by
    rounding become one breakpoint, that of `points`.

    points : (n,), in the same unit as `others`.
    """
    axis = np.array(sorted({float(x) for x in points} | others))
    if axis.size < 2:
        return axis
    apart = MERGED * max(float(np.max(np.abs(axis))), float(axis[-1] - axis[0]))
    result: list[float] = []
    originals = {float(x) for x in points}
    for x in axis.tolist():
        if result and x - result[-1] <= apart:
            if x in originals and result[-1] not in originals:
                result[-1] = x
            elif x in originals:
                result.append(x)
            continue
        result.append(x)
    return np.array(result)
