"""Compiled loops of table interpolation; a module of their own, so that the compiler is loaded only
when a table is evaluated."""

import numba
import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array, Integers


@numba.njit(cache=True, nogil=True)
def locate(breaks: Array, first: int, last: int, mode: int, x: float) -> tuple[int, float]:
    """Lower node of the cell of x in ``breaks[first:last + 1]``, and the weight of its upper node;
    mode as in `Table.modes`."""
    if first == last:
        return 0, x if np.isnan(x) else 0.0
    if x <= breaks[first]:
        below = first
        weight = (x - breaks[first]) / (breaks[first + 1] - breaks[first]) if mode & 4 else 0.0
    elif x >= breaks[last]:
        below = last - 1
        weight = (x - breaks[below]) / (breaks[last] - breaks[below]) if mode & 8 else 1.0
    else:
        below, length = first, last - first
        # Bisection without a branch on the data, which a processor would mispredict half the time.
        while length > 1:
            half = length // 2
            below += half if breaks[below + half] <= x else 0
            length -= half
        weight = (x - breaks[below]) / (breaks[below + 1] - breaks[below])
    way = mode & 3
    if way != 0 and not np.isnan(weight):
        upper = weight >= 0.5 if way == 1 else (weight >= 1.0 if way == 2 else weight > 0.0)
        weight = 1.0 if upper else 0.0
    return below - first, weight


@numba.njit(cache=True, nogil=True)
def interpolate(
    breaks: Array,
    starts: Integers,
    strides: Integers,
    modes: Integers,
    values: Array,
    points: Array,
    out: Array,
    outside: NDArray[np.bool_],
) -> int:
    """Multilinear interpolation of one table; returns the number of points outside the breakpoints.

    Parameters
    ----------
    breaks, starts : all breakpoints one after another; those of dimension k are
        ``breaks[starts[k]:starts[k + 1]]``.
    strides : (N,) step of `values` (flat) along each dimension.
    modes : (N,), see `Table.modes`.
    points : (N, n).
    out, outside : (n,), written. NaN gives NaN and is outside.
    """
    dimensions, n = points.shape
    step, weight = np.empty(dimensions, np.int64), np.empty(dimensions, np.float64)
    count = 0
    for i in range(n):
        beyond, base = False, 0
        for k in range(dimensions):
            first, last, x = starts[k], starts[k + 1] - 1, points[k, i]
            beyond = beyond or not (breaks[first] <= x <= breaks[last])
            low, weight[k] = locate(breaks, first, last, modes[k], x)
            base += low * strides[k]
            step[k] = strides[k] if last > first else 0
        total = 0.0
        for corner in range(1 << dimensions):
            product, index = 1.0, base
            for k in range(dimensions):
                if corner >> k & 1:
                    product *= weight[k]
                    index += step[k]
                else:
                    product *= 1.0 - weight[k]
            if product != 0.0:
                total += product * values[index]
        out[i], outside[i] = total, beyond
        count += beyond
    return count


@numba.njit(cache=True, nogil=True)
def interpolate_together(
    breaks: Array,
    starts: Integers,
    strides: Integers,
    modes: Integers,
    values: Array,
    points: Array,
    out: Array,
    outside: NDArray[np.bool_],
) -> int:
    """Multilinear interpolation of several tables with the same axes.

    As `interpolate`, with values (nodes, tables), so that the values at one node are adjacent in
    memory, and out (tables, n). The loops are written out again because one function for both cases
    is slower for a single table.

    points : (N, n), in the units of the breakpoints.
    """
    dimensions, n = points.shape
    tables = values.shape[1]
    step, weight = np.empty(dimensions, np.int64), np.empty(dimensions, np.float64)
    total = np.empty(tables, np.float64)
    count = 0
    for i in range(n):
        beyond, base = False, 0
        for k in range(dimensions):
            first, last, x = starts[k], starts[k + 1] - 1, points[k, i]
            beyond = beyond or not (breaks[first] <= x <= breaks[last])
            low, weight[k] = locate(breaks, first, last, modes[k], x)
            base += low * strides[k]
            step[k] = strides[k] if last > first else 0
        total[:] = 0.0
        for corner in range(1 << dimensions):
            product, index = 1.0, base
            for k in range(dimensions):
                if corner >> k & 1:
                    product *= weight[k]
                    index += step[k]
                else:
                    product *= 1.0 - weight[k]
            if product != 0.0:
                for table in range(tables):
                    total[table] += product * values[index, table]
        for table in range(tables):
            out[table, i] = total[table]
        outside[i] = beyond
        count += beyond
    return count
