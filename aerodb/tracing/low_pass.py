"""The compiled low-pass of tracing: one column in, every so manieth sample of what is below the band's edge out."""

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _at(values: Array, taps: Array, centre: int) -> float:
    """The symmetric filter at one sample; beyond the ends the column goes on as its point reflection about them."""
    half, last = len(taps) // 2, len(values) - 1
    total = 0.0
    if centre >= half and centre + half <= last:
        part = values[centre - half : centre + half + 1]
        for k in range(len(taps)):
            total += taps[k] * part[k]
        return total
    for k in range(len(taps)):
        place = centre - half + k
        if place < 0:
            total += taps[k] * (2.0 * values[0] - values[-place])
        elif place > last:
            total += taps[k] * (2.0 * values[last] - values[2 * last - place])
        else:
            total += taps[k] * values[place]
    return total


@numba.njit(cache=True, nogil=True)
def decimate(values: Array, taps: Array, ratio: int, left_out: int, out: Array) -> None:
    """Filters `values` (n,) with `taps` (an odd number, half of them less than n) at samples ``(left_out + i) * ratio``.

    out : (m,), written.
    """
    for i in range(len(out)):
        out[i] = _at(values, taps, (left_out + i) * ratio)


@numba.njit(cache=True, nogil=True)
def bridged(values: Array, gaps: Integers) -> Array:
    """`values` (n,) with straight lines over `gaps`, (g, 2): first and last sample; at the ends the nearest value."""
    found = values.copy()
    for first, last in gaps:
        if first == 0 or last == len(found) - 1:
            found[first : last + 1] = values[last + 1] if first == 0 else values[first - 1]
            continue
        start, slope = values[first - 1], (values[last + 1] - values[first - 1]) / (last - first + 2)
        for place in range(first, last + 1):
            found[place] = start + slope * (place - first + 1)
    return found
