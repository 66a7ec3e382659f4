"""A model of residuals that are correlated in time, and what it does to standard errors.

An autoregressive model is fitted to the residuals of all records (Burg's recursion, whose order is
chosen by Akaike's criterion). Its spectrum is smooth, where the sample autocorrelation of
`coloured_sum` is not: a fit with a constant makes every residual sum to zero, so that the sample
spectrum vanishes at zero frequency and the constant's standard error with it. Short records also
lose the degrees of freedom that the estimates took; both corrections are made here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len, rfft

from aerodb.support import Array

#: Highest order of an autoregressive model.
_HIGHEST = 40
#: Fewest samples per coefficient.
_PER_COEFFICIENT = 10
#: White noise that counts as part of the residuals, as a share of their variance: without it, the
#: empty band of a low-passed residual takes all coefficients, and the band that it has is missed.
_FLOOR = 1e-4


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """``v_i = sum_j a_j v_(i-j) + e_i``.

    Parameters
    ----------
    coefficients : a (p,); empty for white noise.
    innovation : variance of e.
    variance : of v.
    samples : that it was fitted to.
    """

    coefficients: Array
    innovation: float
    variance: float
    samples: int

    @property
    def independent(self) -> float:
        """Number of independent samples (a scalar) that the mean of the residual rests on, at most
        `samples`."""
        at_zero = self.innovation / (1.0 - float(self.coefficients.sum())) ** 2
        if at_zero <= 0.0:
            return float(self.samples)
        return min(float(self.samples), self.samples * self.variance / at_zero)

    def summed(self, regressors: Array) -> Array:
        """``sum_ij x_i R(i-j) x_j'`` (k, k) of one record with regressors x (n, k). R is the
        autocorrelation of this model, in the square of the residual's unit; the sum is that of
        Morelli & Klein (1997)."""
        size = next_fast_len(4 * len(regressors))
        response = rfft(np.concatenate([[1.0], -self.coefficients]), size)
        weight = self.innovation / np.abs(response) ** 2
        weight[1 : -1 if size % 2 == 0 else None] *= 2.0
        spectra = rfft(regressors, size, axis=0) * np.sqrt(weight)[:, None]
        real, imaginary = np.ascontiguousarray(spectra.real), np.ascontiguousarray(spectra.imag)
        return np.asarray((real.T @ real + imaginary.T @ imaginary) / size)


def autoregressive_noise(residuals: Sequence[Array]) -> NoiseModel:
    """The model of the residuals (n_r,) of all records together, with a floor of white noise 40 dB
    below them.

    References
    ----------
    J. P. Burg, Maximum Entropy Spectral Analysis, 1975; H. Akaike, IEEE Trans. Automatic Control
    19(6), 1974. White noise correction: Kay, IEEE Trans. Acoustics, Speech and Signal Processing
    28(3), 1980.

    >>> bool(autoregressive_noise([np.array([1.0, -1.0, 1.0, -1.0])]).variance == 1.0)
    True
    """
    total = sum(len(values) for values in residuals)
    power = sum(float(values @ values) for values in residuals) / max(total, 1)
    shortest = min((len(values) for values in residuals), default=0)
    highest = min(_HIGHEST, total // _PER_COEFFICIENT, shortest - 2)
    best = NoiseModel(np.zeros(0), power, power, total)
    if power <= 0.0:
        return best
    forward, backward = list(residuals), list(residuals)
    coefficients, innovation, least = np.zeros(0), power, total * np.log(power)
    for order in range(1, highest + 1):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True)]
        # what the errors of both predictions would be of the floor alone
        ahead = np.concatenate([[1.0], -coefficients, [0.0]])
        floor = 2.0 * _FLOOR * power * sum(len(f) for f, _ in pairs)
        size = sum(float(f @ f + b @ b) for f, b in pairs) + floor * float(ahead @ ahead)
        both = sum(2.0 * float(f @ b) for f, b in pairs) + floor * float(ahead @ ahead[::-1])
        reflection = both / size
        innovation *= 1.0 - reflection**2
        forward = [f - reflection * b for f, b in pairs]
        backward = [b - reflection * f for f, b in pairs]
        coefficients = np.concatenate(
            [coefficients - reflection * coefficients[::-1], [reflection]]
        )
        criterion = total * np.log(innovation) + 2.0 * order
        if criterion < least:
            least, best = criterion, NoiseModel(coefficients, innovation, power, total)
    return best
