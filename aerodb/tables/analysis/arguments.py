"""Table calls of a database: where tables are called, and over which channels."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from aerodb.support import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tables.definitions import CONSTANTS
from aerodb.tables.expression import Expression, Name, Negation, Number, Operation, TableCall


@dataclass(frozen=True)
class ScaledChannel:
    """A table argument of the form ``scale * channel + offset``, such as an angle in degrees."""

    name: str
    scale: float = 1.0
    offset: float = 0.0

    def argument(self, x: Array) -> Array:
        """Argument values at the channel values `x` (n,)."""
        return x if self == ScaledChannel(self.name) else self.scale * x + self.offset

    def channel(self, argument: Array) -> Array:
        """Channel values (n,) at which the argument has the given values.

        The unit is the channel's.
        """
        return (
            argument if self == ScaledChannel(self.name) else (argument - self.offset) / self.scale
        )


def scaled_channel(argument: Expression, database: AeroDatabase) -> ScaledChannel | None:
    """Return the channel or free input (a scalar scale and offset, SI units) that an argument
    depends on linearly, directly or through variables; None for any other formula."""
    name, scale, offset = _linear(argument, database, {}) or ("", 0.0, 0.0)
    return (
        ScaledChannel(name, scale, offset)
        if name and scale != 0.0 and np.isfinite(scale + offset)
        else None
    )


def channel_of(argument: Expression, database: AeroDatabase) -> str | None:
    """Return the name of the channel or free input that an argument is, directly or through
    variables that rename it; None, and no error, for any other formula (`scaled_channel`)."""
    scaled = scaled_channel(argument, database)
    return scaled.name if scaled is not None and scaled == ScaledChannel(scaled.name) else None


_Linear = tuple[str, float, float] | None


def _linear(node: Expression, database: AeroDatabase, known: dict[str, _Linear]) -> _Linear:
    """Name, scale and offset of an expression that is linear in one channel; a constant has no name
    and only an offset; None for any other expression."""
    if isinstance(node, Number):
        return "", 0.0, node.value
    if isinstance(node, Name):
        if node.name in database.variables:
            if node.name not in known:  # once each: variables may use each other many times
                known[node.name] = _linear(
                    database.variables[node.name].expression, database, known
                )
            return known[node.name]
        if node.name in CONSTANTS:
            return "", 0.0, float(getattr(database.reference, CONSTANTS[node.name]))
        return node.name, 1.0, 0.0
    if isinstance(node, Negation):
        return _linear(Operation("-", Number(0.0), node.operand), database, known)
    if not isinstance(node, Operation) or node.operator == "^":
        return None
    left, right = _linear(node.left, database, known), _linear(node.right, database, known)
    if left is None or right is None:
        return None
    name, both = left[0] or right[0], bool(left[0] and right[0])
    if both and (left[0] != right[0] or node.operator not in "+-"):
        return None
    if node.operator in "+-":
        sign = 1.0 if node.operator == "+" else -1.0
        return name, left[1] + sign * right[1], left[2] + sign * right[2]
    if node.operator == "/":
        return (
            None if right[0] or right[2] == 0.0 else (name, left[1] / right[2], left[2] / right[2])
        )
    factor, other = (left[2], right) if right[0] else (right[2], left)
    return name, factor * other[1], factor * other[2]


def table_calls(database: AeroDatabase) -> list[TableCall]:
    """Return all table calls in terms and variables, in their order."""
    calls: list[TableCall] = []
    pending = [term.expression for term in database.terms] + [
        v.expression for v in database.variables.values()
    ]
    for expression in pending:
        nodes = [expression]
        while nodes:
            node = nodes.pop()
            nodes.extend(node.children)
            if isinstance(node, TableCall):
                calls.append(node)
    return calls


def breakpoints_over(name: str, database: AeroDatabase) -> list[Array]:
    """Breakpoints of every table that is called with channel `name`, in the channel's own unit."""
    grids = []
    for call in table_calls(database):
        if call.table in database.tables:
            axes = zip(call.arguments, database.tables[call.table].breakpoints, strict=True)
            for argument, points in axes:
                scaled = scaled_channel(argument, database)
                if scaled is not None and scaled.name == name:
                    grids.append(np.sort(scaled.channel(points)))
    return grids


def scattered_over(name: str, database: AeroDatabase) -> list[Array]:
    """Values of channel `name`, in its own unit, at the points of every table on scattered points
    that is called with it."""
    found: list[Array] = []
    for call in table_calls(database) if database.scattered else ():
        if call.table in database.scattered:
            columns = database.scattered[call.table].points.T
            for argument, values in zip(call.arguments, columns, strict=True):
                scaled = scaled_channel(argument, database)
                if scaled is not None and scaled.name == name:
                    found.append(np.sort(scaled.channel(values)))
    return found


def rebuilt(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """Apply `change` to every node of `expression`, from the leaves up."""
    parts: dict[str, Any] = {}
    for item in fields(expression):
        value = getattr(expression, item.name)
        if isinstance(value, Expression):
            parts[item.name] = rebuilt(value, change)
        elif (
            isinstance(value, tuple)
            and value
            and all(isinstance(part, Expression) for part in value)
        ):
            parts[item.name] = tuple(rebuilt(part, change) for part in value)
    return change(replace(expression, **parts) if parts else expression)
