"""Resample the comparison of a long flight to the rate that its band needs.

Samples cost, and most of a log's rate lies far above the motion. Channels are low-passed and
predictions computed from them, instead of the other way round: in the band that is the same but for
products of what was above it, that is of noise. `docs/method/tracing.md`, section 21.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients.comparison import Comparison, DatabaseSide
from aerodb.signals import bridge, low_pass, runs
from aerodb.support import Array, Mask

#: The rate that stays, in bandwidths at least: products of three channels fold into the band only
#: what lies above 3.6 of it.
OVERSAMPLING = 12.0
#: From this duration on [s] a flight is long: it is thinned, and one copy with more state noise is
#: enough of it.
LONG = 300.0
#: Gaps shorter than this part of a period of the band's edge are bridged by straight lines,
#: residual and columns alike.
BRIDGED = 0.25
_FLOW: Final = ("V", "alpha", "beta")


def spacing(step: float, bandwidth: float) -> int:
    """Return of how many samples at `step` [s] one is kept for a bandwidth [Hz]; 0 or 1: all."""
    return int(1.0 / (OVERSAMPLING * bandwidth * step))


def thinned_comparison(comparison: Comparison) -> Comparison:
    """Return a comparison at full rate with every k-th sample, its database side as well.

    k is the largest that keeps the rate at `OVERSAMPLING` times the bandwidth [Hz]. The first
    sample stays the first; see `clear` for samples (m,) beside gaps. It is returned as it is
    where k is one, where nothing limits its band, and for a flight that is not `LONG`.
    """
    side, time, bandwidth = comparison.database_side, comparison.time, comparison.bandwidth
    if side is None or bandwidth is None or time[-1] - time[0] < LONG:
        return comparison
    step = float(time[-1] - time[0]) / (len(time) - 1)
    every = spacing(step, bandwidth)
    if every < 2:
        return comparison
    longest, channels = int(BRIDGED / (bandwidth * step)), _slower_channels(side, every)

    def slow(sides: Mapping[str, Array]) -> dict[str, Array]:
        return {
            axis: _slower(np.where(good, sides[axis], np.nan), every)
            for axis, good in comparison.usable.items()
        }

    return replace(
        comparison,
        time=time[::every],
        measured=slow(comparison.measured),
        sigma={axis: comparison.sigma[axis][::every] for axis in comparison.usable},
        predicted=slow(comparison.predicted),
        usable={
            axis: clear(good, longest, every)[::every] for axis, good in comparison.usable.items()
        },
        outside=comparison.outside[::every],
        database_side=replace(side, channels=channels, prediction=side.database.predict(channels)),
    )


def clear(usable: Mask, longest: int, every: int) -> Mask:
    """Return the mask (n,) without samples that are nearer than `every` to a gap of more than
    `longest` samples: the filter has mixed in what is beyond it."""
    found = np.zeros(len(usable), dtype=np.bool_)
    for first, last in runs(usable, bridge=longest):
        start = first if first == 0 else first + every
        end = last if last == len(usable) - 1 else last - every
        found[start : end + 1] = usable[start : end + 1]
    return found


def _slower(values: Array, every: int) -> Array:
    """Values (n,) low-passed over their gaps, every `every`-th; as they are where none is
    finite."""
    if not np.isfinite(values).any():
        return values[::every]
    return low_pass(bridge(values), 1.0, every)[::every]


def _slower_channels(side: DatabaseSide, every: int) -> dict[str, Array]:
    """All channels low-passed, nan where they were not finite. The flow is so by its components:
    the angles of a vehicle that hovers go round and round."""
    channels = dict(side.channels)
    flow = [name for name in _FLOW if name in channels]
    if len(flow) == len(_FLOW):
        speed, alpha, beta = (channels[name] for name in _FLOW)
        ahead = speed * np.cos(beta)
        parts = (ahead * np.cos(alpha), speed * np.sin(beta), ahead * np.sin(alpha))
        channels |= dict(zip(_FLOW, parts, strict=True))
    slow = {
        name: np.where(np.isfinite(values[::every]), _slower(values, every), np.nan)
        for name, values in channels.items()
    }
    if len(flow) == len(_FLOW):
        u, v, w = (slow[name] for name in _FLOW)
        slow["V"] = np.sqrt(u**2 + v**2 + w**2)
        slow["alpha"], slow["beta"] = np.arctan2(w, u), np.arctan2(v, np.hypot(u, w))
        if side.over_ground and {"qbar", "rho"} <= slow.keys():
            slow["qbar"] = 0.5 * slow["rho"] * slow["V"] ** 2
    return slow
