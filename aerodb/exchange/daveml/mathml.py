"""Read MathML 2 content markup: the calculations of DAVE-ML as expressions.

``quotient`` is MathML's integer division. Files use it as a division, as do the examples of AIAA
S-119, and so does this module. Angles are in radians; inverse functions give the principal value.
"""

import math
from collections.abc import Callable
from functools import reduce
from itertools import pairwise
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.exchange.xml_elements import children, own_text, tag, unsupported
from aerodb.exchange.xml_elements import number as read_number
from aerodb.tables import FUNCTIONS, Call, Expression, Negation, Number, Operation, number

Resolve = Callable[[str], Expression]
_Operands = list[Expression]

_MAX_NESTING: Final = 100
_ONE: Final = Number(1.0)
_CONSTANTS: Final = {"pi": math.pi, "exponentiale": math.e, "true": 1.0, "false": 0.0}
_FOLDS: Final = {"plus": "+", "times": "*"}
_BETWEEN_TWO: Final = {"divide": "/", "quotient": "/", "power": "^"}
#: MathML name -> name of the equivalent function here.
_CALLS: Final = {
    "abs": "abs", "exp": "exp", "ln": "log", "floor": "floor", "ceiling": "ceil", "rem": "rem",
    "sin": "sin", "cos": "cos", "tan": "tan", "arcsin": "asin", "arccos": "acos", "arctan": "atan",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh",
    "arcsinh": "asinh", "arccosh": "acosh", "arctanh": "atanh",
    "min": "min", "max": "max", "and": "and", "or": "or", "not": "not",
    "eq": "eq", "neq": "ne", "lt": "lt", "leq": "le", "gt": "gt", "geq": "ge",
}  # fmt: skip
_RECIPROCALS: Final = {
    "sec": "cos",
    "csc": "sin",
    "cot": "tan",
    "sech": "cosh",
    "csch": "sinh",
    "coth": "tanh",
}
_INVERSE_RECIPROCALS: Final = {
    "arcsec": "acos", "arccsc": "asin", "arccot": "atan",
    "arcsech": "acosh", "arccsch": "asinh", "arccoth": "atanh",
}  # fmt: skip
_CHAINED_COMPARISONS: Final = ("eq", "lt", "leq", "gt", "geq")
_IDENTITY_OF_ONE: Final = ("min", "max", "and", "or")
_QUALIFIERS: Final = ("degree", "logbase")
_CSYMBOLS: Final = {"atan2": "atan2"}


def read_math(element: Any, resolve: Resolve, where: str) -> Expression:
    """Return the expression of a ``<math>`` element or of an element inside one.

    resolve : returns the expression that a ``<ci>`` refers to. Language: content MathML 2 (W3C
    2003).

    Raises InputError that names an unknown element, function or operand count.
    """
    return _node(element, resolve, where, 0)


def _node(element: Any, resolve: Resolve, where: str, depth: int) -> Expression:
    if depth > _MAX_NESTING:
        raise InputError(f"more than {_MAX_NESTING} levels of nesting in <math>", where)
    name = tag(element)
    if name == "ci":
        return resolve(own_text(element).strip())
    if name == "cn":
        return _constant(element, where)
    if name in _CONSTANTS:
        return number(_CONSTANTS[name])
    inner = list(children(element))
    if name == "math":
        if len(inner) != 1:
            raise InputError(
                f"<math> with {len(inner)} expressions", where, "exactly one is needed"
            )
        return _node(inner[0], resolve, where, depth + 1)
    if name == "piecewise":
        return _piecewise(inner, resolve, where, depth)
    if name == "apply" and inner:
        return _apply(inner, resolve, where, depth)
    raise unsupported(element, "<math>", where)


def _constant(element: Any, where: str) -> Expression:
    kind = element.get("type", "real")
    parts = [own_text(element)]
    separators = list(children(element))
    if separators:
        if any(tag(child) != "sep" for child in separators):
            raise unsupported(separators[0], "<cn>", where)
        parts = [element.text or "", *(child.tail or "" for child in separators)]
    values = [read_number(part, where) for part in parts]
    if kind == "rational" and len(values) == 2 and values[1] != 0:
        return number(values[0] / values[1])
    if kind == "e-notation" and len(values) == 2:
        return number(read_number(f"{parts[0].strip()}e{parts[1].strip()}", where))
    if (
        kind in ("real", "integer", "constant")
        and len(values) == 1
        and element.get("base", "10") == "10"
    ):
        return number(values[0])
    raise InputError(f"<cn> of type '{kind}' with {len(values)} parts", where)


def _piecewise(inner: list[Any], resolve: Resolve, where: str, depth: int) -> Expression:
    parts: _Operands = []
    last: _Operands = []
    for child in inner:
        operands = [_node(each, resolve, where, depth + 1) for each in children(child)]
        if tag(child) == "piece" and len(operands) == 2 and not last:
            parts += operands
        elif tag(child) == "otherwise" and len(operands) == 1 and not last:
            last = operands
        else:
            raise InputError(f"<{tag(child)}> with {len(operands)} operands in <piecewise>", where)
    if not parts:
        if last:
            return last[0]
        raise InputError("<piecewise> without a piece", where)
    return Call("piecewise", (*parts, *last))


def _apply(inner: list[Any], resolve: Resolve, where: str, depth: int) -> Expression:
    operator, rest = inner[0], inner[1:]
    name = tag(operator)
    if name in ("piecewise", "apply", "ci", "cn") and not rest:
        return _node(
            operator, resolve, where, depth + 1
        )  # files put a single <piecewise> into an <apply>
    if name == "csymbol":
        name = own_text(operator).strip()
        if name not in _CSYMBOLS:
            raise InputError(
                f"unsupported function <csymbol> '{name}'", where, f"known: {', '.join(_CSYMBOLS)}"
            )
    qualifiers: dict[str, Expression] = {}
    operands: _Operands = []
    for child in rest:
        if tag(child) in _QUALIFIERS:
            (content,) = _exactly(
                [_node(each, resolve, where, depth + 1) for each in children(child)],
                1,
                tag(child),
                where,
            )
            qualifiers[tag(child)] = content
        else:
            operands.append(_node(child, resolve, where, depth + 1))
    built = _built(name, operands, qualifiers, where)
    if built is None:
        raise unsupported(operator, "<apply>", where)
    if qualifiers:
        raise InputError(f"<{next(iter(qualifiers))}> of <{name}>", where)
    return built


def _exactly(operands: _Operands, count: int, name: str, where: str) -> _Operands:
    if len(operands) != count:
        raise InputError(f"<{name}> with {len(operands)} operands", where, f"it takes {count}")
    return operands


def _built(
    name: str, operands: _Operands, qualifiers: dict[str, Expression], where: str
) -> Expression | None:
    """The operator `name` applied to its operands; None if it is unknown.

    Qualifiers that the operator uses are removed from `qualifiers`.
    """
    if name in _FOLDS and operands:
        return reduce(lambda left, right: Operation(_FOLDS[name], left, right), operands)
    if name == "minus" and len(operands) == 1:
        return Negation(operands[0])
    if name == "minus" or name in _BETWEEN_TWO:
        left, right = _exactly(operands, 2, name, where)
        return Operation(_BETWEEN_TWO.get(name, "-"), left, right)
    if name == "root":
        (x,) = _exactly(operands, 1, name, where)
        degree = qualifiers.pop("degree", Number(2.0))
        return Call("sqrt", (x,)) if degree == Number(2.0) else Call("root", (x, degree))
    if name == "log":
        (x,) = _exactly(operands, 1, name, where)
        base = qualifiers.pop("logbase", Number(10.0))
        return (
            Call("log10", (x,))
            if base == Number(10.0)
            else Operation("/", Call("log", (x,)), Call("log", (base,)))
        )
    if name == "xor":
        return reduce(_exclusive_or, operands) if operands else None
    if name in _RECIPROCALS:
        return Operation(
            "/", _ONE, Call(_RECIPROCALS[name], tuple(_exactly(operands, 1, name, where)))
        )
    if name in _INVERSE_RECIPROCALS:
        (x,) = _exactly(operands, 1, name, where)
        return Call(_INVERSE_RECIPROCALS[name], (Operation("/", _ONE, x),))
    if name in _CHAINED_COMPARISONS and len(operands) > 2:
        return Call("and", tuple(Call(_CALLS[name], pair) for pair in pairwise(operands)))
    if name in _IDENTITY_OF_ONE and len(operands) == 1:
        return operands[0]
    function = _CSYMBOLS.get(name) or _CALLS.get(name)
    if function is None:
        return None
    takes = FUNCTIONS[function]
    if len(operands) < takes.least or (takes.most is not None and len(operands) > takes.most):
        raise InputError(
            f"<{name}> with {len(operands)} operands", where, f"it takes {takes.least}"
        )
    return Call(function, tuple(operands))


def _exclusive_or(left: Expression, right: Expression) -> Expression:
    """Exclusive or: true where the truth values differ."""
    return Call("ne", (Call("not", (left,)), Call("not", (right,))))
