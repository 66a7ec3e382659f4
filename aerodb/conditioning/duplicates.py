"""Detection of records that share samples: the same flight, whole or in part, however resampled.

Landmarks are the turning points of low-passed channels. Six in a row give a mark: five differences
of height and five of time, coarsely rounded, which do not depend on the start of the record, a
constant bias or the sampling rate. With six, two flights of an hour have no mark in common by
chance (with four, about a hundred). Marks are integers that a catalogue can look up, and find
candidates cheaply. `shared_samples` then compares the channels: the motion of all rates and
accelerations, and the flight condition, because a programme of inputs flown twice gives similar
motion at another speed or height. The idea of landmark marks is that of A. Wang,
"An Industrial-Strength Audio Search Algorithm", ISMIR 2003.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.support import Array

#: Channels that a fingerprint is taken from, each with the least difference [SI] between turning
#: points that counts.
LANDMARK_CHANNELS = {
    "p": 2e-3,
    "q": 2e-3,
    "r": 2e-3,
    "az_imu": 0.05,
    "ay_imu": 0.02,
    "az": 0.05,
    "ay": 0.02,
}
#: Channels of the flight condition: those that a repeat has in common as they are, and those that
#: may be counted from elsewhere.
ABSOLUTE_CHANNELS = ("V", "qbar", "altitude", "phi", "theta", "psi", "latitude", "longitude")
RELATIVE_CHANNELS = ("ax", "ax_imu", "north", "east")
#: What storing numbers in single precision costs, relative to the largest.
_SINGLE_PRECISION = 1e-6
#: Time constant of the low pass before turning points are looked for [s]. It reaches four of them
#: to each side: so far from ends and flags nothing is compared.
BLUR = 0.15
#: Number of differences of height and of time in a mark.
LENGTH = 5
#: Rounding of the natural logarithm of a height.
HEIGHT_STEP = 0.15
#: Rounding of a difference of time [s].
TIME_STEP = 0.1
#: Longest difference of time in a mark [s].
LONGEST_WAIT = 9.9
#: Marks in common, at one offset in time, from which two records are compared sample by sample.
FEWEST_MARKS = 2
#: Two records agree where the difference of each channel stays below this part of the channel's own
#: motion.
AGREEMENT = 0.05
#: Shortest stretch [s] that counts as shared.
SHORTEST_SHARED = 2.0
#: Pairs of equal marks that are looked at for offsets, rare marks first: a periodic motion repeats
#: its own endlessly.
MOST_PAIRS = 20_000
#: Offsets in time, best supported first, at which two records are compared: each costs a pass over
#: the samples.
MOST_OFFSETS = 20
#: Knuth's multiplier and increment (MMIX) that mix the parts of a mark into 64 bits.
_MULTIPLIER, _INCREMENT = np.uint64(6364136223846793005), np.uint64(1442695040888963407)


@dataclass(frozen=True)
class Shared:
    """A stretch that two records share: ``start_a..end_a`` [s] of the one are ``start_b..end_b`` of
    the other; samples of the first; the channels compared, and their largest rms difference
    relative to their motion."""

    start_a: float
    end_a: float
    start_b: float
    end_b: float
    samples: int
    channels: tuple[str, ...]
    difference: float


def fingerprint(flight: Flight) -> frozenset[int]:
    """Return the marks (integers below 2^63) of a flight's rates and accelerations.

    Two flights with marks in common may share samples. A record without motion, or with fewer than
    six turning points, has none. Resampled copies share most marks, not all: look for several.

    From samples (n,) of p, q, r [rad/s] and accelerations [m/s^2].
    """
    return frozenset(_marks(flight))


def shared_samples(a: Flight, b: Flight) -> tuple[Shared, ...]:
    """Return the stretches of `a` that are also in `b`, each with its own offset in time.

    Offsets come from marks in common; then all rates and accelerations of both, low-passed alike,
    must agree within 5 % of their motion, biases apart, for two seconds or more, and the channels
    of the flight condition, as far as both have them, within that and their noise: a copy with
    another altitude datum or another airspeed calibration is not recognised.
    """
    offsets = _offsets(_marks(a), _marks(b))
    names = tuple(name for name in LANDMARK_CHANNELS if name in a and name in b)
    stretches: list[Shared] = []
    taken = np.zeros(len(a.time), dtype=bool)
    for offset in _common_offsets(offsets)[:MOST_OFFSETS]:
        if np.count_nonzero(~taken) * a.step < SHORTEST_SHARED:
            break
        agreed = _agreement(a, b, offset, names)
        if agreed is None:
            continue
        for first, last in _runs(agreed.where & ~taken):
            if a.time[last] - a.time[first] >= SHORTEST_SHARED:
                taken[first : last + 1] = True
                start, end = float(a.time[first]), float(a.time[last])
                stretches.append(
                    Shared(
                        start,
                        end,
                        start + agreed.offset,
                        end + agreed.offset,
                        last - first + 1,
                        names,
                        agreed.difference,
                    )
                )
    return tuple(sorted(stretches, key=lambda shared: shared.start_a))


def _offsets(ours: dict[int, list[float]], theirs: dict[int, list[float]]) -> Array:
    """Differences in time [s] between equal marks of two records, at most about MOST_PAIRS."""
    offsets: list[float] = []
    for mark in sorted(
        ours.keys() & theirs.keys(), key=lambda mark: (len(ours[mark]) * len(theirs[mark]), mark)
    ):
        there = theirs[mark][:MOST_PAIRS]
        pairs = np.subtract.outer(there, ours[mark][: max(1, MOST_PAIRS // len(there))]).ravel()
        if offsets and len(offsets) + len(pairs) > MOST_PAIRS:
            break
        offsets += pairs.tolist()
    return np.array(offsets)


def _marks(flight: Flight) -> dict[int, list[float]]:
    """Mark -> times [s] of its first landmark."""
    marks: dict[int, list[float]] = {}
    for number, (name, least) in enumerate(LANDMARK_CHANNELS.items()):
        if name not in flight:
            continue
        time, height = _turning_points(flight, name, least)
        rise, wait = np.diff(height), np.diff(time)
        count = len(rise) - LENGTH + 1
        if count < 1:
            continue
        whole = np.isfinite(rise) & (wait < LONGEST_WAIT)
        size = np.round(
            np.log(np.maximum(np.where(whole, np.abs(rise), least) / least, 1.0)) / HEIGHT_STEP
        )
        late = np.round(np.where(whole, wait, 0.0) / TIME_STEP)
        mark = np.full(count, 2 * number, dtype=np.uint64) + (rise[:count] > 0)
        for part in (size, late):
            for k in range(LENGTH):
                mark = mark * _MULTIPLIER + (part[k : k + count].astype(np.uint64) + _INCREMENT)
        unbroken = np.all([whole[k : k + count] for k in range(LENGTH)], axis=0)
        for value, at in zip(
            (mark[unbroken] >> np.uint64(1)).tolist(), time[:count][unbroken].tolist(), strict=True
        ):
            marks.setdefault(value, []).append(at)
    return marks


def _turning_points(flight: Flight, name: str, least: float) -> tuple[Array, Array]:
    """Times [s] and heights of turning points of the low-passed channel, sub-sample; a NaN height
    where the chain breaks."""
    low, usable = _low_passed(flight, name)
    step = flight.step
    k = np.flatnonzero((np.diff(low[:-1]) * np.diff(low[1:]) <= 0) & (np.diff(low[:-1]) != 0)) + 1
    curvature = low[k - 1] - 2 * low[k] + low[k + 1]
    shift = np.where(
        curvature != 0,
        0.5 * (low[k - 1] - low[k + 1]) / np.where(curvature == 0, 1.0, curvature),
        0.0,
    )
    time = flight.time[k] + step * shift
    height = np.where(usable[k], low[k] - 0.25 * (low[k - 1] - low[k + 1]) * shift, np.nan)
    return _without_ripple(time, height, least)


def _without_ripple(time: Array, height: Array, least: float) -> tuple[Array, Array]:
    """Turning points whose neighbours differ by `least` or more: of smaller waves only the
    outermost points stay."""
    kept_time: list[float] = []
    kept: list[float] = []
    for at, value in zip(time.tolist(), height.tolist(), strict=True):
        while (
            len(kept) > 1 and np.isfinite(value) and (kept[-1] - kept[-2]) * (value - kept[-1]) > 0
        ):
            kept.pop()
            kept_time.pop()
        if (
            not kept
            or not np.isfinite(value)
            or not np.isfinite(kept[-1])
            or abs(value - kept[-1]) >= least
        ):
            kept.append(value)
            kept_time.append(at)
    return np.array(kept_time), np.array(kept)


def _low_passed(flight: Flight, name: str) -> tuple[Array, NDArray[np.bool_]]:
    """The channel through a Gaussian of BLUR seconds, and where that is free of ends and of
    unusable samples."""
    good = flight.usable([name])
    values = bridge(np.where(good, flight[name], np.nan)) if good.any() else np.zeros(len(good))
    reach = int(np.ceil(4.0 * BLUR / flight.step))
    hurt = maximum_filter1d(~good, 2 * reach + 1, mode="constant", cval=False)
    hurt[:reach] = hurt[len(hurt) - reach :] = True
    low: Array = gaussian_filter1d(values, BLUR / flight.step, mode="nearest")
    return low, ~hurt


def _common_offsets(offsets: Array) -> list[float]:
    """Offsets in time [s] that at least FEWEST_MARKS pairs of marks agree on, best supported
    first."""
    if len(offsets) < FEWEST_MARKS:
        return []
    ordered = np.sort(offsets)
    breaks = np.flatnonzero(np.diff(ordered) > TIME_STEP) + 1
    groups = [group for group in np.split(ordered, breaks) if len(group) >= FEWEST_MARKS]
    return [float(np.median(group)) for group in sorted(groups, key=len, reverse=True)]


@dataclass(frozen=True)
class _Agreement:
    """Where all channels of two flights are equal.

    where : mask of the first flight's samples. offset : refined, s. difference : largest relative
    rms difference there.
    """

    where: NDArray[np.bool_]
    offset: float
    difference: float


def _agreement(a: Flight, b: Flight, offset: float, names: tuple[str, ...]) -> _Agreement | None:
    """Return where all channels of `a` equal those of `b` at ``time + offset``; None if nowhere."""
    pairs = [_Pair.of(a, b, name) for name in names]
    for near in (1.0, 4 * AGREEMENT, 2 * AGREEMENT, 2 * AGREEMENT):
        steps = [pair.step_of_offset(a.time + offset, near) for pair in pairs]
        bottom = sum(step[1] for step in steps)
        offset += sum(step[0] for step in steps) / bottom if bottom > 0 else 0.0
    compared = [pair.difference(a.time + offset) for pair in pairs]
    agreed = np.all([known & (np.abs(d) < 3 * AGREEMENT) for d, known in compared], axis=0)
    differences = np.stack([d for d, _ in compared])
    where = np.zeros(len(a.time), dtype=bool)
    for first, last in _runs(agreed):
        part = slice(first, last + 1)
        long = a.time[last] - a.time[first] >= SHORTEST_SHARED
        alike = long and bool(np.all(np.mean(differences[:, part] ** 2, axis=1) < AGREEMENT**2))
        where[part] = alike and _one_condition(a, b, part, offset)
    if not where.any():
        return None
    largest = float(np.sqrt(np.max(np.mean(differences[:, where] ** 2, axis=1))))
    return _Agreement(_to_the_ends(a, b, where, offset, names), offset, largest)


def _one_condition(a: Flight, b: Flight, part: slice, offset: float) -> bool:
    """Return whether the channels of the flight condition of a stretch of `a` are those of `b` at
    ``time + offset``: half of the samples or more within AGREEMENT of the stretch's motion and the
    noise of both records."""
    at = a.time[part] + offset
    for name in (*ABSOLUTE_CHANNELS, *RELATIVE_CHANNELS):
        if name not in a or name not in b:
            continue
        good = a.usable((name,))[part] & (
            np.interp(at, b.time, b.usable((name,)).astype(np.float64)) > 0.99
        )
        if not good.any():
            continue
        ours, theirs = a[name][part][good], np.interp(at[good], b.time, b[name])
        apart = ours - theirs
        if name in ("phi", "psi", "longitude"):
            ours, apart = np.unwrap(ours), np.angle(np.exp(1j * apart))
        if name in RELATIVE_CHANNELS:
            apart = apart - np.median(apart)
        near = (b.time >= at[0] - b.step) & (b.time <= at[-1] + b.step) & b.usable((name,))
        noise = _noise(ours) + _noise(b[name][near]) + _SINGLE_PRECISION * float(np.abs(ours).max())
        if float(np.median(np.abs(apart))) > AGREEMENT * float(np.std(ours)) + noise:
            return False
    return True


def _noise(values: Array) -> float:
    """One sigma of white noise, from second differences (variance 6 s^2), and half of the last
    digit that is stored."""
    white = float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6.0)) if len(values) > 2 else 0.0
    return (
        white + 0.5 * float(np.diff(np.unique(values)).min(initial=np.inf))
        if np.ptp(values) > 0
        else white
    )


@dataclass(frozen=True)
class _Pair:
    """One channel of two records, low-passed, with where each can be believed."""

    ours: Array
    fine: NDArray[np.bool_]
    theirs: CubicSpline
    fine_there: NDArray[np.bool_]
    least: float

    @classmethod
    def of(cls, a: Flight, b: Flight, name: str) -> "_Pair":
        (ours, fine), (theirs, fine_there) = _low_passed(a, name), _low_passed(b, name)
        return cls(ours, fine, CubicSpline(b.time, theirs), fine_there, LANDMARK_CHANNELS[name])

    def difference(self, at: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Ours - theirs at their times `at`, without its median and relative to our motion; and
        where both are known."""
        clock = self.theirs.x
        there = np.interp(at, clock, self.fine_there.astype(np.float64), left=0.0, right=0.0) > 0.99
        known = self.fine & there
        if not known.any():
            return np.zeros_like(self.ours), known
        difference = self.ours - self.theirs(np.clip(at, clock[0], clock[-1]))
        motion = max(float(np.std(self.ours[known])), self.least)
        return (difference - np.median(difference[known])) / motion, known

    def step_of_offset(self, at: Array, below: float) -> tuple[float, float]:
        """Numerator and denominator of the Gauss-Newton step of the offset in time that this
        channel asks for, from where the difference is small already."""
        difference, known = self.difference(at)
        near = known & (np.abs(difference) < below)
        motion = max(float(np.std(self.ours[known])), self.least) if known.any() else 1.0
        slope = self.theirs(at[near], 1) / motion
        return float(slope @ difference[near]), float(slope @ slope)


def _to_the_ends(
    a: Flight, b: Flight, where: NDArray[np.bool_], offset: float, names: tuple[str, ...]
) -> NDArray[np.bool_]:
    """The stretches drawn out over the margin that the low pass needs, as far as the samples
    themselves agree."""
    at = a.time + offset
    agree = a.usable(names) & (at >= b.time[0] - 1e-6) & (at <= b.time[-1] + 1e-6)
    agree &= np.interp(at, b.time, b.usable(names).astype(np.float64)) > 0.99
    for name in names:
        difference = a[name] - np.interp(at, b.time, b[name])
        spread = max(float(np.std(a[name][where])), LANDMARK_CHANNELS[name])
        agree &= np.abs(difference - np.median(difference[where])) < 10 * AGREEMENT * spread
    result = where.copy()
    reach = int(np.ceil(4.0 * BLUR / a.step)) + 1
    for first, last in _runs(where):
        for k in range(first - 1, max(first - reach, 0) - 1, -1):
            if not agree[k]:
                break
            result[k] = True
        for k in range(last + 1, min(last + reach, len(agree) - 1) + 1):
            if not agree[k]:
                break
            result[k] = True
    return result


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(first), int(last) - 1) for first, last in pairwise(edges)][::2]
