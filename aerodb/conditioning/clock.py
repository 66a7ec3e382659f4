"""Clocks: what of a logged time base can be used, and what its sampling interval is.

Here are rules about time stamps only; values at those times are for `resampling`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.support import Array

#: Share of samples that may be dropped for a clock that steps back; beyond it the clock is not a
#: clock.
TOLERATED_LOSS = 0.05
#: Deviation from equal steps, in steps, up to which a time base counts as uniform (written with few
#: decimals).
UNIFORM_TOLERANCE = 1e-3


@dataclass(frozen=True)
class CleanClock:
    """Samples to keep (n,) so that time strictly increases, and the first and last time [s] at
    which some were dropped."""

    keep: NDArray[np.bool_]
    dropped: int
    start: float | None = None
    end: float | None = None


def clean_clock(time: Array, where: str = "") -> CleanClock:
    """Finds the samples of `time` (n,) [s] to drop so that the rest strictly increases.

    A stamp that is not finite goes. Where a stamp does not exceed the one before it, the odd one of
    the two goes: the earlier one if it jumped ahead of its neighbours, else the later one. Raises
    InputError when more than 5 % (and more than one) would have to go: such a clock runs backwards
    or stands still, and no choice of samples is right.

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
        at = f" (first at sample {lost[0] + 1}, {time[lost[0]]:.6g} s)" if lost.size else ""
        what = f"time does not increase: {dropped} of {len(time)} samples would have to go{at}"
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
    """Drops a first or last stamp that is 1000 times further away than all others are long: a
    damaged stamp."""
    if len(index) > 10:
        span = time[index[-2]] - time[index[1]]
        if time[index[-1]] - time[index[-2]] > 1000.0 * span:
            index = index[:-1]
        if time[index[1]] - time[index[0]] > 1000.0 * span:
            index = index[1:]
    return index


def interval(time: Array) -> float:
    """Sampling interval [s] of increasing stamps `time` (n >= 2,): the median step, so that gaps do
    not count."""
    return float(np.median(np.diff(time)))


def is_uniform(time: Array) -> bool:
    """Whether stamps `time` (n,) [s] lie on equal steps within 0.1 % of a step."""
    if len(time) < 2:
        return False
    step = (time[-1] - time[0]) / (len(time) - 1)
    return bool(
        np.max(np.abs(time - (time[0] + step * np.arange(len(time))))) <= UNIFORM_TOLERANCE * step
    )
