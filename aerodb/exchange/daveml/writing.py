"""Write expressions as MathML 2 content markup, and lists of numbers as text.

`aerodb.exchange.daveml.mathml` reads the markup.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from aerodb.tables import Call, Expression, Name, Negation, Number, Operation, TableCall, number

MATHML: Final = "http://www.w3.org/1998/Math/MathML"
_ATAN2: Final = "http://daveml.org/function_spaces.html#atan2"

_OPERATORS: Final = {"+": "plus", "-": "minus", "*": "times", "/": "divide", "^": "power"}
_CALLS: Final = {
    "abs": "abs", "exp": "exp", "log": "ln", "log10": "log", "sqrt": "root",
    "floor": "floor", "ceil": "ceiling", "rem": "rem",
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "arcsin", "acos": "arccos", "atan": "arctan",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh",
    "asinh": "arcsinh", "acosh": "arccosh", "atanh": "arctanh",
    "min": "min", "max": "max", "and": "and", "or": "or", "not": "not",
    "eq": "eq", "ne": "neq", "lt": "lt", "le": "leq", "gt": "gt", "ge": "geq",
}  # fmt: skip

Refer = Callable[[Expression], str]


def write_math(expression: Expression, refer: Refer) -> Any:
    """Return the ``<math>`` element of an expression.

    refer : returns the id of a name or a table call.
    """
    math = etree.Element(f"{{{MATHML}}}math", nsmap={None: MATHML})
    _write(math, expression, refer)
    return math


def text_number(value: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(float(value))


def text_numbers(values: NDArray[np.float64]) -> str:
    """Return numbers separated by commas, a line for each run along the last axis.

    values : array of any shape, in the unit of the file.
    """
    rows = np.atleast_2d(values.reshape(-1, values.shape[-1]) if values.ndim > 1 else values)
    return (
        "\n"
        + ",\n".join(", ".join(text_number(value) for value in row.tolist()) for row in rows)
        + "\n"
    )


def _element(parent: Any, name: str, text: str | None = None) -> Any:
    element = etree.SubElement(parent, f"{{{MATHML}}}{name}")
    element.text = text
    return element


def _write(parent: Any, node: Expression, refer: Refer) -> None:
    if isinstance(node, (Name, TableCall)):
        _element(parent, "ci", refer(node))
    elif isinstance(node, Number):
        _element(parent, "cn", text_number(node.value))
    elif isinstance(node, Negation) and isinstance(node.operand, Number):
        _element(parent, "cn", text_number(-node.operand.value))
    elif isinstance(node, Negation):
        _apply(parent, "minus", (node.operand,), refer)
    elif isinstance(node, Operation):
        _apply(parent, _OPERATORS[node.operator], _operands(node), refer)
    elif isinstance(node, Call):
        _call(parent, node, refer)
    else:
        raise TypeError(f"{type(node).__name__} is not an expression node")


def _operands(node: Operation) -> tuple[Expression, ...]:
    """Operands of an operation.

    A sum or product includes the chain on its left, because readers fold it from the left.
    """
    operands: list[Expression] = [node.right]
    rest = node.left
    while node.operator in "+*" and isinstance(rest, Operation) and rest.operator == node.operator:
        operands.append(rest.right)
        rest = rest.left
    return (rest, *reversed(operands))


def _apply(parent: Any, operator: str, operands: tuple[Expression, ...], refer: Refer) -> Any:
    apply = _element(parent, "apply")
    first = _element(apply, operator)
    for operand in operands:
        _write(apply, operand, refer)
    return first


def _call(parent: Any, node: Call, refer: Refer) -> None:
    function, arguments = node.function, node.arguments
    if function in _CALLS:
        _apply(parent, _CALLS[function], arguments, refer)
    elif function == "atan2":
        symbol = _apply(parent, "csymbol", arguments, refer)
        symbol.text = "atan2"
        symbol.set("encoding", "text")
        symbol.set("definitionURL", _ATAN2)
    elif function == "root":
        first = _apply(parent, "root", arguments[:1], refer)
        degree = _element(first.getparent(), "degree")
        first.addnext(degree)
        _write(degree, arguments[1], refer)
    elif function == "piecewise":
        _piecewise(parent, arguments, refer)
    else:
        _write(parent, _equivalent(function, arguments), refer)


def _piecewise(parent: Any, arguments: tuple[Expression, ...], refer: Refer) -> None:
    piecewise = _element(parent, "piecewise")
    for value, condition in zip(arguments[:-1:2], arguments[1::2], strict=True):
        piece = _element(piecewise, "piece")
        _write(piece, value, refer)
        _write(piece, condition, refer)
    if len(arguments) % 2:
        _write(_element(piecewise, "otherwise"), arguments[-1], refer)


def _equivalent(function: str, arguments: tuple[Expression, ...]) -> Expression:
    """An equivalent of a function that MathML lacks."""
    x, zero, one = arguments[0], number(0.0), number(1.0)
    if function == "clip":
        return Call("min", (Call("max", (x, arguments[1])), arguments[2]))
    if function == "step":
        return Call("piecewise", (one, Call("gt", (x, zero)), zero))
    if function == "sign":
        return Call(
            "piecewise", (one, Call("gt", (x, zero)), Negation(one), Call("lt", (x, zero)), x)
        )
    raise TypeError(f"no MathML for the function {function}")
