"""Predictions of a database: the result, and its evaluation in blocks of points."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array
from aerodb.tables.functions import Value

#: Points evaluated in one pass. With more, the intermediate values no longer fit the processor's
#: cache. Not a power of two: rows of such a length map to the same cache lines, which doubles the
#: time.
BLOCK: Final = 4000


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted coefficients on the six body axes, and of hinge moments.

    Parameters
    ----------
    coefficients : axis -> (n,); moments about the database's own moment reference.
    outside : (n,) true where any argument of any table lies outside its breakpoints.
    outside_tables : table name -> (n,), only for tables with at least one such point.
    """

    coefficients: dict[str, Array]
    outside: NDArray[np.bool_]
    outside_tables: Mapping[str, NDArray[np.bool_]]


def length_of(channels: Mapping[str, Value]) -> int:
    """Return the number of points (n,) of channels; 1 of numbers alone."""
    return max((np.size(value) for value in channels.values()), default=1)


def blocks(values: Mapping[str, Value], n: int) -> Iterator[tuple[int, dict[str, Value]]]:
    """Yield consecutive blocks of the values (n,), each with the index of its first sample;
    numbers unchanged."""
    for start in range(0, n, BLOCK):
        part = slice(start, start + BLOCK)
        yield (
            start,
            {
                name: value[part] if isinstance(value, np.ndarray) and value.size > 1 else value
                for name, value in values.items()
            },
        )


def joined(parts: list[Prediction], n: int) -> Prediction:
    """Join the predictions of consecutive blocks into one of length n."""
    coefficients = {
        axis: np.concatenate([block.coefficients[axis] for block in parts])
        for axis in parts[0].coefficients
    }
    beyond: dict[str, NDArray[np.bool_]] = {}
    for k, block in enumerate(parts):
        for table, where in block.outside_tables.items():
            if table not in beyond:
                beyond[table] = np.zeros(n, dtype=np.bool_)
            beyond[table][k * BLOCK : (k + 1) * BLOCK] = where
    return Prediction(coefficients, np.concatenate([block.outside for block in parts]), beyond)
