"""Measures of agreement between prediction and measurement: rms and Theil statistics."""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array


@dataclass(frozen=True)
class Theil:
    """Theil's inequality statistics: fit in percent, and the fractions of the mean square error due
    to bias, variance and covariance, which sum to 1."""

    fit_percent: float
    bias: float
    variance: float
    covariance: float


def rms(values: Array) -> float:
    """Root mean square of `values` (n,); 0 where there are none."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def theil(predicted: Array, measured: Array) -> Theil:
    """Theil statistics of a prediction against a measurement.

    ``U = rms(yhat - y) / (rms(yhat) + rms(y))``, fit ``100 (1 - U)``. Bias ``(mean yhat - mean y)^2
    / MSE``, variance ``(s_yhat - s_y)^2 / MSE``, covariance ``2 (1 - rho) s_yhat s_y / MSE``.

    Parameters
    ----------
    predicted, measured : (n,), in the same unit.

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, section 11.2.

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
