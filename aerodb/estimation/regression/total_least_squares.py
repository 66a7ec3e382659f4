"""Linear equations whose regressors are noisy: flow angles without vanes, rates of cheap gyros.

Noise of a regressor draws its estimate towards zero, and others with it. Where its size is known,
or can be seen in the highest frequencies, the draw can be removed.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation.fit import Fit, Standing
from aerodb.estimation.regression.equation_error import (
    Reduced,
    Standings,
    answer,
    reduced,
    whitened,
)
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.support import Array, Mask

#: Lowest frequency, as a share of half the sampling rate, at which a regressor is taken for noise.
_NOISE_BAND: Final = 0.75
#: Share of the variance that other regressors do not explain which must be signal.
_RELIABLE: Final = 0.3


def total_least_squares(
    equation: LinearEquation,
    *,
    noise: Mapping[str, float] | None = None,
    response_noise: float | None = None,
) -> Fit:
    """Least squares with errors in the regressors.

    ``theta = (X'X - lambda n S)^-1 X'y`` with S the covariance of the regressors' white noise. With
    `response_noise` lambda is the smallest root of ``|[X y]'[X y] - lambda n diag(S, s_y^2)|``:
    total least squares (Golub & Van Loan, SIAM J. Numerical Analysis 17(6), 1980; with columns free
    of noise: Van Huffel & Vandewalle, The Total Least Squares Problem, 1991). Without, lambda is 1,
    which is right however large the error of the equation itself is (Fuller, Measurement Error
    Models, 1987, section 2.2).

    Parameters
    ----------
    noise : parameter -> standard deviation of the noise of its regressor; those not named are free
        of noise. None: seen in each regressor above three quarters of half the sampling rate, which
        supposes that no filter has removed it there.
    response_noise : standard deviation of the response's error, white; None: not known.

    Priors and bounds are not used. Raises InputError for an unknown name, negative noise, and where
    the noise explains the regressors wholly.
    """
    problem = reduced(equation)
    deviation = _deviation(problem, noise)
    excited = problem.excited
    x, y, n = problem.columns[:, excited], problem.response, len(problem.response)
    scale = np.linalg.norm(x, axis=0)
    x, own = x / scale, np.where(excited, deviation, 0.0)[excited] / scale
    product, error = x.T @ x, n * np.diag(own**2)
    share = 1.0 if response_noise is None else _smallest_root(x, y, error, response_noise)
    inner = product - share * error
    if np.linalg.eigvalsh(inner)[0] <= 1e-9 * np.linalg.eigvalsh(product)[-1]:
        raise InputError(
            "the noise of the regressors is as large as what they show, or they depend on each"
            " other",
            f"equation of {equation.response}",
            "state a smaller noise, leave out a term, or fly larger manoeuvres",
        )
    found = np.linalg.solve(inner, x.T @ y)
    values = np.zeros(len(excited))
    values[excited] = found / scale
    noise_model = problem.noise(values)
    # Regressors and residual share the regressors' noise: Fuller, eqs. 1.3.12 and 2.2.13.
    drawn = np.outer(own**2 * found, own**2 * found) * n
    middle = whitened(problem, x, noise_model, x.shape[1])
    middle = middle + (drawn if response_noise is None else -drawn)
    inverse = np.linalg.inv(inner)
    covariance = np.zeros((len(excited),) * 2)
    covariance[np.ix_(excited, excited)] = inverse @ middle @ inverse / np.outer(scale, scale)
    plain = np.linalg.lstsq(x, y, rcond=None)[0] / scale
    moved = dict(zip(np.flatnonzero(excited), plain, strict=True))
    return answer(
        "total-least-squares",
        problem,
        values,
        covariance,
        noise_model,
        x.shape[1],
        standings=_standings(problem, product, own * np.sqrt(n), excited),
        assumes=(
            "The noise of each regressor is white, of known size, and independent of all else.",
        ),
        notes=tuple(
            f"{problem.names[k]}: noise {deviation[k]:.3g}; least squares gives {plain:.4g}."
            for k, plain in moved.items()
            if deviation[k] > 0.0
        ),
    )


def _deviation(problem: Reduced, noise: Mapping[str, float] | None) -> Array:
    """(f,) noise of the columns of the unknown parameters."""
    constant = np.ptp(problem.columns, axis=0) == 0.0
    if noise is None:
        return np.where(constant, 0.0, _seen(problem))
    for name, size in noise.items():
        if name not in problem.names:
            raise InputError(
                f"no unknown parameter '{name}'", "noise", nearest(name, problem.names)
            )
        if not size >= 0.0:
            raise InputError(f"the noise of {name} is negative", "noise")
    return np.array([float(noise.get(name, 0.0)) for name in problem.names])


def _seen(problem: Reduced) -> Array:
    """White level (f,) of the columns, from their highest frequencies."""
    power, count = np.zeros(len(problem.names)), 0
    for block in problem.blocks(problem.columns):
        window = np.hanning(len(block))[:, None]
        spectrum = np.abs(np.fft.rfft((block - block.mean(axis=0)) * window, axis=0)) ** 2
        high = spectrum[int(_NOISE_BAND * len(spectrum)) : -1]
        if len(high):
            power += high.sum(axis=0) / float(np.sum(window**2))
            count += len(high)
    return np.sqrt(power / max(count, 1))


def _smallest_root(x: Array, y: Array, error: Array, response_noise: float) -> float:
    """The smallest root of total least squares, no more than 1."""
    from scipy.linalg import eigh  # slow to import

    if not response_noise > 0.0:
        raise InputError("the noise of the response is not positive", "noise")
    both = np.column_stack([x, y / (response_noise * np.sqrt(len(y)))])
    noisy = np.append(np.diag(error), 1.0)
    clean: Mask = np.asarray(noisy == 0.0)
    product = both.T @ both
    if clean.any():  # columns free of noise are projected out
        product = product[np.ix_(~clean, ~clean)] - product[
            np.ix_(~clean, clean)
        ] @ np.linalg.solve(product[np.ix_(clean, clean)], product[np.ix_(clean, ~clean)])
    return min(1.0, float(eigh(product, np.diag(noisy[~clean]), eigvals_only=True)[0]))


def _standings(problem: Reduced, product: Array, own: Array, excited: Mask) -> Standings:
    standings: dict[str, tuple[Standing, str]] = {}
    # What the other regressors do not explain of each.
    alone = 1.0 / np.diag(np.linalg.inv(product))
    reliability = 1.0 - own**2 / alone
    for k, part in zip(np.flatnonzero(excited), reliability, strict=True):
        if part < _RELIABLE:
            standings[problem.names[k]] = (
                "not identifiable",
                f"only {max(part, 0.0):.0%} of what other regressors do not explain of it is"
                " signal; fly larger manoeuvres, or give it a better sensor",
            )
    for k in np.flatnonzero(~excited):
        standings[problem.names[k]] = ("not excited", "its regressor stands still")
    return standings
