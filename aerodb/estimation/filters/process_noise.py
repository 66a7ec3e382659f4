"""Whether a record needs process noise, and which method to believe."""

from dataclasses import dataclass
from math import comb, inf

import numpy as np

from aerodb.estimation.fit import Fit
from aerodb.estimation.whiteness import ljung_box

#: Probability below which process noise is needed.
NOT_NEEDED = 0.05
#: Process noise explains a record if it makes the longest correlation of residuals shorter by this
#: factor.
_SHORTER = 3.0
#: Process noise explains nothing of an output whose correlation it makes shorter by less than this.
_TOUCHED = 2.0
#: Residuals are nearly white where fewer samples than this count as one.
_WHITE = 1.5


@dataclass(frozen=True)
class ProcessNoiseTest:
    """Likelihood ratio of process noise.

    ratio : twice the difference of the log-likelihoods. p_value : of no process noise.
    needed : whether it is significant, or without it nothing follows the motion.
    """

    ratio: float
    p_value: float
    needed: bool


def boundary_p_value(ratio: float, count: int) -> float:
    """Return the probability (a scalar) of so large a likelihood ratio where the `count`
    intensities are all zero.

    A zero is at the bound, so that each intensity is zero in half of such records: the ratio is a
    mixture of chi-squares with binomial weights.

    References
    ----------
    Self & Liang, Journal of the American Statistical Association 82, 1987, case 9.

    >>> round(boundary_p_value(2.706, 1), 3)
    0.05
    """
    from scipy.special import gammaincc  # slow to import

    if count == 0 or not ratio > 0.0:
        return 1.0
    if ratio == inf:
        return 0.0
    weights = [comb(count, j) / 2.0**count for j in range(1, count + 1)]
    tails = [float(gammaincc(0.5 * j, 0.5 * ratio)) for j in range(1, count + 1)]
    return float(np.dot(weights, tails))


@dataclass(frozen=True)
class Recommendation:
    """Which of two fits to believe.

    method : of the fit to believe; empty where neither is to be believed. reason : why, a sentence.
    """

    method: str
    reason: str


def output_or_filter_error(output_error: Fit, filter_error: Fit) -> Recommendation:
    """Judge whether turbulence makes output error biased, so that filter error is to be believed.

    The likelihood ratio of process noise decides, unless white noise on the rates does not explain
    the record: a model that lacks something else also makes process noise likely, but leaves the
    innovations of some output as correlated in time as the residuals of output error. What output
    error shows of turbulence by itself is said too: residuals that are correlated in time, and
    estimates that differ.
    """
    if not filter_error.converged:
        trusted = output_error.method if output_error.converged else ""
        return Recommendation(trusted, "Filter error did not converge.")
    p_value = filter_error.tests["process noise"]
    if p_value >= NOT_NEEDED:
        if not output_error.converged:
            return Recommendation(filter_error.method, "Output error did not converge.")
        return Recommendation(
            output_error.method,
            f"The record shows no process noise (p = {p_value:.2g}): both methods are unbiased, and"
            " output error assumes less.",
        )
    memories, before = _memories(filter_error), _memories(output_error)
    name = max(memories, key=lambda each: memories[each], default="")
    memory = memories.get(name, 0.0)
    as_long = memory * _SHORTER > max(before.values(), default=0.0)
    untouched = memory * _TOUCHED > before.get(name, np.inf)
    far = _farthest(output_error, filter_error)
    white = bool(before) and max(before.values()) < _WHITE
    if output_error.converged and white and not far:
        return Recommendation(
            output_error.method,
            f"Process noise is significant (p = {p_value:.2g}), but too small to matter. The"
            " residuals of output error are nearly white, its estimates are those of filter error,"
            " and it assumes less.",
        )
    if output_error.converged and memory >= _WHITE and (as_long or untouched):
        return Recommendation(
            output_error.method,
            f"Process noise is significant (p = {p_value:.2g}), but does not explain the record:"
            f" innovations of {name} stay correlated over {memory:.0f} samples. The model lacks"
            " something else, and output error assumes less.",
        )
    parts = [
        f"Process noise drives the motion (p = {p_value:.2g}), which output error has no place for"
    ]
    if not output_error.converged:
        parts.append("it does not converge")
    elif coloured := _coloured(output_error):
        parts.append(f"its residuals are correlated from sample to sample ({', '.join(coloured)})")
    if far:
        parts.append(far)
    return Recommendation(filter_error.method, "; ".join(parts) + ".")


def _memories(fit: Fit) -> dict[str, float]:
    """Return how many residuals of each output count as one independent sample."""
    found: dict[str, float] = {}
    for name in dict.fromkeys(name for record in fit.residuals.values() for name in record):
        _, correlation = ljung_box([record[name] for record in fit.residuals.values()])
        if np.isfinite(correlation):
            found[name] = (1.0 + correlation) / max(1.0 - correlation, 1e-9)
    return found


def _coloured(fit: Fit) -> list[str]:
    """Outputs whose residuals are not white, each with its correlation at one sample."""
    names = dict.fromkeys(name for record in fit.residuals.values() for name in record)
    found = []
    for name in names:
        p_value, correlation = ljung_box([record[name] for record in fit.residuals.values()])
        if p_value < NOT_NEEDED:
            found.append(f"{name} {correlation:.2f}")
    return found


def _farthest(output_error: Fit, filter_error: Fit) -> str:
    """The estimate that differs most, in standard errors of filter error."""
    most, words = 2.0, ""
    for own in output_error.estimates:
        other = next((each for each in filter_error.estimates if each.name == own.name), own)
        if other.standard_error > 0.0 and np.isfinite(own.value):
            away = abs(own.value - other.value) / other.standard_error
            if away > most:
                most = away
                words = (
                    f"{own.name} is {own.value:.4g} by it and {other.value:.4g} by filter error,"
                    f" {away:.1f} standard errors away"
                )
    return words
