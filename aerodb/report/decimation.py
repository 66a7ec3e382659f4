"""Long records for a screen or a page: fewer points, in which no extreme is lost. Used by reports
and the web console alike."""

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array

Index = NDArray[np.intp]


def extremes(values: Array, points: int) -> Index:
    """Indices, rising, of at most `points` + 2 of `values` (n,): the lowest and the highest of each
    stretch, and both ends.

    Stretches are equally long; all indices come back when n is no more than `points`. A stretch
    without a finite value is kept as one that is not, so that a gap stays a gap. Raises ValueError
    for fewer than 2 points.

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
    """What to draw of ``values(time)`` between `start` and `end` [s]: at most `points` + 2 samples;
    every one where that many do.

    time (n,) rising, values (n,). One sample more on either side lets a line reach the edge of the
    window.
    """
    first = max(0, int(np.searchsorted(time, start, side="left")) - 1)
    last = min(len(time), int(np.searchsorted(time, end, side="right")) + 1)
    chosen = first + extremes(values[first:last], points)
    return time[chosen], values[chosen]


def flagged_stretches(
    time: Array, flagged: NDArray[np.bool_], most: int = 200
) -> list[tuple[float, float]]:
    """From when to when [s] samples are flagged; of more than `most` stretches, neighbours are
    joined until so many are left.

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
