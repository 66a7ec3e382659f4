"""Rates of false alarms, and the standard errors and ratios of likelihoods that keep them.

Whoever claims something by one more parameter compares its estimate with its standard error, or the
likelihoods with and without it: both have the same rate (Wilks, Ann. Math. Stat. 9, 1938).
"""

from statistics import NormalDist
from typing import Any, Final

#: 95 % of a normal distribution lie within this many standard errors.
TWO_SIDED: Final = 1.96
#: Rate of a claim that a flight, a file or a database is wrong, where none is. A flight is asked
#: some fifty times, so that one right flight in a hundred is suspected.
CLAIM = 2e-4
#: Rate at which a value is called different from another, and corrected or said: three standard
#: errors.
DIFFERENCE = 0.0027
#: Rate at which a value is taken as a hint of another cause: two standard errors.
HINT = 0.0455


def standard_errors(rate: float) -> float:
    """Return the standard errors beyond which a normal variable is with this probability.

    rate : of both sides together, 0 < rate < 1; StatisticsError for another.

    >>> round(standard_errors(0.0027), 3)
    3.0
    """
    return -NormalDist().inv_cdf(0.5 * rate)


def likelihood_gain(rate: float) -> float:
    """Return the gain of the logarithm of a likelihood by one parameter that chance exceeds with
    this probability.

    rate : 0 < rate < 1; StatisticsError for another. Source: Wilks, Ann. Math. Stat. 9 (1938).

    >>> round(likelihood_gain(0.0455), 2)
    2.0
    """
    return 0.5 * standard_errors(rate) ** 2


def half_interval(standard_error: Any) -> Any:
    """Half of a 95 % interval: what stands behind every ``+-`` that people read
    (scalar or array, in the same unit).

    >>> half_interval(0.5)
    0.98
    """
    return TWO_SIDED * standard_error
