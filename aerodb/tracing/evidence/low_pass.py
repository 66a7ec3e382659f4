"""Low-pass and decimate residual and columns of an axis, stretch by stretch.

docs/method/tracing.md, section 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from aerodb.coefficients import BRIDGED
from aerodb.errors import InputError
from aerodb.signals import PASS_EDGE, low_pass_taps, runs
from aerodb.support import Array, Mask
from aerodb.tracing.evidence.evidence import Columns, Evidence
from aerodb.tracing.settings import TracingSettings

#: Axis -> one array (m, hypotheses + 2) per stretch: constant, columns, residual.
Records = Mapping[str, Sequence[Array]]

#: Samples after decimation that a stretch must have beyond the filter's order and its ends.
SHORTEST = 8
#: A sample near an end is left out whose noise the low-pass leaves more than this many times
#: stronger (variance) than inside.
NOISIER = 2.0
#: Kept samples that are filtered by one product.
BLOCK = 16
#: Samples of all columns that are worked on at a time.
_CACHED = 1 << 18


def decimation(step: float, bandwidth: float) -> int:
    """Return the decimation factor that keeps what is below `bandwidth` [Hz]; 1 for a slow grid."""
    return max(1, int(PASS_EDGE / (bandwidth * step)))


def stretches(usable: Mask, step: float, bandwidth: float, order: int) -> list[slice]:
    """Return the stretches that are long enough to whiten; short gaps inside are bridged later.

    usable : (n,). step : [s]. bandwidth : [Hz].
    """
    ratio = decimation(step, bandwidth)
    longest_gap = int(BRIDGED / (bandwidth * step))
    usable_runs = runs(usable, (SHORTEST + order + 2 * ends_left_out(ratio)) * ratio, longest_gap)
    return [slice(first, last + 1) for first, last in usable_runs]


def band_limited(columns: Sequence[Array], usable: Mask, step: float, bandwidth: float) -> Array:
    """Low-pass columns (k of (n,)) of one stretch with zero phase and decimate them to (m, k).

    Gaps are bridged by straight lines. The low-pass is that of
    `aerodb.signals.resampling.low_pass`; the ends are continued by point reflection, and the
    samples whose noise this hardly lowers are left out. Every step is linear and the same for all
    columns: ``y = X theta + v`` remains true.
    """
    ratio = decimation(step, bandwidth)
    return _decimated(columns, usable, ratio, ends_left_out(ratio)).T


def slower(columns: Sequence[Array], usable: Mask, ratio: int) -> Array:
    """Low-pass columns (k of (n,)) and return every `ratio`-th sample as (k, m)."""
    return (
        _decimated(columns, usable, ratio, 0)
        if usable.any()
        else np.stack([column[::ratio] for column in columns])
    )


def _decimated(columns: Sequence[Array], usable: Mask, ratio: int, left_out: int) -> Array:
    """Columns (k of (n,)) as (k, m), without `left_out` samples at each end."""
    n, k = len(usable), len(columns)
    taps, half = _kernel(ratio)
    if half >= n:
        raise InputError(
            f"{n} samples are fewer than the low-pass's {half}",
            "tracing band",
            "give a longer stretch",
        )
    result = np.empty((k, (n - 1) // ratio + 1 - 2 * left_out))
    together = max(1, _CACHED // n)
    for first in range(0, k, together):
        padded, out = (
            _padded(columns[first : first + together], usable, half),
            result[first : first + together],
        )
        for index in range(0, out.shape[1], BLOCK):
            part = out[:, index : index + BLOCK]
            start, width = (index + left_out) * ratio, len(taps) + (part.shape[1] - 1) * ratio
            np.matmul(
                padded[:, start : start + width], _band(ratio)[:width, : part.shape[1]], out=part
            )
    return result


def _padded(columns: Sequence[Array], usable: Mask, half: int) -> Array:
    """Columns (k of (n,)) as (k, n + 2 half).

    Straight lines over gaps, point reflections about both ends beyond them.
    """
    n = len(usable)
    padded = np.empty((len(columns), n + 2 * half))
    inner = padded[:, half : half + n]
    for row, column in zip(inner, columns, strict=True):
        row[:] = column
    if not usable.all():
        index = np.arange(n)
        for row in inner:
            row[~usable] = np.interp(index[~usable], index[usable], row[usable])
    if half:
        padded[:, :half] = 2.0 * inner[:, :1] - inner[:, half:0:-1]
        padded[:, half + n :] = 2.0 * inner[:, -1:] - inner[:, -2 : -half - 2 : -1]
    return padded


@lru_cache(maxsize=64)
def ends_left_out(ratio: int) -> int:
    """Decimated samples at each end of a stretch where white noise is more than NOISIER times that
    inside.

    Reflected about the end, noise does not average: the very last sample would come out as it went
    in, and would be weighted by the standard deviation of the others.

    >>> ends_left_out(1), ends_left_out(23)
    (0, 1)
    """
    if ratio == 1:
        return 0
    taps, half = _kernel(ratio)
    number, gain = -1, np.inf
    while gain > NOISIER * float(taps @ taps):
        number += 1
        indices = np.arange(-half, half + 1) + number * ratio
        beyond = indices < 0
        weights = np.bincount(indices[~beyond], taps[~beyond], minlength=half + 1)
        weights -= np.bincount(-indices[beyond], taps[beyond], minlength=len(weights))
        weights[0] += 2.0 * taps[beyond].sum()
        gain = float(weights @ weights)
    return number


@lru_cache(maxsize=64)
def _kernel(ratio: int) -> tuple[Array, int]:
    """Taps of the low-pass, symmetric, and their half width."""
    if ratio == 1:
        return np.ones(1), 0
    taps = low_pass_taps(ratio)
    return taps, len(taps) // 2


@lru_cache(maxsize=64)
def _band(ratio: int) -> Array:
    """The filter at BLOCK decimated samples as a matrix (samples, BLOCK), so that one product does
    it.
    """
    taps, _ = _kernel(ratio)
    band = np.zeros((len(taps) + (BLOCK - 1) * ratio, BLOCK))
    for number in range(BLOCK):
        band[number * ratio : number * ratio + len(taps), number] = taps
    return band


@dataclass(frozen=True)
class BandLimitedFlight:
    """One flight in the band of tracing.

    step : s, after decimation; names : the hypotheses, in the order of columns. records : see
    `Records`. noisy : records of the copies with more state noise; instruments : records of the
    instruments (zero where there is none), empty without.
    """

    flight: str
    step: float
    names: tuple[str, ...]
    records: Records
    noisy: tuple[Records, ...]
    instruments: Records


def in_band(evidence: Evidence, settings: TracingSettings) -> BandLimitedFlight:
    """Return the evidence in the band (records (m, k + 2): intercept, k columns, residual;
    bandwidth [Hz]); axes without a usable stretch stay out."""
    names = tuple(evidence.columns)
    parts = {
        axis: stretches(evidence.usable[axis], evidence.step, settings.bandwidth, settings.order)
        for axis in evidence.residual
    }
    parts = {axis: by_axis for axis, by_axis in parts.items() if by_axis}

    alike = evidence.usable_alike(parts)

    def records(residual: Mapping[str, Array], columns: Columns) -> dict[str, list[Array]]:
        by_axis: dict[str, list[Array]] = {axis: [] for axis in parts}
        for axes in alike:
            for part in parts[axes[0]]:
                for axis, record in _limited(
                    residual, columns, names, axes, evidence, part, settings.bandwidth
                ).items():
                    by_axis[axis].append(record)
        return by_axis

    return BandLimitedFlight(
        flight=evidence.flight,
        step=evidence.step * decimation(evidence.step, settings.bandwidth),
        names=names,
        records=records(evidence.residual, evidence.columns),
        noisy=tuple(records(copy.residual, copy.columns) for copy in evidence.noisy),
        instruments=records(evidence.residual, evidence.instruments)
        if evidence.instruments
        else {},
    )


def _limited(
    residual: Mapping[str, Array],
    columns: Columns,
    names: Sequence[str],
    axes: Sequence[str],
    evidence: Evidence,
    part: slice,
    bandwidth: float,
) -> dict[str, Array]:
    """One stretch in the band: axis -> (m, names + 2), constant, named columns (zero if absent),
    residual.

    axes : usable at the same samples, so that all their columns are filtered at once.
    """
    acting = {
        axis: [index for index, name in enumerate(names) if axis in columns.get(name, {})]
        for axis in axes
    }
    rows = [
        [*(columns[names[index]][axis][part] for index in acting[axis]), residual[axis][part]]
        for axis in axes
    ]
    limited = band_limited(
        [row for each in rows for row in each],
        evidence.usable[axes[0]][part],
        evidence.step,
        bandwidth,
    )
    by_axis, first = {}, 0
    for axis, each in zip(axes, rows, strict=True):
        result = np.zeros((len(limited), len(names) + 2))
        result[:, 0] = 1.0
        result[:, [*(index + 1 for index in acting[axis]), len(names) + 1]] = limited[
            :, first : first + len(each)
        ]
        by_axis[axis], first = result, first + len(each)
    return by_axis


def centred(records: Sequence[Array]) -> list[Array]:
    """The records with their common mean removed. Each is (n,), all in one unit."""
    mean = float(np.mean(np.concatenate(records)))
    return [record - mean for record in records]
