"""Resampling onto one uniform grid without aliasing, and the first-order lag of actuators.

To a lower rate, a zero-phase low-pass comes first; to a higher rate, values are interpolated
linearly; on the same time base, values stay bit for bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.signals.clock import interval, is_uniform
from aerodb.support import Array

#: Pass-band and stop-band edge of the anti-aliasing filter relative to the grid's rate, and its
#: ripple [dB].
PASS_EDGE, _STOP_EDGE, _RIPPLE_DB = 0.35, 0.5, 60.0
#: Longest distance of two source samples, in source intervals, that is not a gap.
GAP_INTERVALS = 3.0
#: Grid and source stamps closer than this part of a step are the same instant: the value is
#: unchanged.
SAME_INSTANT = 1e-3
#: Samples of an even time base per sample of the source or of the grid above which the source's
#: median interval does not describe it: its clock jumps, or its stamps come in bursts.
MOST_FILL = 20


def is_out_of_proportion(span: float, step: float, samples: int) -> bool:
    """Return whether an even time base of `span` at `step` (one unit) has more than 20 samples for
    each of `samples`, and more than 1000: a clock that jumps asks for any amount of memory."""
    return span > (MOST_FILL * samples + 1000) * step


def even_step(time: Array, samples: int) -> float:
    """Return the interval [s] of an even time base for stamps `time` (n >= 2,): the median step.

    The mean step where the median is out of proportion to n and `samples`, the length of the grid:
    the stamps come in bursts.
    """
    step, span = interval(time), float(time[-1] - time[0])
    if is_out_of_proportion(span, step, max(len(time), samples)):
        return span / (len(time) - 1)
    return step


def uniform_grid(start: float, end: float, step: float) -> Array:
    """Return times [s] ``start + k * step`` up to `end` inclusive, up to rounding; at least one."""
    count = int(np.floor((end - start) / step + 1e-6)) + 1
    return np.asarray(start + step * np.arange(max(count, 1)), dtype=np.float64)


def low_pass(values: Array, step: float, new_step: float) -> Array:
    """Return `values` (n,) at uniform `step` [s], low-passed with zero phase for `new_step` [s].

    The filter of `low_pass_taps`; the ends are continued by point reflection, which preserves value
    and slope.
    """
    from scipy.fft import irfft, next_fast_len, rfft  # slow to import, as below

    kernel = low_pass_taps(new_step / step)
    padded = np.pad(values, len(kernel) // 2, mode="reflect", reflect_type="odd")
    size = next_fast_len(len(padded), real=True)
    # what wraps around falls on the first samples, which are the continuation's
    passed = irfft(rfft(padded, size) * rfft(kernel, size), size)
    return np.asarray(passed[len(kernel) - 1 : len(padded)])


def low_pass_taps(ratio: float) -> Array:
    """Return the taps (m,), dimensionless, of a low-pass for a sampling rate `ratio` times lower;
    odd in number.

    A Kaiser-window linear-phase FIR filter (Oppenheim & Schafer, *Discrete-Time Signal Processing*,
    sec. 7.5): flat to 0.35, 60 dB down from 0.5 of the new rate. `scipy.signal` has the same, and
    takes a second to import, a tenth of a closed loop.
    """
    width = _STOP_EDGE - PASS_EDGE
    taps = np.ceil((_RIPPLE_DB - 7.95) / (2.285 * 2.0 * np.pi * width / ratio) + 1.0)
    half = int(taps) // 2
    beta = 0.1102 * (_RIPPLE_DB - 8.7)  # for more than 50 dB
    cutoff, place = (PASS_EDGE + _STOP_EDGE) / ratio, np.arange(-half, half + 1)
    kernel = np.sinc(cutoff * place) * np.kaiser(2 * half + 1, beta)
    return np.asarray(kernel / kernel.sum())


def decimated(
    channels: Mapping[str, Array], step: float, rate: float
) -> tuple[dict[str, Array], float]:
    """Return low-passed and decimated channels and their step [s].

    The decimation factor is the largest that leaves `rate` or more, and 64 samples. Content below
    0.35 of `rate` is unchanged. The last few samples of a decimated record (less than 1 %) are
    dropped, so that its length suits a fast Fourier transform.

    Parameters
    ----------
    channels : name -> (n,), finite, at uniform `step`
    step : s
    rate : least sampling rate afterwards, Hz
    """
    from scipy.fft import prev_fast_len

    n = len(next(iter(channels.values()), ()))
    every = min(int(1.0 / (rate * step) + 1e-6), n // 64)
    if every < 2:
        return dict(channels), step
    kept = slice(0, every * prev_fast_len((n - 1) // every) + 1, every)
    return {
        name: low_pass(values, step, every * step)[kept] for name, values in channels.items()
    }, every * step


@dataclass(frozen=True)
class Resampler:
    """Resamples values from one time base to a grid; one per time base serves all of its fields.

    time : (n,), of the source, s. grid : (m,), s. gap : (m,), true where the source has no samples.
    sample_times : (m,), the grid, with instants that coincide with a source stamp replaced by that
    stamp, s. step, grid_step : intervals, s.
    """

    time: Array
    grid: Array
    gap: NDArray[np.bool_]
    sample_times: Array
    step: float
    grid_step: float

    def __call__(self, values: Array) -> Array:
        """Return finite `values` (n,) at `time` as (m,) at `grid`; constant beyond the ends."""
        if len(self.sample_times) == len(self.time) and np.array_equal(
            self.sample_times, self.time
        ):
            return values
        span = float(self.time[-1] - self.time[0])
        if self.step >= 0.9 * self.grid_step or len(self.time) < 3 or span < self.grid_step:
            return np.interp(self.sample_times, self.time, values)
        even = uniform_grid(float(self.time[0]), float(self.time[-1]), self.step)
        if is_uniform(self.time):
            return np.interp(
                self.sample_times, self.time, low_pass(values, self.step, self.grid_step)
            )
        return np.interp(
            self.grid, even, low_pass(np.interp(even, self.time, values), self.step, self.grid_step)
        )


def resampler(time: Array, grid: Array) -> Resampler:
    """Return a Resampler from strictly increasing `time` (n,) [s] to uniform `grid` (m,) [s].

    A grid sample is in a gap when its two neighbours in `time` are more than three source intervals
    apart (and it coincides with neither), or when it lies more than one source interval outside.
    The source interval is that of `even_step`; who calls leaves out stamps far from the grid.
    """
    step = even_step(time, len(grid)) if len(time) > 1 else 0.0
    grid_step = interval(grid) if len(grid) > 1 else step
    limit = SAME_INSTANT * (min(step, grid_step) or 1.0)
    right = np.clip(np.searchsorted(time, grid), 1, max(len(time) - 1, 1))
    left, right = right - 1, np.minimum(right, len(time) - 1)
    on_left, on_right = np.abs(grid - time[left]) <= limit, np.abs(grid - time[right]) <= limit
    sample_times = np.where(on_right, time[right], np.where(on_left, time[left], grid))
    apart = (time[right] - time[left] > GAP_INTERVALS * step) & ~on_left & ~on_right
    outside = (grid < time[0] - step - limit) | (grid > time[-1] + step + limit)
    return Resampler(time, grid, apart | outside, sample_times, step, grid_step)


def hold(time: Array, values: Array, grid: Array) -> Array:
    """Return `values` (n,) held until the next one (zero-order hold), at the grid times.

    Before the first value, the first value. A command is valid until the next.
    """
    reach = SAME_INSTANT * interval(grid) if len(grid) > 1 else 0.0
    result: Array = values[np.maximum(np.searchsorted(time, grid + reach, side="right") - 1, 0)]
    return result


def first_order_lag(command: Array, step: float, time_constant: float) -> Array:
    """Return the response (n,) of ``T y' + y = u`` to `command` (n,), at rest at the start.

    step, time_constant : s. Exact for a command that is held between samples:
    ``y[k+1] = a y[k] + (1 - a) u[k]``, ``a = exp(-step / T)``.
    """
    if time_constant <= 0.0:
        return command
    from scipy.linalg.blas import dtbsv

    a = float(np.exp(-step / time_constant))
    # forward substitution in two diagonals: scipy.signal, which has filters, is slow to import
    diagonals = np.array([np.ones(len(command)), np.full(len(command), -a)])
    return np.asarray(dtbsv(1, diagonals, np.r_[command[0], (1.0 - a) * command[:-1]], lower=1))
