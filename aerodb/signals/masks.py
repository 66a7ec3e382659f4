"""Stretches of samples in a mask."""

import numpy as np

from aerodb.support import Mask


def runs(mask: Mask, shortest: int = 1, bridge: int = 0) -> list[tuple[int, int]]:
    """Return first and last index of every run of true of at least `shortest` samples.

    Gaps of up to `bridge` samples are closed.

    >>> runs(np.array([True, True, False, True, False, False, True]), shortest=2, bridge=1)
    [(0, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    joined: list[tuple[int, int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if joined and first - joined[-1][1] - 1 <= bridge:
            joined[-1] = (joined[-1][0], end - 1)
        else:
            joined.append((first, end - 1))
    return [(first, last) for first, last in joined if last - first + 1 >= shortest]
