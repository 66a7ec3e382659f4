"""Continuous Dryden turbulence: gust velocities along the flight path, one series per flight.

Gust gradients (rotational gusts) and the delay between nose and wing are neglected: wavelengths of
100 m and more are long compared with a vehicle of a few metres.
"""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array

_FOOT = 0.3048


def dryden_scales(height: Array, wind_at_6m: Array) -> tuple[Array, Array]:
    """Return scale lengths and intensities of the gusts u, v, w.

    Below 1000 ft this is the low-altitude model. Above 2000 ft, L = 1750 ft with the intensity at
    the upper end of the low-altitude model; in between, L is linear.

    Parameters
    ----------
    height : (k,), above ground [m]
    wind_at_6m : (k,), steady wind 6 m (20 ft) above ground [m/s]; 15 kt is light, 30 kt moderate
        turbulence

    Returns
    -------
    lengths : (3, k), L [m]
    intensities : (3, k), sigma [m/s]

    References
    ----------
    MIL-F-8785C (1980), 3.7.1 and 3.7.3; MIL-HDBK-1797 for the transition.
    """
    h = np.clip(height / _FOOT, 10.0, 1000.0)
    shape = 0.177 + 0.000823 * h
    sigma_w = 0.1 * wind_at_6m
    low_length, low_sigma = h / shape**1.2, sigma_w / shape**0.4
    fade = np.clip((height / _FOOT - 1000.0) / 1000.0, 0.0, 1.0)
    horizontal = low_length + fade * (1750.0 - low_length)
    vertical = h + fade * (1750.0 - h)
    lengths = _FOOT * np.array([horizontal, horizontal, vertical])
    return lengths, np.array([low_sigma, low_sigma, sigma_w + 0 * h])


@dataclass
class DrydenGusts:
    """Gust velocities u, v, w in body axes as white noise through Dryden's forming filters.

    The filters are discretised exactly for the airspeed and scale length of each step, including
    the covariance of the noise, so that the intensity does not depend on the step. The filter of u
    is 1 / (1 + tau s), that of v and w (1 + sqrt(3) tau s) / (1 + tau s)^2, with tau = L / V.

    Parameters
    ----------
    wind_at_6m : (k,), steady wind 6 m above ground [m/s]
    generator : source of the noise

    References
    ----------
    MIL-F-8785C (1980), 3.7.1.2.
    """

    wind_at_6m: Array
    generator: np.random.Generator

    def __post_init__(self) -> None:
        k = self.wind_at_6m.shape[0]
        # Unit-variance states in their stationary distribution: u; then the two cascaded lags of v
        # and of w.
        self._u: Array = self.generator.standard_normal((k,))
        self._first = self.generator.standard_normal((2, k))
        self._second = 0.5 * self._first + 0.5 * self.generator.standard_normal((2, k))

    def advance(self, step: float, airspeed: Array, height: Array) -> Array:
        """Return the gusts (3, k) [m/s] after one more step.

        Parameters
        ----------
        step : float, [s]
        airspeed : (k,) [m/s]
        height : (k,), above ground [m]
        """
        lengths, sigma = dryden_scales(height, self.wind_at_6m)
        ratio = step * airspeed / lengths
        decay = np.exp(-ratio)
        k = airspeed.shape[0]
        self._u = decay[0] * self._u + np.sqrt(1 - decay[0] ** 2) * self.generator.standard_normal(
            k
        )
        # Stationary covariance P = [[1, 1/2], [1/2, 1/2]]; the noise of one step has the covariance
        # P - F P F', with F = d [[1, 0], [x, 1]].
        x, d2 = ratio[1:], decay[1:] ** 2
        q11 = 1 - d2
        q12 = 0.5 - d2 * (x + 0.5)
        q22 = 0.5 - d2 * (x * x + x + 0.5)
        root11 = np.sqrt(q11)
        root21 = q12 / root11
        root22 = np.sqrt(np.maximum(q22 - root21**2, 0.0))
        noise = self.generator.standard_normal((2, 2, k))
        second = (
            decay[1:] * (self._second + x * self._first) + root21 * noise[0] + root22 * noise[1]
        )
        self._first = decay[1:] * self._first + root11 * noise[0]
        self._second = second
        lateral = (np.sqrt(3.0) * self._first + (1 - np.sqrt(3.0)) * self._second) / np.sqrt(2.0)
        result: Array = sigma * np.concatenate([self._u[None], lateral])
        return result
