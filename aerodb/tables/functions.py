"""The functions and operators of expressions: what each computes and how many arguments it takes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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


@dataclass(frozen=True)
class Function:
    """What a function name stands for: vectorised evaluation and how many arguments it takes (`most` None: any)."""

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
}

OPERATORS: Final[dict[str, Callable[..., Any]]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
}
