"""The time at which a change begins that is sought over a whole flight."""

from typing import Final

import numpy as np

from aerodb.support import Array

#: Least share of a change's squares that motion must leave of it.
LEFT: Final = 1e-6
#: Least share of a change's squares before and after the time at which it begins.
SIDE: Final = 0.1


def explained_from(values: Array, basis: Array, left: Array) -> Array:
    """Return what each sample explains of the squares of `left` (n,), if `values` (n,) are added
    from it on, (n,); none where `basis` (n, k, orthonormal) leaves a smaller part than `LEFT` of
    their squares, and near the ends (`SIDE`).

    Source: a change point (Chow, Econometrica 28, 1960), for all samples at once.
    """

    def later(products: Array) -> Array:
        return np.cumsum(products[::-1], axis=0)[::-1]

    squares = later(values * values)
    size = squares - (later(basis * values[:, None]) ** 2).sum(axis=1)
    told = size > LEFT * squares
    found = np.where(told, later(left * values) ** 2 / np.where(told, size, 1.0), 0.0)
    spent = np.cumsum(values * values)
    found[(spent < SIDE * spent[-1]) | (spent > (1.0 - SIDE) * spent[-1])] = 0.0
    return np.asarray(found)
