"""Play between what moves and what follows: the follower rests until the other has crossed it."""

import numpy as np

from aerodb.support import Array


def played(values: Array, half_width: float) -> Array:
    """Return the output (n,) of a play of `half_width` that begins in the middle; both in the unit
    of `values` (n,).

    It follows with half a width of slack to either side (Tao & Kokotovic, Adaptive Control of
    Systems with Actuator and Sensor Nonlinearities, 1996, eq. 2.3):

    >>> played(np.array([0.0, 0.2, 0.5, 0.4, 0.2, 0.0]), 0.1).round(2).tolist()
    [0.0, 0.1, 0.4, 0.4, 0.3, 0.1]
    """
    from aerodb.signals.play import follow  # numba is slow to import

    return follow(np.asarray(values, dtype=np.float64), half_width)
