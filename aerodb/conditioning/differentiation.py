"""Smoothing and differentiation with a stated bandwidth, and the noise that they leave.

A record between its two end points is a straight line plus a sine series (odd extension): no step at the ends, hence
no ringing. Cutting the series at the bandwidth smooths with zero phase; its term-by-term derivative is exact. What
lies above the bandwidth measures the noise. Method: Lanczos, *Applied Analysis*, 1956; Morelli, "Estimating Noise
Characteristics from Flight Test Data Using Optimal Fourier Smoothing", J. Aircraft 32(4), 1995.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, dst

Array = NDArray[np.float64]

#: Width of the roll-off relative to the bandwidth: a cosine step from 1 to 0, short and yet without ripple.
ROLL_OFF = 0.1

#: A record shorter than this has no spectrum to cut.
FEWEST_SAMPLES = 8


@dataclass(frozen=True)
class Smoothed:
    """A smoothed record: `value` (n,), `rate` (n,) its time derivative, `noise` one sigma of the white noise of the
    input (same unit), `value_sigma` and `rate_sigma` what of it remains in value and rate."""

    value: Array
    rate: Array
    bandwidth: float
    noise: float
    value_sigma: float
    rate_sigma: float


def smooth(values: Array, step: float, bandwidth: float, noise: float | None = None) -> Smoothed:
    """Low-passes and differentiates a uniformly sampled record with zero phase.

    Parameters
    ----------
    values : (n,) any unit, n >= FEWEST_SAMPLES; not finite samples are bridged linearly (the caller flags them).
    step : sampling interval, s.
    bandwidth : Hz, where the gain is one half; at most the Nyquist frequency.
    noise : one sigma of the white noise of `values`; None: measured above the bandwidth.

    Returns
    -------
    Smoothed, with the record's unit and unit/s.
    """
    n = len(values)
    if n < FEWEST_SAMPLES:
        raise ValueError(f"{n} samples are too few to differentiate; {FEWEST_SAMPLES} are needed")
    record = bridge(values)
    nyquist = 0.5 / step
    if not 0.0 < bandwidth <= nyquist:
        raise ValueError(f"bandwidth {bandwidth:g} Hz is not between 0 and the Nyquist frequency {nyquist:g} Hz")
    first, last = _end_points(record, step, bandwidth)
    line = np.linspace(first, last, n)
    frequency = np.arange(1, n - 1) * (nyquist / (n - 1))
    series = dst((record - line)[1:-1], type=1) / (n - 1)
    gain = np.clip(0.5 + (1 - frequency / bandwidth) / ROLL_OFF, 0.0, 1.0)
    gain = 0.5 * (1 - np.cos(np.pi * gain))
    if noise is None:
        above = series[frequency > bandwidth * (1 + ROLL_OFF)]
        noise = float(np.sqrt(0.5 * (n - 1) * np.mean(above**2))) if len(above) else 0.0
    omega = 2 * np.pi * frequency
    value, rate = line.copy(), np.full(n, (last - first) / ((n - 1) * step))
    value[1:-1] += 0.5 * dst(gain * series, type=1)
    cosine = np.zeros(n)
    cosine[1:-1] = gain * series * omega
    rate += 0.5 * dct(cosine, type=1)
    share = noise / np.sqrt(n - 1)
    return Smoothed(
        value=value,
        rate=rate,
        bandwidth=bandwidth,
        noise=noise,
        value_sigma=share * float(np.sqrt(np.sum(gain**2))),
        rate_sigma=share * float(np.sqrt(np.sum((gain * omega) ** 2))),
    )


def bridge(values: Array) -> Array:
    """`values` (n,) with samples that are not finite replaced by linear interpolation between their neighbours."""
    good = np.isfinite(values)
    if good.all():
        return np.asarray(values, dtype=np.float64)
    if not good.any():
        raise ValueError("no finite sample in the record")
    index = np.arange(len(values))
    return np.interp(index, index[good], values[good])


def _end_points(record: Array, step: float, bandwidth: float) -> tuple[float, float]:
    """End values from a local quadratic over half a period of the bandwidth: a noisy first sample must not tilt all."""
    width = int(np.clip(round(0.5 / (bandwidth * step)), 3, len(record) // 2))
    grid = np.arange(width, dtype=np.float64)
    degree = min(2, width - 1)
    first = np.polynomial.Polynomial.fit(grid, record[:width], degree)(0.0)
    last = np.polynomial.Polynomial.fit(grid, record[::-1][:width], degree)(0.0)
    return float(first), float(last)
