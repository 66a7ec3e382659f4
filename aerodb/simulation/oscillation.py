"""Period and damping of a free oscillation in a response, flown or simulated."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import OptimizeWarning, curve_fit

from aerodb.support import Array

#: Fewest periods and least share of the variance that an oscillation must explain.
_PERIODS: Final = 1.0
_EXPLAINED: Final = 0.9
#: Largest standard error of the damping ratio: beyond, nothing is known of it.
_UNKNOWN: Final = 0.05


@dataclass(frozen=True)
class Oscillation:
    """A damped oscillation, with standard errors of its parameters.

    omega : undamped frequency [rad/s]. zeta : damping ratio. period : of the damped motion [s].
    half_time : time in which the amplitude halves [s]; negative where it doubles.
    """

    omega: float
    zeta: float
    period: float
    half_time: float
    sigma_omega: float
    sigma_zeta: float


def oscillation(time: Array, values: Array) -> Oscillation | None:
    """Fit ``exp(s t) (a cos w t + b sin w t) + c + d t`` to a response after the controls have come
    to rest.

    Parameters
    ----------
    time, values : (n,), uniform [s]; samples that are NaN are left out.

    Returns None where no oscillation of at least one period explains 90 % of the variance about a
    straight line, or its damping ratio is not known to .05. Standard errors are those of white
    residuals.
    """
    good = np.isfinite(values)
    if good.sum() < 20:
        return None
    t, y = time[good] - time[good][0], values[good]
    line = np.polynomial.Polynomial.fit(t, y, 1)
    spread = float(np.var(y - line(t)))
    length = float(t[-1])
    if spread <= 0.0 or length <= 0.0:
        return None
    best: tuple[float, Array, Array] | None = None
    for cycles in (0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0, 15.0):
        w = 2.0 * np.pi * cycles / length
        if cycles > len(t) / 8.0:
            break
        fitted = _fitted(t, y, -0.1 * w, w)
        if fitted is not None:
            parameters, covariance = fitted
            left = float(np.var(y - _model(t, *parameters)))
            if best is None or left < best[0]:
                best = left, parameters, covariance
    if best is None or not np.isfinite(best[2]).all():  # a straight line has no frequency
        return None
    left, parameters, covariance = best
    s, w = float(parameters[0]), abs(float(parameters[1]))
    if left > (1.0 - _EXPLAINED) * spread or w * length < 2.0 * np.pi * _PERIODS:
        return None
    omega = float(np.hypot(s, w))
    zeta = -s / omega
    by = np.array([[s / omega, w / omega], [-(w**2) / omega**3, s * w / omega**3]])
    errors = np.sqrt(np.maximum(np.diag(by @ covariance[:2, :2] @ by.T), 0.0))
    if not errors[1] < _UNKNOWN:
        return None
    half = float(np.log(2.0) / -s) if s else np.inf
    return Oscillation(
        omega, float(zeta), 2.0 * np.pi / w, half, float(errors[0]), float(errors[1])
    )


def _model(t: Array, s: float, w: float, a: float, b: float, c: float, d: float) -> Array:
    decay = np.exp(np.clip(s * t, -50.0, 50.0))
    return np.asarray(decay * (a * np.cos(w * t) + b * np.sin(w * t)) + c + d * t)


def _fitted(t: Array, y: Array, s: float, w: float) -> tuple[Array, Array] | None:
    columns = np.stack([_model(t, s, w, *row) for row in np.eye(4)], axis=1)
    amplitudes = np.linalg.lstsq(columns, y, rcond=None)[0]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OptimizeWarning)
            return curve_fit(_model, t, y, (s, w, *amplitudes), maxfev=400)
    except (RuntimeError, ValueError):
        return None


def at_rest_from(time: Array, inputs: Sequence[Array], margin: float = 0.2) -> int:
    """Sample from which all inputs (n,) stay within `margin` of the widest range of any about
    their last values; n where none moves, or there are none."""
    rows = np.array(inputs).reshape(len(inputs), len(time))
    widest = float(np.ptp(rows, axis=1).max(initial=0.0))
    moved = np.abs(rows - rows[:, -1:]) > margin * widest
    last = np.flatnonzero(moved.any(axis=0))
    return int(last[-1]) + 1 if last.size else len(time)
