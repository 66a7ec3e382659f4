"""Intensity and scale of turbulence from a gust series, by maximum likelihood in frequency.

The series is a gust of one form (`aerodb.physics.gust_covariance`) plus white noise. Its first
difference, whose spectrum is nearly flat, has the periodogram I; with the periodogram S that is
expected of so many samples, the likelihood is ``-sum(ln S + I/S)`` over the frequencies used.
Limits are those of the profile likelihood.

References
----------
Whittle, Arkiv foer Matematik 2, 1953; Sykulski, Olhede, Guillaumin, Lilly & Early, Biometrika
106(2), 2019, for the expected periodogram.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import Form, gust_covariance
from aerodb.support import Array

#: Half of the 95 % quantile of chi-square with one degree of freedom: loss of log-likelihood at the
#: limits of an interval (Wilks, 1938).
_LOSS: Final = 1.920729
#: Fewest samples of a series.
_FEWEST: Final = 200
#: Largest logarithm of a limit over its estimate: beyond it the limit is open.
_FARTHEST: Final = 4.0
#: Accuracy of the logarithm of a limit.
_CLOSE: Final = 0.005


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % limits; infinite where the series gives none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class GustSpectrum:
    """Turbulence in one component: `intensity` [m/s], `length` (its scale) [m], standard deviation
    of the white `noise` [m/s] and the log-likelihood, by which two forms compare."""

    intensity: Interval
    length: Interval
    noise: float
    likelihood: float


class _Likelihood:
    """The negative log-likelihood of a series, by the logarithms of sigma, L and the noise."""

    def __init__(
        self, series: Array, step: float, speed: float, component: str, form: Form, highest: float
    ) -> None:
        change = np.diff(series)
        m = len(change)
        self._lags = np.arange(m + 1) * step * speed
        self._weights = 1.0 - np.arange(m) / m
        self._used = np.arange(1, int(min(highest * step, 0.5) * m) + 1)
        self._shown = np.abs(np.fft.rfft(change)[self._used]) ** 2 / m
        self._component, self._form = component, form
        #: A gust that is shorter than the shortest wave that is seen is no gust but noise.
        self._least = float(np.log(speed / min(highest, 0.5 / step)))
        self._known: tuple[float, Array] = (np.nan, self._weights)

    def _expected(self, correlation: Array) -> Array:
        """Expected periodogram of the difference of a series with a covariance (m + 1,)."""
        change = 2.0 * correlation[:-1] - np.r_[correlation[1], correlation[:-2]] - correlation[1:]
        weighted = self._weights * change
        whole = 2.0 * np.fft.rfft(weighted).real - weighted[0]
        return np.asarray(whole[self._used])

    def __call__(self, x: Array) -> float:
        if x[1] < self._least:
            return 1e300
        if self._known[0] != x[1]:
            apart = self._lags / np.exp(x[1])
            shape = self._expected(gust_covariance(self._form, self._component, apart))
            self._known = float(x[1]), shape
        frequency = self._used / len(self._weights)
        white = 2.0 - 2.0 * np.cos(2.0 * np.pi * frequency)
        expected = np.exp(2.0 * x[0]) * self._known[1] + np.exp(2.0 * x[2]) * white
        expected = np.maximum(expected, 1e-300)
        return float(np.sum(np.log(expected) + self._shown / expected))


def gust_spectrum(
    series: Array, step: float, speed: float, component: str, form: Form, highest: float = np.inf
) -> GustSpectrum:
    """Return the turbulence that a gust series shows.

    Parameters
    ----------
    series : (n,) gust [m/s], at a uniform `step` [s]; its mean counts for nothing.
    speed : airspeed [m/s].
    component : u, v or w.
    highest : frequency [Hz] up to which the series is used.

    Raises InputError for a series that is too short or does not move.
    """
    from scipy.optimize import minimize  # slow to import

    if len(series) < _FEWEST or not np.ptp(series) > 0.0:
        raise InputError(
            f"{len(series)} samples of gust {component}" + ("" if np.ptp(series) else " at rest"),
            remedy=f"at least {_FEWEST} samples of moving air",
        )
    cost = _Likelihood(series, step, speed, component, form, highest)
    duration = step * len(series)
    size = float(np.std(series))
    rough = float(np.std(np.diff(series, 2))) / np.sqrt(6.0)
    scales = np.log(speed * duration * np.array([0.003, 0.03]))

    def search(start: Array, fixed: int | None = None) -> tuple[float, Array]:
        free = [k for k in range(3) if k != fixed]

        def reduced(y: Array) -> float:
            x = start.copy()
            x[free] = y
            return cost(x)

        found = minimize(
            reduced, start[free], method="Nelder-Mead",
            options={"xatol": 1e-3, "fatol": 1e-4, "maxiter": 600},
        )  # fmt: skip
        x = start.copy()
        x[free] = found.x
        return float(found.fun), x

    starts = [np.array([np.log(size), each, np.log(0.3 * rough + 1e-6)]) for each in scales]
    best, x = min((search(each) for each in starts), key=lambda each: each[0])

    def limit(k: int, sign: float) -> float:
        near = x

        def loss(far: float) -> float:
            nonlocal near
            start = near.copy()
            start[k] = x[k] + sign * far
            value, near = search(start, k)
            return value - best - _LOSS

        low, high = 0.0, 0.1
        while loss(high) < 0.0:
            low, high = high, 2.0 * high
            if high > _FARTHEST:
                return sign * np.inf
        while high - low > _CLOSE:  # bisection: the loss is itself the end of a search
            middle = 0.5 * (low + high)
            low, high = (middle, high) if loss(middle) < 0.0 else (low, middle)
        return float(x[k] + sign * 0.5 * (low + high))

    intensity, length = (
        Interval(*(float(np.exp(each)) for each in (x[k], limit(k, -1.0), limit(k, 1.0))))
        for k in (0, 1)
    )
    return GustSpectrum(intensity, length, float(np.exp(x[2])), -best)
