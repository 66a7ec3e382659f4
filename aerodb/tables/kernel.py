"""The compiled loop of table look-up. Kept apart so that nothing loads the compiler before a table is evaluated."""

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@numba.njit(cache=True)
def interpolate(
    breaks: Array, starts: Integers, strides: Integers, values: Array, points: Array, out: Array, outside: NDArray[np.bool_]
) -> int:
    """Multilinear interpolation, held outside the breakpoints; returns how many points lie outside.

    breaks : all breakpoints one after another, those of dimension k in ``starts[k]:starts[k + 1]``. strides : step of
    `values` (flat) along each dimension. points : (N, n). out, outside : (n,), written. NaN gives NaN and is outside.
    """
    dimensions, n = points.shape
    low = np.empty(dimensions, np.int64)
    step = np.empty(dimensions, np.int64)
    weight = np.empty(dimensions, np.float64)
    count = 0
    for i in range(n):
        beyond, base = False, 0
        for k in range(dimensions):
            first, last, x = starts[k], starts[k + 1] - 1, points[k, i]
            beyond = beyond or not (breaks[first] <= x <= breaks[last])
            if x <= breaks[first] or first == last:
                low[k], weight[k] = 0, x if np.isnan(x) else 0.0
            elif x >= breaks[last]:
                low[k], weight[k] = last - first - 1, 1.0
            else:
                below, above = first, last
                while above - below > 1:
                    middle = (below + above) // 2
                    if breaks[middle] <= x:
                        below = middle
                    else:
                        above = middle
                low[k] = below - first
                weight[k] = (x - breaks[below]) / (breaks[above] - breaks[below])
            base += low[k] * strides[k]
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
