"""The time at which a change begins, or begins and ends, that is sought over a whole flight."""

from typing import Final

import numpy as np

from aerodb.support import SMALL, Array

#: Least share of a change's squares that motion must leave of it.
LEFT: Final = 1e-6
#: Least share of a change's squares before and after the time at which it begins.
SIDE: Final = SMALL


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


def explained_within(values: Array, basis: Array, left: Array, starts: Array, ends: Array) -> Array:
    """Return what each stretch explains of the squares of `left` (n,), if `values` (n,) are added
    between its samples, (starts, ends); none where `explained_from` has none, and where the stretch
    or the rest has less than `SIDE` of the squares of the values.

    starts, ends : first samples of stretches and of what follows them, (i,) and (j,).
    """

    def total(products: Array) -> Array:
        return np.concatenate([np.zeros_like(products[:1]), np.cumsum(products, axis=0)])

    def between(sums: Array) -> Array:
        return np.asarray(sums[ends][None] - sums[starts][:, None])

    squares = total(values * values)
    spent = between(squares)
    size = spent - (between(total(basis * values[:, None])) ** 2).sum(axis=2)
    whole = float(squares[-1])
    told = (size > LEFT * spent) & (spent > SIDE * whole) & (spent < (1.0 - SIDE) * whole)
    found = between(total(left * values)) ** 2 / np.where(told, size, 1.0)
    return np.asarray(np.where(told, found, 0.0))
