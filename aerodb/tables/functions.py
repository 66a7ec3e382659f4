"""Functions and operators of expressions: their evaluation and number of arguments."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any, Final

import numpy as np

from aerodb.support import Array

Value = Array | float


def _step(x: Value) -> Array:
    return np.asarray(np.greater(x, 0.0), dtype=np.float64)


def _minimum(first: Value, *others: Value) -> Any:
    for other in others:
        first = np.minimum(first, other)
    return first


def _maximum(first: Value, *others: Value) -> Any:
    for other in others:
        first = np.maximum(first, other)
    return first


def _clip(x: Value, low: Value, high: Value) -> Any:
    return np.minimum(np.maximum(x, low), high)


def _truth(test: Callable[[Any, Any], Any]) -> Callable[[Value, Value], Array]:
    """A comparison: 1 where it holds, 0 where it does not, NaN where either side is NaN."""

    def compare(left: Value, right: Value) -> Array:
        return np.where(np.isnan(left) | np.isnan(right), np.nan, test(left, right))

    return compare


def _all(first: Value, *others: Value) -> Any:
    """1 where every condition holds, 0 elsewhere; NaN where a condition is NaN."""
    return np.sign(reduce(np.multiply, others, np.abs(first)))


def _any(first: Value, *others: Value) -> Any:
    return np.sign(reduce(lambda total, other: np.add(total, np.abs(other)), others, np.abs(first)))


def _not(condition: Value) -> Any:
    return 1.0 - np.sign(np.abs(condition))


def _piecewise(*pieces: Value) -> Any:
    """The first value whose condition holds, of value, condition, value, condition, ..., otherwise.

    NaN where no condition holds and the last value is missing, and where a condition is NaN.
    """
    result: Any = pieces[-1] if len(pieces) % 2 else np.nan
    for value, condition in reversed(list(zip(pieces[:-1:2], pieces[1::2], strict=True))):
        result = np.where(
            np.isnan(condition), np.nan, np.where(np.not_equal(condition, 0.0), value, result)
        )
    return result


def _root(x: Value, degree: Value) -> Any:
    """The real root; of negative numbers only where the degree is odd, else NaN."""
    size = np.power(np.abs(x), np.divide(1.0, degree))
    real = np.where(np.fmod(np.abs(degree), 2.0) == 1.0, np.copysign(size, x), np.nan)
    return np.where(np.less(x, 0.0), real, size)


@dataclass(frozen=True)
class Function:
    """A function of expressions: vectorised evaluation, and the least and most arguments it takes
    (`most` None: any number)."""

    evaluate: Callable[..., Any]
    least: int = 1
    most: int | None = 1


FUNCTIONS: Final[dict[str, Function]] = {
    "abs": Function(np.abs),
    "min": Function(_minimum, 2, None),
    "max": Function(_maximum, 2, None),
    "sqrt": Function(np.sqrt),
    "exp": Function(np.exp),
    "log": Function(np.log),
    "sin": Function(np.sin),
    "cos": Function(np.cos),
    "tan": Function(np.tan),
    "asin": Function(np.arcsin),
    "acos": Function(np.arccos),
    "atan": Function(np.arctan),
    "atan2": Function(np.arctan2, 2, 2),
    "sign": Function(np.sign),
    "step": Function(_step),
    "clip": Function(_clip, 3, 3),
    "log10": Function(np.log10),
    "sinh": Function(np.sinh),
    "cosh": Function(np.cosh),
    "tanh": Function(np.tanh),
    "asinh": Function(np.arcsinh),
    "acosh": Function(np.arccosh),
    "atanh": Function(np.arctanh),
    "floor": Function(np.floor),
    "ceil": Function(np.ceil),
    "rem": Function(np.fmod, 2, 2),
    "root": Function(_root, 2, 2),
    "lt": Function(_truth(np.less), 2, 2),
    "le": Function(_truth(np.less_equal), 2, 2),
    "gt": Function(_truth(np.greater), 2, 2),
    "ge": Function(_truth(np.greater_equal), 2, 2),
    "eq": Function(_truth(np.equal), 2, 2),
    "ne": Function(_truth(np.not_equal), 2, 2),
    "and": Function(_all, 2, None),
    "or": Function(_any, 2, None),
    "not": Function(_not),
    "piecewise": Function(_piecewise, 2, None),
}

#: Name of a comparison -> its symbol; true is 1, false is 0.
COMPARISONS: Final[dict[str, str]] = {
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "eq": "==",
    "ne": "!=",
}

OPERATORS: Final[dict[str, Callable[..., Any]]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
}
