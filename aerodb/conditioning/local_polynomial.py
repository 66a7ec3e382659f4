"""Smoothing and differentiation by polynomials fitted locally, with an error that is larger where the ends are near.

Beside the Fourier smoothing of `differentiation`: this one copes with gaps, says the error at every sample, and feels
no step or spike further away than its window. Weights fall off as ``1 - (t / h)^2`` (Epanechnikov), which is optimal
inside a record (Fan & Gijbels, *Local Polynomial Modelling and Its Applications*, 1996, section 3.2.6).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.signal import oaconvolve

from aerodb.support import Array

DEGREE = 2
#: Good samples per coefficient below which a window says nothing.
SUPPORT = 1.5


@dataclass(frozen=True)
class LocallySmoothed:
    """A smoothed record: `value` (n,), `rate` (n,) its time derivative; NaN where too few good samples are near.

    bandwidth : Hz, where the gain inside the record is one half; None for a window of hardly more samples than
    coefficients. noise : one sigma of the white part of the input. value_sigma, rate_sigma (n,) : what of it remains.
    residual (n,) : input - value, NaN where the input was not good. freedom : degrees of freedom of `noise`.
    """

    value: Array
    rate: Array
    bandwidth: float | None
    noise: float
    value_sigma: Array
    rate_sigma: Array
    residual: Array
    freedom: float


def local_polynomial(
    values: Array, step: float, bandwidth: float, good: NDArray[np.bool_] | None = None, noise: float | None = None
) -> LocallySmoothed:
    """Smooths and differentiates a uniformly sampled record by local quadratics.

    Parameters
    ----------
    values : (n,) any unit.  step : s.  bandwidth : Hz, where the gain shall be one half; below the Nyquist frequency.
    good : (n,) samples to use; samples that are not finite are never used.
    noise : one sigma of the white noise of `values`; None: measured on what the smoothing leaves over.

    The window is `half_width` samples to either side; within that of an end the last whole window is evaluated off its
    centre. Errors follow from the weights of every single window: ``sigma^2 g' A^-1 B A^-1 g`` with the weighted and
    twice weighted moments A and B, so that ends and gaps show them. They count noise only, not what the quadratic cannot follow.

    Raises ValueError when the record is shorter than the window.
    """
    half = half_width(step, bandwidth)
    n = len(values)
    if n < 2 * half + 1:
        raise ValueError(f"{n} samples are fewer than the window of {2 * half + 1} that {bandwidth:g} Hz needs")
    used = np.isfinite(values) if good is None else good & np.isfinite(values)
    offset = float(np.mean(values[used])) if used.any() else 0.0
    centred = np.where(used, values - offset, 0.0)
    inverse, right, twice, enough = _moments(centred, used, half)
    centre = np.clip(np.arange(n), half, n - 1 - half)
    place = (np.arange(n) - centre) / half
    basis = place[:, None] ** np.arange(DEGREE + 1)
    slope = np.stack([np.zeros(n), np.ones(n), 2 * place], axis=1) / (half * step)
    inverse, right, twice = inverse[centre], right[centre], twice[centre]
    coefficients = np.einsum("nij,nj->ni", inverse, right)
    spread = inverse @ twice @ inverse
    value = np.where(enough[centre], np.einsum("ni,ni->n", basis, coefficients) + offset, np.nan)
    rate = np.where(enough[centre], np.einsum("ni,ni->n", slope, coefficients), np.nan)
    variance = np.einsum("ni,nij,nj->n", basis, spread, basis)
    residual = np.where(used, values, np.nan) - value
    own = np.einsum("ni,nij,nj->n", basis, inverse, basis) * (1 - (place * half / (half + 1)) ** 2)
    judged = np.isfinite(residual)
    freedom = float(np.sum((1 - 2 * own + variance)[judged]))
    if noise is None:
        noise = float(np.sqrt(np.sum(residual[judged] ** 2) / freedom)) if freedom > 1 else 0.0
    of_rate = np.einsum("ni,nij,nj->n", slope, spread, slope)
    sigma = [np.where(enough[centre], noise * np.sqrt(np.maximum(v, 0.0)), np.nan) for v in (variance, of_rate)]
    return LocallySmoothed(value, rate, half_gain(half, step), noise, sigma[0], sigma[1], residual, freedom)


def _moments(centred: Array, used: NDArray[np.bool_], half: int) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Per window centre: inverse of the weighted moment matrix (n, 3, 3), right side (n, 3), twice weighted moments
    (n, 3, 3), and whether there are enough good samples on both sides of nothing in particular to fit at all."""
    place = np.arange(-half, half + 1) / half
    weight = _weights(half)
    mask = used.astype(np.float64)

    def windowed(record: Array, kernel: Array) -> Array:
        # Correlation, not convolution: the kernel is turned round.
        result: Array = oaconvolve(record, kernel[::-1], mode="same")
        return result

    order = 2 * DEGREE + 1
    once = [windowed(mask, weight * place**k) for k in range(order)]
    squared = [windowed(mask, weight**2 * place**k) for k in range(order)]
    right = np.stack([windowed(centred, weight * place**k) for k in range(DEGREE + 1)], axis=1)
    index = np.add.outer(np.arange(DEGREE + 1), np.arange(DEGREE + 1))
    matrix, twice = np.stack(once, axis=1)[:, index], np.stack(squared, axis=1)[:, index]
    count = windowed(mask, np.ones(2 * half + 1))
    spread = np.abs(np.linalg.det(matrix)) > 1e-6 * np.maximum(count, 1.0) ** 3 / (2 * half + 1)
    enough = (count > SUPPORT * (DEGREE + 1) - 1e-6) & spread
    matrix[~enough] = np.eye(DEGREE + 1)
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64), right, twice, np.asarray(enough, dtype=bool)


def _weights(half: int) -> Array:
    return 1.0 - (np.arange(-half, half + 1) / (half + 1)) ** 2


def half_width(step: float, bandwidth: float) -> int:
    """Half width [samples] of the window whose gain at `bandwidth` [Hz] is nearest to one half; `step` in s.

    Raises ValueError unless the bandwidth lies between zero and the Nyquist frequency.
    """
    if not 0.0 < bandwidth < 0.5 / step:
        raise ValueError(f"bandwidth {bandwidth:g} Hz is not between 0 and the Nyquist frequency {0.5 / step:g} Hz")
    # The gain falls to one half after 0.58 (narrow) to 0.76 (wide window) of a cycle per half width.
    near = range(max(2, int(0.55 / (bandwidth * step))), max(3, int(0.8 / (bandwidth * step)) + 2))
    return min(near, key=lambda half: abs(_gain(half, bandwidth * step) - 0.5))


def _kernel(half: int) -> Array:
    place = np.arange(-half, half + 1) / half
    weight = _weights(half)
    moments = [float(np.sum(weight * place**k)) for k in (0, 2, 4)]
    scale = moments[0] * moments[2] - moments[1] ** 2
    return np.asarray(weight * (moments[2] - moments[1] * place**2) / scale)


def _gain(half: int, cycles: float) -> float:
    """Gain inside a record at `cycles` per sample."""
    return float(np.sum(_kernel(half) * np.cos(2 * np.pi * cycles * np.arange(-half, half + 1))))


def half_gain(half: int, step: float) -> float | None:
    """Frequency [Hz] at which the gain of a window of `half` samples to either side falls to one half."""
    upper = min(0.5, 1.2 / half)
    if _gain(half, upper) > 0.5:
        return None
    return float(brentq(lambda cycles: _gain(half, cycles) - 0.5, 0.0, upper)) / step


@dataclass(frozen=True)
class NoiseCovariance:
    """Covariance (k, k) of the white noise of channels `names`, in their units, from `freedom` degrees of freedom."""

    names: tuple[str, ...]
    covariance: Array
    freedom: float

    @property
    def correlation(self) -> Array:
        """(k, k) correlation coefficients; zero for a channel without noise."""
        sigma = np.sqrt(np.diag(self.covariance))
        scale = np.outer(sigma, sigma)
        return np.divide(self.covariance, scale, out=np.eye(len(sigma)), where=scale > 0)


def noise_covariance(channels: Mapping[str, Array], step: float, bandwidth: float) -> NoiseCovariance:
    """Noise covariance of channels (each (n,)) from what local quadratics of `bandwidth` [Hz] leave over, all together.

    Only samples where every channel is finite count. What moves faster than the bandwidth counts as noise: choose
    it above the motion. Noise that is coloured below the bandwidth is not seen; no smoothing can tell it from motion.
    """
    good = np.all([np.isfinite(values) for values in channels.values()], axis=0)
    smoothed = [local_polynomial(values, step, bandwidth, good) for values in channels.values()]
    residual = np.stack([s.residual for s in smoothed])
    residual = residual[:, np.all(np.isfinite(residual), axis=0)]
    freedom = smoothed[0].freedom
    return NoiseCovariance(tuple(channels), residual @ residual.T / freedom, freedom)
