"""What a roll on the ground shows without its brakes, its wind and its thrust: how it slows down.

Of a log without commands of wheels no friction can be estimated: an unknown brake may change at any
time, and rolling friction, drag and thrust act along the same line. What is seen is when and where
it stands still, and the sum of all that slows it, in phases between which this sum jumps.

Speed is continuous, and the deceleration of each phase is linear in time; phases are added one by
one, where one explains more than chance. Samples count in means of half a second: receivers
smooth within that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from aerodb.conditioning import ground_speed, places
from aerodb.flight import Flight
from aerodb.identification.ground_records import SLOW, ground_rolls
from aerodb.physics import GRAVITY
from aerodb.support import CLAIM, DIFFERENCE, HINT, Array, likelihood_gain, standard_errors

#: Time over which samples are averaged [s]: receivers smooth within a part of a second.
_MEAN: Final = 0.5
#: Shortest phase [s]: positions at 50 Hz with 3 m of noise tell an acceleration within 2 m/s2 in
#: 2 s, and within .4 m/s2 in 4 s (sqrt(720/n) sigma/T^2).
_PHASE: Final = 4.0
#: Most jumps of the deceleration in a roll: brakes on, off, and reverse thrust on and off.
_JUMPS: Final = 4
#: Time around a jump in which speeds do not count [s]: brakes build up within a second, which
#: places hardly show.
_BUILDS_UP: Final = 1.0
#: Times that each jump is moved beside the others.
_TURNS: Final = 3
#: Least jump of the deceleration, over that of gravity: half of rolling friction on concrete, .02
#: to .03 (Gudmundsson, General Aviation Aircraft Design, 2014, table 17-3).
_LEAST_JUMP: Final = 0.01
#: Speed over `SLOW` up to which a roll that ends slows down to its standstill.
_ENDS: Final = 2.0
#: Share of the way that a roll may leave its straight line and still be measured along it.
_STRAIGHT: Final = 0.05


@dataclass(frozen=True)
class Phase:
    """A part of a roll that slows down evenly.

    start, end : [s] of the flight. fast, slow : speeds over the ground at both [m/s].
    deceleration, error : mean and its standard error [m/s2].
    """

    start: float
    end: float
    fast: float
    slow: float
    deceleration: float
    error: float

    @property
    def effective(self) -> float:
        """Deceleration over that of gravity: rolling friction, brakes, drag and slope together,
        less thrust; no unit."""
        return self.deceleration / GRAVITY

    @property
    def effective_error(self) -> float:
        """Standard error of `effective`; no unit."""
        return self.error / GRAVITY


@dataclass(frozen=True)
class SeenRoll:
    """A roll as it is seen.

    start : [s] of the flight. time, distance : from there to the standstill, or to the end of what
    is seen of it [s], [m]. stands : whether it comes to a standstill.
    """

    start: float
    time: float
    distance: float
    stands: bool
    phases: tuple[Phase, ...]


def seen_rolls(flight: Flight) -> list[SeenRoll]:
    """Return what is seen of the rolls of a flight (n,), SI units; one that is not straight is left
    out where only its positions are known."""
    found = []
    for whole in ground_rolls(flight):
        way, order = _way(flight, whole)
        if way is not None and (roll := _seen(flight.time[whole], way, order)) is not None:
            found.append(roll)
    return found


def _way(flight: Flight, whole: slice) -> tuple[Array | None, int]:
    """Speed (m,) [m/s] along a roll and 0, or place [m] and 1 where velocities are not known; NaN
    where it was not measured."""
    names = ("velocity_north", "velocity_east")
    if all(name in flight and flight.usable([name])[whole].any() for name in names):
        moving = ground_speed(flight)
        return (None if moving is None else moving[whole]), 0
    place = places(flight)
    if not place:
        return None, 1
    points = np.stack([place["north"][whole], place["east"][whole]])
    good = np.isfinite(points).all(axis=0)
    if good.sum() < 3:
        return None, 1
    centred = points - points[:, good].mean(axis=1)[:, None]
    ahead = np.linalg.svd(centred[:, good], full_matrices=False)[0][:, 0]
    along, across = ahead @ centred, np.array([-ahead[1], ahead[0]]) @ centred
    if np.std(across[good]) > _STRAIGHT * np.ptp(along[good]):
        return None, 1
    return (along if along[good][-1] > along[good][0] else -along), 1


def _seen(time: Array, way: Array, order: int) -> SeenRoll | None:
    """A roll from its speed (n,) (order 0) or its place (order 1)."""
    since = time - time[0]
    count = int(since[-1] / _MEAN)
    good = np.isfinite(way)
    if count < 4 or not good.any():
        return None
    bins = np.minimum((since / _MEAN).astype(int), count - 1)[good]
    filled = np.bincount(bins, minlength=count)
    kept = filled > 0
    t, y = (np.bincount(bins, values[good], count)[kept] / filled[kept] for values in (since, way))
    if len(t) < 4 * (order + 2):
        return None
    fit, *alike = _fitted(t, y, order)
    alike = alike or [fit]
    edges = np.array([0.0, *fit.jumps, since[-1]])
    speeds = [float(fit.speed(at) @ fit.values) for at in edges]
    slowing, errors = _slowing(fit, since[-1])
    others = [_slowing(each, since[-1])[0] - slowing for each in alike]
    errors = np.sqrt(errors**2 + np.mean([each**2 for each in others], axis=0))
    phases = [
        Phase(
            float(time[0] + edges[k]),
            float(time[0] + edges[k + 1]),
            speeds[k],
            speeds[k + 1],
            float(slowing[k]),
            float(errors[k]),
        )
        for k in range(len(edges) - 1)
    ]
    rolled = float((fit.place(since[-1]) - fit.place(0.0)) @ fit.values)
    last, slow = phases[-1].deceleration, phases[-1].slow
    stands = slow < _ENDS * SLOW and last > 0.0
    on = max(slow, 0.0) / last if stands else 0.0
    return SeenRoll(
        float(time[0]),
        float(since[-1] + on),
        rolled + 0.5 * max(slow, 0.0) * on,
        stands,
        tuple(phases),
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion with jumps of its acceleration: values (k,) and covariance (k, k) of its terms, and
    the sum of squares that it leaves. order : 0 of a speed, 1 of a place."""

    order: int
    jumps: tuple[float, ...]
    values: Array
    covariance: Array
    left: float

    def speed(self, at: float) -> Array:
        """Row (k,) that gives the speed [m/s] at a time."""
        return _rows(np.array([at]), self.jumps, self.order, self.order)[0]

    def place(self, at: float) -> Array:
        """Row (k,) that gives the place [m] at a time, less a constant."""
        return _rows(np.array([at]), self.jumps, self.order, self.order - 1)[0]


def _rows(t: Array, jumps: tuple[float, ...], order: int, derivative: int = 0) -> Array:
    """Rows (n, k) of a speed (order 0) or place (order 1) over time, or a derivative of theirs; -1
    is an integral."""
    columns = [(0.0, power) for power in range(order + 3)]
    columns += [(jump, power) for jump in jumps for power in (order + 1, order + 2)]
    made = []
    for since, power in columns:
        late = np.maximum(t - since, 0.0)
        left = power - derivative
        factor = float(np.prod([power - k for k in range(derivative)])) if derivative > 0 else 1.0
        factor /= power + 1.0 if derivative < 0 else 1.0
        made.append(factor * late**left if left >= 0 and factor else np.zeros_like(t))
    return np.stack(made, axis=1)


def _slowing(motion: _Motion, end: float) -> tuple[Array, Array]:
    """Mean deceleration of each phase of a motion up to a time, and its standard error (k,)."""
    edges = np.array([0.0, *motion.jumps, end])
    rows = -np.diff([motion.speed(at) for at in edges], axis=0) / np.diff(edges)[:, None]
    return rows @ motion.values, np.sqrt(np.einsum("ij,jk,ik->i", rows, motion.covariance, rows))


def _fitted(t: Array, y: Array, order: int) -> list[_Motion]:
    """The motion with as many jumps as chance does not explain, and those with the last jump
    elsewhere that are as likely within two standard errors."""
    found, alike = _solved(t, y, (), order), list[_Motion]()
    candidates = t[(t > _PHASE) & (t < t[-1] - _PHASE)].tolist()
    tried = found
    for count in range(1, _JUMPS + 1):
        made = _with_one_more(t, y, tried.jumps, candidates, order)
        if made is None:
            break
        tried, beside = made
        more = count - len(found.jumps)
        chance = CLAIM / math.comb(len(candidates), more)
        gain = 0.5 * len(t) * math.log(found.left / tried.left)
        if gain > 0.5 * chi2.isf(chance, 2 * more) and all(_jumps(tried, k) for k in range(count)):
            most = tried.left * math.exp(2.0 * likelihood_gain(HINT) / len(t))
            found, alike = tried, [each for each in beside if each.left < most]
    return [found, *alike]


def _with_one_more(
    t: Array, y: Array, jumps: tuple[float, ...], candidates: Sequence[float], order: int
) -> tuple[_Motion, list[_Motion]] | None:
    """The best motion with one more jump, each jump moved to where it explains most beside the
    others, and the motions that it was chosen from last; None where there is no room for one."""
    kept, best, beside = (*jumps, math.nan), None, list[_Motion]()
    for turn in range(_TURNS * len(kept)):
        others = kept[:-1]
        free = [c for c in candidates if all(abs(c - j) >= _PHASE for j in others)]
        if not free:
            return None
        beside = [_solved(t, y, tuple(sorted((*others, c))), order) for c in free]
        at = min(range(len(free)), key=lambda k: beside[k].left)
        moved = free[at] != kept[-1]
        best, kept = beside[at], (free[at], *others)
        if not moved and turn >= len(kept):
            break
    return None if best is None else (_between_samples(t, y, best), beside)


def _between_samples(t: Array, y: Array, motion: _Motion) -> _Motion:
    """The motion with each jump between the samples where it explains most."""
    jumps = list(motion.jumps)
    for k in range(len(jumps)):

        def left(at: float, k: int = k) -> float:
            return _solved(t, y, (*jumps[:k], at, *jumps[k + 1 :]), motion.order).left

        near = (jumps[k] - 2.0 * _MEAN, jumps[k] + 2.0 * _MEAN)
        jumps[k] = float(minimize_scalar(left, bounds=near, method="bounded").x)
    found = _solved(t, y, tuple(jumps), motion.order)
    return found if found.left < motion.left else motion


def _solved(t: Array, y: Array, jumps: tuple[float, ...], order: int) -> _Motion:
    rows = _rows(t, jumps, order)
    even = np.ones(len(t), dtype=bool)
    for jump in jumps if order == 0 else ():
        even &= abs(t - jump) > _BUILDS_UP
    rows, wanted = rows[even], y[even]
    values = np.asarray(np.linalg.lstsq(rows, wanted, rcond=None)[0], dtype=np.float64)
    left = float(np.sum((wanted - rows @ values) ** 2)) * len(t) / len(wanted)
    covariance = np.linalg.pinv(rows.T @ rows) * left / max(len(t) - rows.shape[1], 1)
    return _Motion(order, jumps, values, covariance, left)


def _jumps(motion: _Motion, k: int) -> bool:
    """Whether the acceleration jumps at the k-th jump by more than its error and by enough."""
    at = motion.order + 3 + 2 * k
    factor = 2.0 if motion.order else 1.0
    size = factor * abs(float(motion.values[at]))
    error = factor * float(np.sqrt(motion.covariance[at, at]))
    return size > max(standard_errors(DIFFERENCE) * error, _LEAST_JUMP * GRAVITY)
