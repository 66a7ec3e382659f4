"""Decimation of long records for display, without losing extremes.

Used by reports and by the web console.
"""

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array

Index = NDArray[np.intp]


def extremes(values: Array, points: int) -> Index:
    """Indices of the lowest and highest value of each of several equal stretches, and both ends.

    Returns at most `points` + 2 increasing indices into `values` (n,), all of them if n is no more
    than `points`. A stretch without a finite value keeps one non-finite sample, so that a gap stays
    a gap. Raises ValueError for fewer than 2 points.

    >>> extremes(np.array([0.0, 5.0, 1.0, 1.0, -7.0, 2.0, 2.0, 2.0]), 4).tolist()
    [0, 1, 4, 5, 7]
    """
    if points < 2:
        raise ValueError(f"at least 2 points, not {points}")
    n = len(values)
    if n <= points:
        return np.arange(n)
    size = -(-n // (points // 2))
    stretches = -(-n // size)
    padded = np.full(stretches * size, np.nan)
    padded[:n] = values
    table = padded.reshape(stretches, size)
    known = np.isfinite(table)
    start = size * np.arange(stretches)
    low = start + np.argmin(np.where(known, table, np.inf), axis=1)
    high = start + np.argmax(np.where(known, table, -np.inf), axis=1)
    return np.unique(np.concatenate([[0, n - 1], low, high]))


def decimated(
    time: Array, values: Array, points: int, start: float = -np.inf, end: float = np.inf
) -> tuple[Array, Array]:
    """Decimate ``values(time)`` between `start` and `end` [s] to at most `points` + 2 samples.

    Parameters
    ----------
    time : (n,), increasing [s].
    values : (n,).
    points : see `extremes`; a shorter record keeps every sample.

    Returns
    -------
    times and values of the chosen samples, with one more sample on either side of the window, so
    that a line reaches its edges.
    """
    first = max(0, int(np.searchsorted(time, start, side="left")) - 1)
    last = min(len(time), int(np.searchsorted(time, end, side="right")) + 1)
    chosen = first + extremes(values[first:last], points)
    return time[chosen], values[chosen]


def flagged_stretches(
    time: Array, flagged: NDArray[np.bool_], most: int = 200
) -> list[tuple[float, float]]:
    """Intervals [s] of flagged samples, neighbours joined until at most `most` are left.

    >>> flagged_stretches(np.arange(5.0), np.array([False, True, True, False, True]))
    [(1.0, 2.0), (4.0, 4.0)]
    """
    edges = np.diff(np.concatenate([[0], flagged.astype(np.int8), [0]]))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if len(first) > most:
        widest = np.sort(np.argsort(time[first[1:]] - time[last[:-1]])[::-1][: most - 1])
        first, last = (
            first[np.concatenate([[0], widest + 1])],
            last[np.concatenate([widest, [len(last) - 1]])],
        )
    return [(float(time[a]), float(time[b])) for a, b in zip(first, last, strict=True)]
