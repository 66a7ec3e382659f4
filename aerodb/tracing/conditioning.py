"""Residual and columns of one axis in the band that tracing looks at: stretches without gaps, low-passed, decimated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.signal import firwin, kaiserord

from aerodb.conditioning.resampling import PASS_EDGE, RIPPLE_DB, STOP_EDGE
from aerodb.conditioning.responses import runs
from aerodb.errors import InputError
from aerodb.tracing.evidence import Array, Columns, Evidence, Mask
from aerodb.tracing.settings import Settings

#: Axis -> one array (m, hypotheses + 2) per stretch: constant, columns, residual.
Records = Mapping[str, Sequence[Array]]

#: Gaps shorter than this part of a period of the band's edge are bridged by straight lines, residual and columns alike.
BRIDGED = 0.25
#: Samples after decimation that a stretch must have beyond the filter's order and its ends.
SHORTEST = 8
#: A sample near an end is left out whose noise the low-pass leaves more than this many times stronger (variance) than inside.
NOISIER = 2.0


def decimation(step: float, bandwidth: float) -> int:
    """Every how manieth sample of `step` [s] holds what is below `bandwidth` [Hz]; 1 where the grid is too slow to decimate."""
    return max(1, int(PASS_EDGE / (bandwidth * step)))


def stretches(usable: Mask, step: float, bandwidth: float, order: int) -> list[slice]:
    """Usable stretches of the grid, long enough to whiten; short gaps inside them are to be bridged."""
    ratio = decimation(step, bandwidth)
    longest_gap = int(BRIDGED / (bandwidth * step))
    found = runs(usable, (SHORTEST + order + 2 * ends_left_out(ratio)) * ratio, longest_gap)
    return [slice(first, last + 1) for first, last in found]


def band_limited(columns: Sequence[Array], usable: Mask, step: float, bandwidth: float) -> Array:
    """Columns (k of (n,)) of one stretch as (m, k): gaps bridged, low-passed with zero phase, every `decimation`-th sample.

    The low-pass is that of `aerodb.conditioning.resampling.low_pass`; the ends are continued by point reflection, and the
    samples are left out whose noise this hardly lowers. Every step is linear and the same for all columns: what was
    ``y = X theta + v`` still is.
    """
    from aerodb.tracing.low_pass import bridged, decimate  # compiled: nothing else should wait for it

    ratio = decimation(step, bandwidth)
    gaps = np.array(runs(~usable), dtype=np.int64).reshape(-1, 2)
    taps, half = _kernel(ratio) if ratio > 1 else (np.ones(1), 0)
    if half >= len(usable):
        raise InputError(f"{len(usable)} samples are fewer than the low-pass's {half}", "tracing band", "give a longer stretch")
    left_out = ends_left_out(ratio)
    result = np.empty((len(columns), (len(usable) - 1) // ratio + 1 - 2 * left_out))
    for column, out in zip(columns, result, strict=True):
        whole = np.ascontiguousarray(column, dtype=np.float64)
        decimate(bridged(whole, gaps) if len(gaps) else whole, taps, ratio, left_out, out)
    return result.T


@lru_cache(maxsize=64)
def ends_left_out(ratio: int) -> int:
    """Decimated samples at each end of a stretch in which white noise is more than NOISIER times what it is inside.

    Reflected about the end, noise does not average: the very last sample would come out as it went in, and what it is worth
    would be judged by the spread of the others.

    >>> ends_left_out(1), ends_left_out(23)
    (0, 1)
    """
    if ratio == 1:
        return 0
    taps, half = _kernel(ratio)
    number, gain = -1, np.inf
    while gain > NOISIER * float(taps @ taps):
        number += 1
        places = np.arange(-half, half + 1) + number * ratio
        beyond = places < 0
        weights = np.bincount(places[~beyond], taps[~beyond], minlength=half + 1)
        weights -= np.bincount(-places[beyond], taps[beyond], minlength=len(weights))
        weights[0] += 2.0 * taps[beyond].sum()
        gain = float(weights @ weights)
    return number


@lru_cache(maxsize=64)
def _kernel(ratio: int) -> tuple[Array, int]:
    """Taps of the low-pass, symmetric, and their half width."""
    taps, beta = kaiserord(RIPPLE_DB, 2.0 * (STOP_EDGE - PASS_EDGE) / ratio)
    half = taps // 2
    kernel = firwin(2 * half + 1, (PASS_EDGE + STOP_EDGE) / ratio, window=("kaiser", beta))
    return kernel, half


@dataclass(frozen=True)
class Band:
    """One flight in the band that tracing looks at. step [s] after decimation; names : the hypotheses, in the order of columns.

    noisy : records of the copies with more state noise; instruments : records of the instruments (zero where there is none),
    empty without.
    """

    flight: str
    step: float
    names: tuple[str, ...]
    records: Records
    noisy: tuple[Records, ...]
    instruments: Records


def in_band(evidence: Evidence, settings: Settings) -> Band:
    """The evidence in the band, axis by axis and stretch by stretch; axes without a usable stretch stay out."""
    names = tuple(evidence.columns)
    parts = {
        axis: stretches(evidence.usable[axis], evidence.step, settings.bandwidth, settings.order) for axis in evidence.residual
    }
    parts = {axis: found for axis, found in parts.items() if found}

    def records(residual: Mapping[str, Array], columns: Columns) -> dict[str, list[Array]]:
        return {
            axis: [_limited(residual[axis], columns, names, axis, evidence, part, settings.bandwidth) for part in found]
            for axis, found in parts.items()
        }

    return Band(
        flight=evidence.flight,
        step=evidence.step * decimation(evidence.step, settings.bandwidth),
        names=names,
        records=records(evidence.residual, evidence.columns),
        noisy=tuple(records(copy.residual, copy.columns) for copy in evidence.noisy),
        instruments=records(evidence.residual, evidence.instruments) if evidence.instruments else {},
    )


def _limited(
    residual: Array, columns: Columns, names: Sequence[str], axis: str, evidence: Evidence, part: slice, bandwidth: float
) -> Array:
    """One stretch in the band (m, names + 2): constant, the named columns (zero where absent), residual."""
    acting = [place for place, name in enumerate(names) if axis in columns.get(name, {})]
    rows = [*(columns[names[place]][axis][part] for place in acting), residual[part]]
    limited = band_limited(rows, evidence.usable[axis][part], evidence.step, bandwidth)
    result = np.zeros((len(limited), len(names) + 2))
    result[:, 0] = 1.0
    result[:, [*(place + 1 for place in acting), len(names) + 1]] = limited
    return result


def centred(records: Sequence[Array]) -> list[Array]:
    """The records with their common mean removed."""
    level = float(np.mean(np.concatenate(records)))
    return [record - level for record in records]
