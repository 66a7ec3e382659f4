"""The compiled loop of `backlash.played`."""

import numpy as np
from numba import njit

from aerodb.support import Array


@njit(cache=True, nogil=True)
def follow(values: Array, half_width: float) -> Array:
    """The output (n,) of a play that begins in the middle; in the unit of `values` (n,)."""
    found = np.empty(len(values))
    at = values[0]
    for number in range(len(values)):
        low, high = values[number] - half_width, values[number] + half_width
        if low > at:
            at = low
        if high < at:
            at = high
        found[number] = at
    return found
