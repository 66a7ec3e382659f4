"""The operations of JSBSim's functions, each as an expression of its operands.

Truth values are 1 and 0, as in JSBSim. Random numbers and the rotation operations
(``rotation_...``) are not supported.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Final

from aerodb.errors import InputError
from aerodb.tables import Call, Expression, Number, Operation, number, times

_Operands = list[Expression]

#: Functions of two or more operands here, one or more in JSBSim; of one operand: the operand.
_ANY_NUMBER: Final = ("min", "max", "and", "or")


@dataclass(frozen=True)
class _Operation:
    """An operation: how operands become an expression, and how many it takes.

    most : None for any number.
    """

    build: Callable[[_Operands], Expression]
    least: int = 1
    most: int | None = 1


def _fold(operator: str) -> Callable[[_Operands], Expression]:
    return lambda operands: reduce(lambda left, right: Operation(operator, left, right), operands)


def _call(function: str) -> Callable[[_Operands], Expression]:
    return lambda operands: (
        Call(function, tuple(operands))
        if len(operands) > 1 or function not in _ANY_NUMBER
        else operands[0]
    )


def _scaled(factor: float) -> Callable[[_Operands], Expression]:
    return lambda operands: times(operands[0], Number(factor))


def _choice(operands: _Operands) -> Expression:
    condition, if_true, if_false = operands
    return Call("piecewise", (if_true, condition, if_false))


def _switch(operands: _Operands) -> Expression:
    """The operand at the index to which the first one rounds.

    JSBSim stops at an index outside; here the nearest index applies.
    """
    index, values = operands[0], operands[1:]
    pieces: list[Expression] = []
    for k, chosen in enumerate(values[:-1]):
        pieces += [chosen, Call("lt", (index, Number(k + 0.5)))]
    return Call("piecewise", (*pieces, values[-1])) if pieces else values[-1]


def _sign(operands: _Operands) -> Expression:
    """The sign; JSBSim's sign of zero is 1."""
    return Call("piecewise", (number(-1), Call("lt", (operands[0], Number(0))), Number(1)))


_OPERATIONS: Final[dict[str, _Operation]] = {
    "product": _Operation(_fold("*"), most=None),
    "sum": _Operation(_fold("+"), most=None),
    "difference": _Operation(_fold("-"), most=None),
    "quotient": _Operation(_fold("/"), 2, 2),
    "pow": _Operation(_fold("^"), 2, 2),
    **{
        name: _Operation(_call(name))
        for name in ("abs", "sqrt", "exp", "sin", "cos", "tan", "asin", "acos", "atan")
    },
    **{name: _Operation(_call(name), most=None) for name in ("min", "max")},
    "atan2": _Operation(_call("atan2"), 2, 2),
    "ln": _Operation(_call("log")),
    "log2": _Operation(lambda x: Operation("/", Call("log", (x[0],)), Number(math.log(2)))),
    "log10": _Operation(_call("log10")),
    "floor": _Operation(_call("floor")),
    "ceil": _Operation(_call("ceil")),
    "fmod": _Operation(_call("rem"), 2, 2),
    "toradians": _Operation(_scaled(math.pi / 180)),
    "todegrees": _Operation(_scaled(180 / math.pi)),
    "sign": _Operation(_sign),
    "pi": _Operation(lambda _: Number(math.pi), 0, 0),
    "avg": _Operation(lambda x: Operation("/", _fold("+")(x), Number(len(x))), most=None),
    **{name: _Operation(_call(name), 2, 2) for name in ("gt", "lt", "ge", "le", "eq")},
    "nq": _Operation(_call("ne"), 2, 2),
    "and": _Operation(_call("and"), most=None),
    "or": _Operation(_call("or"), most=None),
    "not": _Operation(_call("not")),
    "ifthen": _Operation(_choice, 3, 3),
    "switch": _Operation(_switch, 2, None),
}


def build_operation(tag: str, operands: list[Expression], where: str) -> Expression | None:
    """Return the operation `tag` of `operands`; None if it is unknown.

    Raises InputError for a wrong number of operands.
    """
    operation = _OPERATIONS.get(tag)
    if operation is None:
        return None
    if len(operands) < operation.least or (
        operation.most is not None and len(operands) > operation.most
    ):
        raise InputError(f"<{tag}> with {len(operands)} operands", where)
    return operation.build(operands)
