"""What a channel that is wrong in a known way, and a database that lacks an effect, leave behind.

A channel that stands still was, if it is wrong, moving meanwhile: bridged from where it moves
before to where it moves after. A channel whose samples are off in time shows fast motion that the
aircraft does not feel. A database lacks functions of motion, speed, surfaces and gusts, and of no
time: a fault is told where it is likelier than each of these.
"""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from aerodb.signals import played, runs
from aerodb.support import Array
from aerodb.suspicions.begin import LEFT

#: Half the play of a linkage that is looked for [rad]: a worn one has several times this.
PLAY: Final = float(np.deg2rad(0.5))
#: Fewest equal means in a row for a channel that stands still.
HELD: Final = 3
#: Samples over which what is not fast is averaged: .7 s, of which a servo passes all.
SLOW: Final = 7
#: Least that such a channel is off where it is, to be said [rad, rms]: a deflection in the coarsest
#: steps that are taken (`coarse.COARSEST`) is off by this.
LEAST_OFF: Final = float(np.deg2rad(1.0) / np.sqrt(12.0))


def slack(values: Array) -> Iterator[Array]:
    """How far a surface is from its channel (m,) [rad] that has play behind it, per half of the
    play: by the way that the channel went last, and where it stands still, on its way back."""
    yield (values - played(values, PLAY)) / PLAY
    way = np.sign(np.diff(values, prepend=values[:1]))
    moves = np.flatnonzero(way)
    if len(moves) > 1:
        yield np.interp(np.arange(len(values)), moves, way[moves])


def still(values: Array) -> Iterator[Array]:
    """By how much a channel (m,) that stands still is off, in its unit: from lines between where it
    moves, as it is where it is held or in steps; and from its crests, where it is clipped."""
    here = np.zeros(len(values), dtype=bool)
    first = []
    for start, last in runs(np.diff(values) == 0.0, HELD - 1):
        here[start : last + 2] = True
        first.append(start)
    if not first or here.all():
        return
    # Where it jumps from one stretch to the next, it passed the middle of both.
    between = np.array([k for k in first if k and here[k - 1]], dtype=int)
    knots = np.concatenate([np.flatnonzero(~here), between - 0.5])
    heights = np.concatenate([values[~here], 0.5 * (values[between] + values[between - 1])])
    order = np.argsort(knots)
    knots, heights = knots[order], heights[order]
    if len(knots) < HELD:
        return
    at = np.arange(len(values))
    yield np.where(here, values - np.interp(at, knots, heights), 0.0)
    inside = here & (at > knots[0]) & (at < knots[-1])
    into, out = np.diff(values, prepend=values[:1]), np.diff(values, append=values[-1:])
    near = np.clip(np.round(knots).astype(int), 0, len(values) - 1)
    leads = here[np.minimum(near + 1, len(values) - 1)]  # to a stretch that stands still
    rates = np.where(leads, into[near], out[near])
    from scipy.interpolate import CubicHermiteSpline  # here: a log that is inspected needs none

    yield np.where(inside, values - CubicHermiteSpline(knots, heights, rates)(at), 0.0)


def fast(values: Array) -> Iterator[Array]:
    """What a channel (m,) shows within `SLOW` samples, in its unit."""
    yield values - uniform_filter1d(values, SLOW)


def is_off(shape: Array, least: float = LEAST_OFF) -> bool:
    """Whether a channel that is off by `shape` (m,) is so by as much as `least`, in its unit."""
    there = shape[shape != 0.0]
    return bool(there.size and np.sqrt(np.mean(there**2)) > least)


def lacked(moving: Mapping[str, Array], off_motion: Mapping[str, Array], t: Array) -> Array:
    """Return what a database may lack, a column each (m, k): products of two variables, their
    sizes and cubes, a flow that lags, and gusts by what they turn vanes beside the motion. Gusts
    and noise may grow with time.

    moving, off_motion : (m,) each, scaled here. t : time (m,) [s].
    """
    scaled = {n: (v - v.mean()) / np.std(v) for n, v in moving.items() if n != "thrust"}
    names, columns = list(scaled), []
    for k, name in enumerate(names):
        columns += [scaled[name] * scaled[other] for other in names[k:]]
        columns += [np.abs(scaled[name]), scaled[name] ** 3]
    columns += [np.gradient(scaled[name]) for name in ("alpha", "beta") if name in scaled]
    for values in off_motion.values():
        columns += [values, np.gradient(values), values * (t - t.mean())]
    return np.column_stack(columns) if columns else np.zeros((0, 0))


def most_explained(columns: Array, basis: Array, lefts: Mapping[str, Array]) -> dict[str, float]:
    """Return axis -> the largest share of the squares of what is left of it (m,) that one of
    `columns` (m, k) explains beside `basis` (m, j, orthonormal)."""
    own = columns - basis @ (basis.T @ columns)
    size = np.sum(own**2, axis=0)
    told: NDArray[np.bool_] = size > LEFT * np.sum(columns**2, axis=0)
    size = np.where(told, size, np.inf)
    return {
        axis: float(np.max((left @ own) ** 2 / size, initial=0.0)) / max(float(left @ left), 1e-300)
        for axis, left in lefts.items()
    }
