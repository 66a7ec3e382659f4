"""A table as an expression: exact between its breakpoints and held constant outside them.

Increments need this form, because they cannot call tables. Along each axis ``f(x) = f(x_0) + sum_j
clip(x - x_j, 0, d_j)/d_j (f(x_{j+1}) - f(x_j))``, where the f's are functions of the other axes in
turn. Only abs, clip and products appear, so that `multilinear.breaks` recovers the breakpoints and
a table can hold the result.
"""

from collections.abc import Sequence

import numpy as np

from aerodb.support import Array
from aerodb.tables import Call, Expression, Number, Operation, number


def as_expression(
    arguments: Sequence[Expression], breakpoints: Sequence[Array], values: Array
) -> Expression:
    """`values` over `breakpoints` (increasing, one array per argument) as an expression of
    `arguments`.

    >>> import numpy as np
    >>> from aerodb.tables.expression import Name
    >>> str(as_expression([Name("alpha")], [np.array([0.0, 0.5, 1.0])], np.array([1.0, 3.0, 3.0])))
    '1 + clip(alpha, 0, 0.5)*4'
    """
    if not arguments:
        return number(float(values))
    parts: list[Expression] = []
    if np.any(values[0]):
        parts.append(as_expression(arguments[1:], breakpoints[1:], values[0]))
    for j, (low, high) in enumerate(
        zip(breakpoints[0][:-1].tolist(), breakpoints[0][1:].tolist(), strict=True)
    ):
        rise = (values[j + 1] - values[j]) / (high - low)
        if np.any(rise):
            ramp = Call("clip", (_less(arguments[0], low), Number(0.0), Number(high - low)))
            parts.append(Operation("*", ramp, as_expression(arguments[1:], breakpoints[1:], rise)))
    return _sum(parts) if parts else Number(0.0)


def _less(argument: Expression, low: float) -> Expression:
    if low == 0.0:
        return argument
    return Operation("-" if low > 0 else "+", argument, Number(abs(low)))


def _sum(parts: Sequence[Expression]) -> Expression:
    """The sum as a tree of equal branches: a chain would be too deep to be read again."""
    if len(parts) == 1:
        return parts[0]
    middle = (len(parts) + 1) // 2
    return Operation("+", _sum(parts[:middle]), _sum(parts[middle:]))
