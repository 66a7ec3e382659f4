"""Recognition of control inputs: pulse, step, doublet, 2-1-1, 1-2-1, 3-2-1-1, sweep, multistep.

An input departs from a steady trim position and returns to it. The durations of its pulses to
alternating sides, each between two crossings of 0.45 of the largest deflection, determine its name.
Definitions: Hamel & Jategaonkar, "Evolution of Flight Vehicle System Identification", J. Aircraft
33(1), 1996; Marchand's 3-2-1-1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from aerodb.signals import bridge
from aerodb.support import Array

DEGREE = np.pi / 180
#: Largest range of a surface that is left alone [rad]; an input goes twice as far.
ALONE = 0.225 * DEGREE
#: Change of an angle that is made on purpose [rad]: a plain input, a new position of a flap,
#: another pitch. Pilots make such inputs all the time.
INTENDED = 1.0 * DEGREE
#: Time for which a surface, a position or a load factor is held to be one [s].
HELD = 1.0
#: Time over which a quiet surface is looked for [s]: the pulses of a doublet rest no longer.
QUIET = 0.8
#: Time after which a state has settled: a new trim, steady flight, a stay on the ground [s].
#: Shorter records determine no state of their own.
SETTLED = 5.0
#: How many times the motion around it an input must be, not to follow from it.
ABOVE_ACTIVITY = 4.0
#: Longest input [s].
LONGEST = 120.0
#: Part of the largest deflection that bounds a pulse.
PULSE_LEVEL = 0.45
#: Part of the largest deflection within which a surface counts as back at trim.
HOME_LEVEL = 0.3
#: Stretch [s] before and after an input that says how restless the surface is anyway.
SURROUNDINGS = 30.0
#: A single deflection longer than this [s] is a step.
LONGEST_PULSE = 3.0
#: How far (rms of the logarithm) durations may be from a pattern's.
PATTERN_TOLERANCE = 0.33
PATTERNS = {
    (1, 1): "doublet",
    (2, 1, 1): "2-1-1",
    (1, 2, 1): "1-2-1",
    (3, 2, 1, 1): "3-2-1-1",
    (1, 1, 1, 1): "doublet",
}
PLAIN = ("pulse", "step", "multistep")
#: Fewest pulses of a sweep.
FEWEST_OF_SWEEP = 6
#: Ratio by which a sweep's first pulse must outlast its last (or the reverse).
SWEEP_RATIO = 1.8


@dataclass(frozen=True)
class Input:
    """One input on one surface: samples first..last, `durations` [s] of its pulses, `deflection`
    [rad]: the largest from trim, with the sign of the first pulse; `name` as above."""

    name: str
    first: int
    last: int
    durations: tuple[float, ...]
    deflection: float


def rolling_range(values: Array, samples: int) -> Array:
    """Highest minus lowest of `samples` values around each (n,)."""
    size = max(samples, 2)
    result: Array = maximum_filter1d(values, size, mode="nearest") - minimum_filter1d(
        values, size, mode="nearest"
    )
    return result


def rank_correlation(values: Array) -> float:
    """Return Spearman's rank correlation of values (n,) with their order; zero if all are equal.

    Equal values have the mean of their ranks. `scipy.stats` has the same, and takes longer to
    import than ten minutes of flight to segment.

    >>> rank_correlation(np.array([1.0, 2.0, 2.0, 9.0])).__round__(3)  # sqrt(0.9)
    0.949
    """
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    if len(count) < 2:
        return 0.0
    rank = (np.cumsum(count) - 0.5 * count)[place]
    return float(np.corrcoef(np.arange(len(values)), rank)[0, 1])


def inputs(deflection: Array, step: float) -> tuple[Input, ...]:
    """Return the inputs on a surface with `deflection` (n,) [rad] at uniform `step` [s], in order.

    A surface that is never steady before or after (turbulence, an active autopilot) has none, nor
    has one whose deflection is below 0.45 deg or four times its usual motion nearby. A change of
    trim that is held is a step.
    """
    values = median_filter(bridge(deflection), 3, mode="nearest")
    width = max(4, round(QUIET / step))
    activity = rolling_range(values, width)
    quiet = activity <= ALONE
    shapes: list[Input] = []
    at = int(np.argmax(quiet)) if quiet.any() else len(values)
    while at < len(values):
        moving = np.flatnonzero(~quiet[at:])
        if not moving.size:
            break
        start = at + int(moving[0])
        trim = float(np.median(values[max(0, start - width // 2) : start + 1]))
        end = _back(values, quiet, start, trim, step)
        if end is None:
            break
        shape = _shape(values[start : end + 1] - trim, step, start)
        if shape is not None and abs(shape.deflection) > ABOVE_ACTIVITY * _restlessness(
            activity, start, end, step
        ):
            shapes.append(shape)
        at = end
    return tuple(shapes)


def _back(
    values: Array, quiet: NDArray[np.bool_], start: int, trim: float, step: float
) -> int | None:
    """Sample at which the surface is back at trim to stay, or rests for long elsewhere; None when
    the record ends first."""
    stay, rest = max(2, round(HELD / step)), round(SETTLED / step)
    longest = round(LONGEST / step)
    for reach in (longest // 8, longest):  # most are back soon
        stop = min(len(values), start + reach)
        departure = np.abs(values[start:stop] - trim)
        home = departure <= np.maximum(ALONE, HOME_LEVEL * np.maximum.accumulate(departure))
        still = quiet[start:stop]
        back = still & _lasts(home, stay, partly=stay // 2 + 1) | _lasts(still, rest, partly=rest)
        if back.any() and (reach == longest or int(np.argmax(back)) + rest < stop - start):
            return start + int(np.argmax(back))
    return stop - 1 if stop < len(values) else None


def _lasts(mask: NDArray[np.bool_], samples: int, partly: int) -> NDArray[np.bool_]:
    """(n,) whether `mask` stays true for `samples` from here on, or to the end of the record if
    that is `partly` or more."""
    here = np.arange(len(mask))
    broken = np.minimum.accumulate(np.where(mask, len(mask), here)[::-1])[::-1]
    length = broken - here
    return np.asarray(
        (length >= samples) | ((length == len(mask) - here) & (length >= partly)), dtype=bool
    )


def _restlessness(activity: Array, start: int, end: int, step: float) -> float:
    """Usual range of motion around an input, itself left out."""
    reach = round(SURROUNDINGS / step)
    around = np.concatenate(
        [activity[max(0, start - reach) : start], activity[end + 1 : end + 1 + reach]]
    )
    return float(np.quantile(around, 0.75)) if around.size else 0.0


def _shape(departure: Array, step: float, first: int) -> Input | None:
    """The input that a departure from trim (k,) [rad] is; None when it is too small."""
    size = float(np.max(np.abs(departure)))
    if size < 2.0 * ALONE:
        return None
    side = np.where(np.abs(departure) > PULSE_LEVEL * size, np.sign(departure), 0.0)
    out = np.flatnonzero(side)
    changes = np.flatnonzero(np.diff(side[out])) if len(out) > 1 else np.zeros(0, dtype=int)
    edges = np.array([out[0], *(0.5 * (out[changes] + out[changes + 1])), out[-1] + 1.0])
    durations = tuple(float(d) for d in np.diff(edges) * step)
    name = _name(durations)
    if abs(departure[-1]) > PULSE_LEVEL * size:  # rests elsewhere
        name = "step" if len(durations) == 1 else "multistep"
    if name in PLAIN and size < INTENDED:
        return None
    return Input(name, first, first + int(out[-1]), durations, size * float(side[out[0]]))


def _name(durations: tuple[float, ...]) -> str:
    """Name of a sequence of pulses by their durations [s].

    >>> _name((3.1, 1.9, 1.0, 1.1)), _name((0.9, 1.0)), _name((8.0,))
    ('3-2-1-1', 'doublet', 'step')
    """
    if len(durations) == 1:
        return "pulse" if durations[0] <= LONGEST_PULSE else "step"
    logs = np.log(durations)
    distances = {}
    for pattern in PATTERNS:
        if len(pattern) == len(durations):
            difference = logs - np.log(pattern)
            distances[pattern] = float(np.std(difference))
    if distances and min(distances.values()) <= PATTERN_TOLERANCE:
        return PATTERNS[min(distances, key=distances.__getitem__)]
    if len(durations) >= FEWEST_OF_SWEEP:
        order = rank_correlation(np.array(durations))
        ends = float(abs(np.mean(logs[:2]) - np.mean(logs[-2:])))
        if abs(order) > 0.7 and ends > np.log(SWEEP_RATIO):
            return "sweep"
    return "multistep"
