"""Logged time bases: which time stamps can be used, and the sampling interval.

This module is about time stamps only; `resampling` is about the values at those times.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.support import Array

#: Largest share of samples that may be dropped because the clock steps back; beyond it the clock is
#: refused.
TOLERATED_LOSS = 0.05
#: Largest deviation from equal steps, in steps, of a uniform time base (written with few decimals).
UNIFORM_TOLERANCE = 1e-3


@dataclass(frozen=True)
class CleanClock:
    """Samples to keep so that time strictly increases.

    keep : (n,) mask. start, end : first and last time at which samples were dropped, s.
    """

    keep: NDArray[np.bool_]
    dropped: int
    start: float | None = None
    end: float | None = None


def clean_clock(time: Array, where: str = "") -> CleanClock:
    """Return the samples of `time` (n,) [s] to keep so that the rest strictly increases.

    Non-finite stamps are dropped. Where a stamp does not exceed the one before it, the outlier of
    the two is dropped: the earlier one if it jumped ahead of its neighbours, else the later one.
    Raises InputError if more than 5 % of the samples (and more than one) would be dropped: such a
    clock runs backwards or stands still, and no choice of samples is right. `where` locates the
    error.

    >>> clean_clock(np.array([0.0, 1.0, 1.0, 2.0, 3.0])).keep
    array([ True,  True, False,  True,  True])
    """
    allowed = max(1, int(TOLERATED_LOSS * len(time)))
    index = np.flatnonzero(np.isfinite(time))
    while len(index) > 1 and len(time) - len(index) <= allowed:
        stamps = time[index]
        late = np.flatnonzero(np.diff(stamps) <= 0) + 1
        if not late.size:
            break
        before = np.where(late >= 2, stamps[np.maximum(late - 2, 0)], -np.inf)
        odd = np.where(
            (stamps[late] > before) & (stamps[late] < stamps[late - 1]) & (late >= 2),
            late - 1,
            late,
        )
        index = np.delete(index, np.unique(odd))
    index = _without_lone_ends(time, index)
    dropped = len(time) - len(index)
    if len(index) < 2 or dropped > allowed:
        lost = np.setdiff1d(np.arange(len(time)), index)
        at = (
            f" (first at sample {lost[0] + 1}, {round(float(time[lost[0]]), 3):.13g} s)"
            if lost.size
            else ""
        )
        what = f"time does not increase: {dropped} of {len(time)} samples would be dropped{at}"
        raise InputError(
            what, where, "repair the time base, or name another time field in the mapping"
        )
    keep = np.zeros(len(time), dtype=bool)
    keep[index] = True
    gone = time[~keep]
    gone = gone[np.isfinite(gone)]
    return CleanClock(
        keep, dropped, *((float(gone.min()), float(gone.max())) if gone.size else (None, None))
    )


def _without_lone_ends(time: Array, index: NDArray[np.intp]) -> NDArray[np.intp]:
    """Drop a damaged first or last stamp: 1000 times farther away than the others span."""
    if len(index) > 10:
        span = time[index[-2]] - time[index[1]]
        if time[index[-1]] - time[index[-2]] > 1000.0 * span:
            index = index[:-1]
        if time[index[1]] - time[index[0]] > 1000.0 * span:
            index = index[1:]
    return index


def interval(time: Array) -> float:
    """Return the sampling interval [s] of increasing stamps `time` (n >= 2,): the median step.

    The median is insensitive to gaps.
    """
    return float(np.median(np.diff(time)))


def is_uniform(time: Array) -> bool:
    """Return whether stamps `time` (n,) [s] have equal steps within 0.1 % of a step."""
    if len(time) < 2:
        return False
    step = (time[-1] - time[0]) / (len(time) - 1)
    return bool(
        np.max(np.abs(time - (time[0] + step * np.arange(len(time))))) <= UNIFORM_TOLERANCE * step
    )
