"""Resample long flights to the rate that tracing needs.

Columns cost by the sample, and most of a log's rate lies far above the band. Channels are
low-passed and columns computed from them, instead of the other way round: in the band that is the
same but for products of what was above it, that is of noise, which a column is better without.
docs/method/tracing.md, section 21.
"""

from dataclasses import replace

import numpy as np

from aerodb.coefficients import BRIDGED, LONG, Comparison, clear, spacing
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.signals import bridge
from aerodb.support import Array
from aerodb.tracing.evidence.low_pass import slower


def thinned(flight: Flight, comparison: Comparison, bandwidth: float) -> tuple[Flight, Comparison]:
    """Return the flight and its comparison with every k-th sample.

    k is the largest that keeps the rate at OVERSAMPLING times `bandwidth` [Hz]. The first sample
    stays the first. Around a gap that is not bridged one more sample on each side is not usable:
    the filter has mixed in what is beyond it. Both are returned as they are where k is one, and for
    a flight that is not LONG, where thinning saves little.
    """
    every = spacing(flight.step, bandwidth)
    if every < 2 or flight.duration < LONG:
        return flight, comparison
    kept = slice(None, None, every)
    longest = int(BRIDGED / (bandwidth * flight.step))
    usable = {axis: good for axis, good in comparison.usable.items() if axis in AXES}
    sides = {
        axis: slower(
            [np.nan_to_num(side[axis]) for side in (comparison.measured, comparison.predicted)],
            good,
            every,
        )
        for axis, good in usable.items()
    }
    flags = {name: bits[kept] for name, bits in flight.flags.items()}
    thin = replace(
        flight, time=flight.time[kept], channels=_slower_channels(flight, every), flags=flags
    )
    return thin, replace(
        comparison,
        time=thin.time,
        measured={axis: measured for axis, (measured, _) in sides.items()},
        sigma={axis: comparison.sigma[axis][kept] for axis in usable},
        predicted={axis: predicted for axis, (_, predicted) in sides.items()},
        usable={axis: clear(good, longest, every)[kept] for axis, good in usable.items()},
        outside=comparison.outside[kept],
        bandwidth=None
        if comparison.bandwidth is None
        else min(comparison.bandwidth, 0.25 / thin.step),
    )


def _slower_channels(flight: Flight, every: int) -> dict[str, Array]:
    """All channels low-passed over their gaps, every `every`-th sample; nan where they were not
    finite.
    """
    finite = {name: np.isfinite(values) for name, values in flight.channels.items()}
    names = [name for name, good in finite.items() if good.any()]
    whole = np.ones(len(flight.time), dtype=np.bool_)
    slow = dict(
        zip(names, slower([bridge(flight[name]) for name in names], whole, every), strict=True)
    )
    return {
        name: np.where(finite[name][::every], slow.get(name, np.nan), np.nan)
        for name in flight.channels
    }
