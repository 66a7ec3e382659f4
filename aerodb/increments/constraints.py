"""Priors, bounds and fixed values of estimates, and what their correlations say."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from aerodb.estimation import Regression
from aerodb.support import Array

#: Two estimates correlated beyond this cannot be separated by these flights; they are reported as
#: an alias group.
ALIAS_CORRELATION = 0.95


def correlation_of(covariance: Array) -> Array:
    """Correlation matrix (k, k); a fixed estimate is uncorrelated with the others."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    return np.asarray(
        covariance / np.outer(scale, scale) + np.diag(np.where(deviation > 0, 0.0, 1.0))
    )


@dataclass(frozen=True)
class ConstrainedFit:
    """Estimates (k,), their covariance (k, k), and the names of those at a bound."""

    estimates: Array
    covariance: Array
    at_bound: tuple[str, ...]


def constrained_fit(
    fit: Regression,
    prior: Mapping[str, tuple[float, float]],
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float] = MappingProxyType({}),
) -> ConstrainedFit:
    """The estimates of a fit with priors (value, sigma), bounds and fixed values applied.

    Minimises ``(x - x0)' C^-1 (x - x0)`` over the allowed x, with C the coloured covariance.
    """
    names, estimates, covariance = fit.names, fit.estimates, fit.covariance
    information = np.linalg.inv(covariance)
    right = information @ estimates
    for name, (value, sigma) in prior.items():
        if name in names:
            k = names.index(name)
            information[k, k] += sigma**-2
            right[k] += value * sigma**-2
    if prior:
        covariance = np.linalg.inv(information)
        estimates = covariance @ right
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for name, (lower, upper) in bounds.items():
        if name in names:
            low[names.index(name)], high[names.index(name)] = lower, upper
    held = {names.index(name): value for name, value in fixed.items() if name in names}
    free = [k for k in range(len(names)) if k not in held]
    if held:
        index = list(held)
        change = np.array([held[k] for k in index]) - estimates[index]
        gain = covariance[:, index] @ np.linalg.inv(covariance[np.ix_(index, index)])
        estimates = estimates + gain @ change
        covariance = covariance - gain @ covariance[index, :]
        covariance[index, :] = covariance[:, index] = 0.0
        estimates[index] = [held[k] for k in index]
    if np.all((estimates >= low) & (estimates <= high)):
        return ConstrainedFit(estimates, covariance, ())
    root = np.linalg.cholesky(np.linalg.inv(covariance[np.ix_(free, free)])).T
    from scipy.optimize import lsq_linear  # slow to import

    bounded = lsq_linear(root, root @ estimates[free], bounds=(low[free], high[free]), tol=1e-12).x
    estimates = estimates.copy()
    estimates[free] = bounded
    touching = (np.isclose(estimates, low) | np.isclose(estimates, high)) & np.isfinite(low)
    at_bound = tuple(name for name, touches in zip(names, touching, strict=True) if touches)
    return ConstrainedFit(estimates, covariance, at_bound)


def alias_groups(names: Sequence[str], correlation: Array) -> tuple[tuple[str, ...], ...]:
    """Return the groups of estimates, by their names (k,), that are linked by correlations (k, k)
    beyond `ALIAS_CORRELATION`, without the constant."""
    groups: list[set[str]] = []
    for i, one in enumerate(names):
        for j in range(i + 1, len(names)):
            if "1" in (one, names[j]) or abs(correlation[i, j]) < ALIAS_CORRELATION:
                continue
            touching = [g for g in groups if one in g or names[j] in g]
            groups = [g for g in groups if g not in touching]
            groups.append({one, names[j]}.union(*touching))
    return tuple(tuple(sorted(group)) for group in groups)
