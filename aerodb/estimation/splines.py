"""Splines in one variable, by their values at knots, and the choice of knots.

A basis function is 1 at one knot and 0 at all others, so that a coefficient is the value of the
spline at its knot ("Aerodynamic Model Update Using Parameter Identification Supporting a Cessna
Grand Caravan Engineering Simulation", eqs. 26 and 28). Beyond the outer knots a spline is held.
"""

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.support import Array

#: Straight between knots; or smooth, of third degree.
SplineKind = Literal["linear", "cubic"]

#: Share of the samples beyond the outer knots that are chosen, on each side.
_BEYOND: Final = 0.002
#: Even intervals between the outer knots, at whose ends a knot may be.
_INTERVALS: Final = 20


def piecewise_polynomials(knots: Sequence[float], kind: SplineKind) -> Array:
    """Coefficients (K, K - 1, d) of the K basis functions: on interval i, function j is
    ``sum_d c[j, i, d] (x - knots[i])^d``, with d from 0.

    Cubic splines have no knot at the second and the last but one place (de Boor, 1978), so that
    they reproduce any cubic; with three knots they are a parabola.

    >>> piecewise_polynomials([0.0, 2.0], "linear").tolist()
    [[[1.0, -0.5]], [[0.0, 0.5]]]
    """
    points = np.asarray(knots, dtype=float)
    if len(points) < 2 or not np.all(np.diff(points) > 0):
        raise InputError("a spline needs at least two knots that increase", "knots")
    unit = np.eye(len(points))
    if kind == "linear" or len(points) == 2:
        slope = np.diff(unit, axis=0) / np.diff(points)[:, None]
        return np.stack([unit[:-1].T, slope.T], axis=2)
    from scipy.interpolate import CubicSpline  # slow to import

    return np.asarray(CubicSpline(points, unit).c.transpose(2, 1, 0)[:, :, ::-1])


def spline_basis(values: Array, knots: Sequence[float], kind: SplineKind) -> Array:
    """Return basis functions (n, K), dimensionless, of K knots at values (n,); constant beyond the
    knots."""
    points = np.asarray(knots, dtype=float)
    coefficients = piecewise_polynomials(knots, kind)
    held = np.clip(values, points[0], points[-1])
    place = np.clip(np.searchsorted(points, held, side="right") - 1, 0, len(points) - 2)
    beyond = held - points[place]
    total = np.zeros((len(held), len(points)))
    for degree in range(coefficients.shape[2]):
        total += coefficients[:, place, degree].T * beyond[:, None] ** degree
    return total


def chosen_knots(
    values: Array,
    response: Array,
    others: Array,
    kind: SplineKind = "linear",
    factor: Array | None = None,
    lengths: Sequence[int] | None = None,
) -> tuple[float, ...]:
    """Return the knots that describe a response best.

    The outer knots hold all but 0.4 % of the samples, with 21 knots in all, evenly spaced. The one
    whose loss raises the sum of squares least is taken away, again and again; kept is the set with
    the lowest Bayesian information criterion. Its number of samples is that of the independent
    ones, by the colour of the residual: counted singly, correlated residuals make any number of
    knots seem worthwhile.

    Parameters
    ----------
    values : variable of the spline (n,). response : (n,).
    others : regressors (n, k) without the spline; may have no column.
    factor : (n,) that the spline multiplies; None: 1.
    lengths : samples of each record in order; None: one record.

    References
    ----------
    Schwarz, Annals of Statistics 6(2), 1978. Smith, Curve Fitting with Spline Functions using
    Statistical Variable Selection Methods, NASA CR-166034, 1982.

    Raises InputError where the variable does not move.
    """
    low, high = (float(v) for v in np.quantile(values, [_BEYOND, 1.0 - _BEYOND]))
    if not high > low:
        raise InputError("the variable of a spline does not move", "knots")
    knots = tuple(np.linspace(low, high, _INTERVALS + 1).tolist())
    basis = spline_basis(values, knots, kind)
    columns = np.column_stack([others, basis if factor is None else basis * factor[:, None]])
    found = np.linalg.lstsq(columns, response, rcond=1e-10)[0]
    edges = np.cumsum(list(lengths if lengths is not None else [len(values)]))[:-1]
    noise = autoregressive_noise(np.split(response - columns @ found, edges))
    # A spline with some of the knots lies in the span of all: what remains is small.
    _, root = np.linalg.qr(np.column_stack([columns, response]))
    kept, k = list(knots), others.shape[1]

    def squares(some: Sequence[float]) -> float:
        turn = np.zeros((columns.shape[1], k + len(some)))
        turn[:k, :k] = np.eye(k)
        turn[k:, k:] = spline_basis(np.array(knots), some, kind)
        small = root[:, :-1] @ turn
        rest = root[:, -1] - small @ np.linalg.lstsq(small, root[:, -1], rcond=1e-10)[0]
        return float(rest @ rest)

    def criterion(some: Sequence[float], left: float) -> float:
        fit = noise.independent * np.log(max(left, 1e-300) / len(values))
        return float(fit + (k + len(some)) * np.log(max(noise.independent, 2.0)))

    best, least = tuple(kept), criterion(kept, squares(kept))
    while len(kept) > 2:
        without = [kept[:j] + kept[j + 1 :] for j in range(1, len(kept) - 1)]
        left = [squares(some) for some in without]
        kept = without[int(np.argmin(left))]
        value = criterion(kept, min(left))
        if value <= least:
            best, least = tuple(kept), value
    return best
