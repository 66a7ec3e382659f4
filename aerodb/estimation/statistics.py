"""Measures of how well a prediction follows a measurement."""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array


@dataclass(frozen=True)
class Theil:
    """Theil's inequality statistics: fit in percent, and the error's parts from bias, variance and
    covariance (sum 1)."""

    fit_percent: float
    bias: float
    variance: float
    covariance: float


def rms(values: Array) -> float:
    """Root mean square of the values; 0 for none."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def theil(predicted: Array, measured: Array) -> Theil:
    """Theil's statistics of a prediction (n,) against a measurement (n,) (Jategaonkar 2015, section
    11.2).

    ``U = rms(yhat - y) / (rms(yhat) + rms(y))``, fit ``100 (1 - U)``; parts ``(mean yhat - mean
    y)^2 / MSE``, ``(s_yhat - s_y)^2 / MSE``, ``2 (1 - rho) s_yhat s_y / MSE``.

    >>> import numpy as np
    >>> theil(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 2.0])).bias
    1.0
    """
    error = predicted - measured
    mse = float(np.mean(error**2))
    size = rms(predicted) + rms(measured)
    if mse == 0.0 or size == 0.0:
        return Theil(100.0, 0.0, 0.0, 0.0)
    bias = float(np.mean(error)) ** 2 / mse
    variance = float(predicted.std() - measured.std()) ** 2 / mse
    return Theil(
        100.0 * (1.0 - np.sqrt(mse) / size), bias, variance, max(0.0, 1.0 - bias - variance)
    )
