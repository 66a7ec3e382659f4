"""Compiled: small symmetric systems in a batch, solved only as far as products need it."""

import numba
import numpy as np

from aerodb.support import Array, Integers


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _take_off(target: Array, factors: Array, rows: Array, count: int, first: int) -> None:
    """``target -= factors[:count] @ rows[:count, first:]``: target (m,), rows (n, first + m or
    more)."""
    whole = count - count % 4
    for j in range(0, whole, 4):
        a, b, c, d = factors[j], factors[j + 1], factors[j + 2], factors[j + 3]
        one, two, three, four = (
            rows[j, first:],
            rows[j + 1, first:],
            rows[j + 2, first:],
            rows[j + 3, first:],
        )
        for m in range(len(target)):
            target[m] -= a * one[m] + b * two[m] + c * three[m] + d * four[m]
    for j in range(whole, count):
        a, one = factors[j], rows[j, first:]
        for m in range(len(target)):
            target[m] -= a * one[m]


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _add_squares(target: Array, values: Array, weight: float) -> None:
    """``target += weight values^2``, both (m,)."""
    for m in range(len(target)):
        target[m] += weight * values[m] * values[m]


@numba.njit(cache=True, nogil=True)
def _gather(target: Array, values: Array, indices: Integers) -> None:
    """``target = values[places]``, both (m,)."""
    for m in range(len(target)):
        target[m] = values[indices[m]]


@numba.njit(cache=True, nogil=True)
def contracted(
    pairs: Array,
    beside: Array,
    members: Integers,
    extra: Array,
    v_columns: Integers,
    u_columns: Integers,
    units: Integers,
    squares: Array,
    cross_products: Array,
) -> None:
    """Compute ``U' M^-1 U`` (its diagonal) and ``V' M^-1 U`` of g systems.

    ``M = pairs[members, members] + diag(extra)``. pairs (g, N, N); beside (g, N, w); members, extra
    (n,) : which of the N. V : columns `v_columns` (v,) of the members' `beside`; U : columns
    `u_columns` (r,) of it, and the unit vectors of the members with numbers `units` (u,). squares
    (g, r + u), cross_products (g, v, r + u) : written.

    Gaussian elimination without pivoting, which is stable for a quasi-definite M in any order
    (Vanderbei, SIAM J. Optim. 5(1), 1995).
    """
    n, v, r, u = len(members), len(v_columns), len(u_columns), len(units)
    behind, end = n + r, n + r + u
    rows, over = np.zeros((n, end + v)), np.empty((v, n))
    factors, weights = np.empty(n), np.empty(n)
    for flight in range(len(pairs)):
        squares[flight], cross_products[flight] = 0.0, 0.0
        for i in range(n):
            row, side = rows[i], beside[flight, members[i]]
            _gather(row[i:n], pairs[flight, members[i]], members[i:])
            _gather(row[n:behind], side, u_columns)
            for c in range(u):
                row[behind + c] = 1.0 if units[c] == i else 0.0
            _gather(row[end:], side, v_columns)
            row[i] += extra[i]
            for j in range(i):
                factors[j] = rows[j, i] * weights[j]
            _take_off(row[i:], factors, rows, i, i)
            weights[i] = 1.0 / row[i]
            _add_squares(squares[flight], row[n:], weights[i])
            for c in range(v):
                over[c, i] = -row[end + c] * weights[i]
        for c in range(v):
            _take_off(cross_products[flight, c], over[c], rows, n, n)
