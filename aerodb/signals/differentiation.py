"""Smoothing and differentiation with a stated bandwidth, and the noise that remains.

A record is a straight line through its end points plus a sine series (odd extension): without a
step at the ends there is no ringing. Truncating the series at the bandwidth smooths with zero
phase; its term-by-term derivative is exact. The content above the bandwidth measures the noise.
Method: Lanczos,
*Applied Analysis*, 1956; Morelli, "Estimating Noise Characteristics from Flight Test Data Using
Optimal Fourier Smoothing", J. Aircraft 32(4), 1995.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array

#: Width of the roll-off relative to the bandwidth: a cosine step from 1 to 0.
ROLL_OFF = 0.1

#: Fewest samples of a record that can be smoothed.
FEWEST_SAMPLES = 8

#: Samples beyond which chirps are tried for speed, and the largest prime factor of their number
#: less one without which the plain transform is slow. The result is the same to rounding.
_LONG: Final = 4096
_ROUGH: Final = 50


@dataclass(frozen=True)
class SmoothedRecord:
    """A smoothed record.

    bandwidth : Hz. noise : standard deviation of the white noise of the input, same unit.
    rate_sigma : standard deviation of the noise that remains in the rate. line : (n,), through the
    end points. series, omega : (n - 2,), sine series of the rest and its frequencies [rad/s].
    step [s].
    """

    bandwidth: float
    noise: float
    rate_sigma: float
    line: Array = field(repr=False)
    series: Array = field(repr=False)
    omega: Array = field(repr=False)
    step: float = field(repr=False)

    @cached_property
    def rate(self) -> Array:
        """(n,), time derivative."""
        n, slope = len(self.line), self.line[-1] - self.line[0]
        cosine = np.zeros(n)
        cosine[1:-1] = self.series * self.omega
        return np.asarray(slope / ((n - 1) * self.step) + 0.5 * _cosine_transform(cosine))

    @cached_property
    def value(self) -> Array:
        """(n,), the record smoothed."""
        value = self.line.copy()
        value[1:-1] += 0.5 * _sine_transform(self.series)
        return value


def smooth(
    values: Array, step: float, bandwidth: float, noise: float | None = None
) -> SmoothedRecord:
    """Low-pass and differentiate a uniformly sampled record with zero phase.

    Parameters
    ----------
    values : (n,), any unit, n >= FEWEST_SAMPLES; non-finite samples are interpolated linearly (the
        caller flags them)
    step : sampling interval, s
    bandwidth : frequency at which the gain is one half, Hz; at most the Nyquist frequency
    noise : standard deviation of the white noise of `values`; None: measured above the bandwidth

    Returns
    -------
    Smoothed, in the record's unit and unit/s

    Raises ValueError for too few samples, no finite sample, or a bandwidth beyond the Nyquist
    frequency.
    """
    line, series, frequency, gain = _spectrum(values, step, bandwidth)
    n = len(line)
    if noise is None:
        above = series[frequency > bandwidth * (1 + ROLL_OFF)]
        noise = float(np.sqrt(0.5 * (n - 1) * np.mean(above**2))) if len(above) else 0.0
    omega = 2 * np.pi * frequency
    share = noise / np.sqrt(n - 1)
    return SmoothedRecord(
        bandwidth=bandwidth,
        noise=noise,
        rate_sigma=share * float(np.sqrt(np.sum((gain * omega) ** 2))),
        line=line,
        series=gain * series,
        omega=omega,
        step=step,
    )


def low_passed(values: Array, step: float, bandwidth: float) -> Array:
    """Return only the value (n,) of `smooth`, in less time."""
    n = len(values)
    nyquist = _nyquist(n, step, bandwidth)
    if not _is_rough(n):
        line, series, _, gain = _spectrum(values, step, bandwidth)
        line[1:-1] += 0.5 * _sine_transform(gain * series)
        return line
    record = bridge(values)
    line = np.linspace(*_end_points(record, step, bandwidth), n)
    gain = _passed(n, nyquist, bandwidth)
    series = gain * 2.0 * _chirped(record - line, len(gain), n - 1).imag / (n - 1)
    line[1:-1] += _chirped(series, n, n - 1).imag[1:-1]
    return line


def low_passed_rate(values: Array, step: float, bandwidth: float) -> Array:
    """Low-pass a rate or an acceleration (n,) as `smooth` low-passes the rate that it returns.

    What `smooth` differentiates is continued oddly beyond its ends, so that its rate is continued
    evenly. A prediction that is compared with such a rate needs the same ends. values : any unit,
    non-finite samples are interpolated. step : [s]. bandwidth : [Hz]. Raises ValueError as `smooth`
    does.
    """
    record = bridge(values)
    n = len(record)
    nyquist = _nyquist(n, step, bandwidth)
    weights = np.full(n, 2.0)
    weights[[0, -1]] = 1.0
    if not _is_rough(n):
        frequency = np.linspace(0.0, nyquist, n)
        spectrum = _gain(frequency, bandwidth) * _cosine_transform(record)
        return _cosine_transform(spectrum) / (2.0 * (n - 1))
    gain = _passed(n, nyquist, bandwidth)
    spectrum = gain * _chirped(weights * record, len(gain), n - 1).real
    spectrum *= weights[: len(gain)]
    return _chirped(spectrum, n, n - 1).real / (2.0 * (n - 1))


def band_passed(values: Array, step: float, low: float, high: float) -> Array:
    """Return ``low_passed(values, step, high) - low_passed(values, step, low)``, in half the time.

    The lines through the end points differ by a straight line, whose sine series is known. values :
    (n,), any unit. step : [s]. low, high : [Hz].
    """
    record = bridge(values)
    line, series, frequency, gain = _spectrum(record, step, high)
    slow = _gain(frequency, low)
    first, last = np.array([line[0], line[-1]]) - _end_points(record, step, low)
    order = np.arange(1, len(line) - 1)
    half = np.pi * order / (2.0 * (len(line) - 1))
    straight = (first - (-1.0) ** order * last) / np.tan(half) / (len(line) - 1)
    between = np.linspace(first, last, len(line))
    between[1:-1] += 0.5 * _sine_transform((gain - slow) * series - slow * straight)
    return between


def _spectrum(values: Array, step: float, bandwidth: float) -> tuple[Array, Array, Array, Array]:
    """Return the line (n,) through the end points and the sine series (n - 2,) of the remainder.

    Also the frequencies [Hz] of the series and the gain of each. Raises ValueError as `smooth`
    does.
    """
    n = len(values)
    nyquist = _nyquist(n, step, bandwidth)
    record = bridge(values)
    line = np.linspace(*_end_points(record, step, bandwidth), n)
    frequency = np.arange(1.0, n - 1.0) * (nyquist / (n - 1))
    series = np.asarray(_sine_transform((record - line)[1:-1]) / (n - 1), dtype=np.float64)
    return line, series, frequency, _gain(frequency, bandwidth)


def _nyquist(n: int, step: float, bandwidth: float) -> float:
    """The Nyquist frequency [Hz] of n samples that can be smoothed at a bandwidth [Hz]."""
    if n < FEWEST_SAMPLES:
        raise ValueError(f"{n} samples are too few to smooth; at least {FEWEST_SAMPLES} are needed")
    nyquist = 0.5 / step
    if not 0.0 < bandwidth <= nyquist:
        raise ValueError(
            f"bandwidth {bandwidth:g} Hz is not between 0 and the Nyquist frequency {nyquist:g} Hz"
        )
    return nyquist


def _gain(frequency: Array, bandwidth: float) -> Array:
    """Gain at frequencies in ascending order [Hz]: one, the step of the roll-off, and zero."""
    edges = bandwidth * np.array([1.0 - ROLL_OFF, 1.0 + ROLL_OFF])
    first, last = np.searchsorted(frequency, edges)
    share = np.clip(0.5 + (1 - frequency[first:last] / bandwidth) / ROLL_OFF, 0.0, 1.0)
    gain = np.zeros(len(frequency))
    gain[:first] = 1.0
    gain[first:last] = 0.5 * (1 - np.cos(np.pi * share))
    return gain


def bridge(values: Array) -> Array:
    """Return `values` (n,) with non-finite samples interpolated linearly between neighbours."""
    good = np.isfinite(values)
    if good.all():
        return np.asarray(values, dtype=np.float64)
    if not good.any():
        raise ValueError("no finite sample in the record")
    index = np.arange(len(values))
    return np.interp(index, index[good], values[good])


def integrated(rate: Array, step: float) -> Array:
    """Return the integral (n,) of a rate (n,) by the trapezoidal rule, zero at first.

    step [s]. Source: Abramowitz & Stegun, Handbook of Mathematical Functions, 25.4.1.

    >>> integrated(np.array([0.0, 2.0, 2.0]), 0.5)
    array([0. , 0.5, 1.5])
    """
    result: Array = np.concatenate([[0.0], np.cumsum(0.5 * step * (rate[1:] + rate[:-1]))])
    return result


def _end_points(record: Array, step: float, bandwidth: float) -> tuple[float, float]:
    """Return the end values of a local quadratic over half a period of the bandwidth.

    A noisy first or last sample must not tilt the line through the end points.
    """
    width = int(np.clip(round(0.5 / (bandwidth * step)), 3, len(record) // 2))
    weights = _end_weights(width)
    return float(weights @ record[:width]), float(weights @ record[::-1][:width])


@lru_cache(maxsize=64)
def _end_weights(width: int) -> Array:
    """Return the weights of `width` samples in the first value of their least-squares quadratic."""
    return np.asarray(
        np.linalg.pinv(np.vander(np.linspace(0.0, 1.0, width), min(3, width), increasing=True))[0]
    )


def _passed(n: int, nyquist: float, bandwidth: float) -> Array:
    """Gain (k,) of the first k of n frequencies from zero to `nyquist`: all that pass."""
    gain = _gain(np.linspace(0.0, nyquist, n), bandwidth)
    return gain[: np.flatnonzero(gain)[-1] + 1]


@lru_cache(maxsize=64)
def _is_rough(n: int) -> bool:
    """Whether the transforms of a long record of n samples are slow: n - 1 has a large prime."""
    left, prime = n - 1, 2
    while prime <= _ROUGH:
        left, prime = (left // prime, prime) if left % prime == 0 else (left, prime + 1)
    return n > _LONG and left > 1


def _chirped(values: Array, count: int, half: int) -> NDArray[np.complex128]:
    """Return ``sum_j values_j exp(i pi j k / half)`` for the first `count` numbers k.

    Exact for every length, at the cost of a fast one (Bluestein's chirps: 2 j k is
    j^2 + k^2 - (k - j)^2).
    """
    from scipy.fft import fft, ifft

    chirp, kernel = _chirps(len(values), count, half)
    spectrum = fft(values * chirp[: len(values)], len(kernel))
    return np.asarray(ifft(spectrum * kernel, overwrite_x=True)[:count] * chirp[:count])


@lru_cache(maxsize=8)
def _chirps(n: int, count: int, half: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The chirp, and the spectrum of its conjugate, of n values and `count` sums."""
    from scipy.fft import fft, next_fast_len

    square = np.arange(max(n, count)) ** 2 % (4 * half)
    chirp = np.exp(0.5j * np.pi / half * square)
    kernel = np.zeros(next_fast_len(n + count - 1), dtype=np.complex128)
    kernel[:count] = chirp[:count].conj()
    kernel[len(kernel) - n + 1 :] = chirp[1:n][::-1].conj()
    return chirp, fft(kernel)


def _sine_transform(values: Array) -> Array:
    """The discrete sine transform of type 1."""
    from scipy.fft import dst  # slow to import, and queries of databases never smooth

    return np.asarray(dst(values, type=1))


def _cosine_transform(values: Array) -> Array:
    """The discrete cosine transform of type 1."""
    from scipy.fft import dct

    return np.asarray(dct(values, type=1))
