"""Least squares on stacked records, with standard errors that remain valid when residuals are
correlated in time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len, rfft

from aerodb.support import Array

#: Share of a combination that does not vary from which on a regressor takes part in it.
_TIED = 1e-6
#: Variance inflation of such a regressor: the largest that is told from none.
_LARGEST = 1.0 / np.finfo(float).eps
#: Matrix products of at most so many multiplications run on one BLAS thread.
_SINGLE_THREAD = 200_000


@dataclass(frozen=True)
class Regression:
    """A least-squares fit.

    Parameters
    ----------
    names : of the k regressors.
    estimates : (k,).
    covariance : (k, k), corrected for coloured residuals.
    white_covariance : (k, k), as if the residuals were white.
    residual : (n,), response minus prediction.
    r_squared : coefficient of determination, about the mean of the response.
    vif : (k,) variance inflation factor of each regressor by the others; 1 for a constant.
    """

    names: tuple[str, ...]
    estimates: Array
    covariance: Array
    white_covariance: Array
    residual: Array
    r_squared: float
    vif: Array

    @property
    def standard_errors(self) -> Array:
        """Standard errors (k,), from the covariance for coloured residuals, in the unit of each
        estimate."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlation (k, k) of the estimates, from the covariance for coloured residuals, without
        unit; where an estimate has no error, its row is that of the unit matrix (no NaN)."""
        deviation = self.standard_errors
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.covariance / np.outer(deviation, deviation)
        return np.where(np.isfinite(ratio), ratio, np.eye(len(deviation)))


def least_squares(
    regressors: Array, response: Array, names: Sequence[str], lengths: Sequence[int] | None = None
) -> Regression:
    """Ordinary least squares with a covariance for coloured residuals.

    ``cov = (X'X)^-1 [sum_ij x_i R(i-j) x_j'] (X'X)^-1`` with ``R(k) = (1/N) sum v_i v_(i+k)``. The
    double sum runs within each record only: records are independent.

    Parameters
    ----------
    regressors : (n, k), with a column of ones if a constant is wanted.
    response : (n,).
    names : k names.
    lengths : samples of each record in order, summing to n; None: one record.

    Raises ValueError naming the regressors that are linearly dependent or never excited, and for
    too few samples.

    References
    ----------
    Morelli & Klein, Journal of Guidance, Control, and Dynamics 20(1), 1997, eq. 31.
    """
    n, k = regressors.shape
    if n <= k:
        raise ValueError(f"{n} samples cannot give {k} estimates")
    scale = np.linalg.norm(regressors, axis=0)
    if np.any(scale == 0):
        zero = [name for name, s in zip(names, scale, strict=True) if s == 0]
        raise ValueError(f"never excited: {', '.join(zero)}")
    scaled = regressors / scale
    _, singular, right = np.linalg.svd(scaled, full_matrices=False)
    if singular[-1] < singular[0] * n * np.finfo(float).eps:
        tied = [
            name
            for name, weight in zip(names, np.abs(right[-1]), strict=True)
            if weight > 0.1 * np.abs(right[-1]).max()
        ]
        raise ValueError(f"linearly dependent: {', '.join(tied)}")
    estimates = np.linalg.lstsq(scaled, response, rcond=None)[0]
    residual = response - scaled @ estimates
    inverse = (right.T / singular**2) @ right
    middle = np.zeros((k, k))
    start = 0
    for length in lengths if lengths is not None else (n,):
        block = slice(start, start + length)
        middle += coloured_sum(scaled[block], residual[block])
        start += length
    if start != n:
        raise ValueError(f"record lengths sum to {start}, samples are {n}")
    centred = response - response.mean()
    total = float(centred @ centred)
    outer = np.outer(scale, scale)
    return Regression(
        names=tuple(names),
        estimates=estimates / scale,
        covariance=inverse @ middle @ inverse / outer,
        white_covariance=inverse * float(residual @ residual) / (n - k) / outer,
        residual=residual,
        r_squared=1.0 - float(residual @ residual) / total if total > 0 else 0.0,
        vif=_variance_inflation(regressors),
    )


def own_constants(regressors: Array, lengths: Sequence[int], constant: int) -> tuple[Array, Array]:
    """Replace the constant in column `constant` by one constant per record.

    Parameters
    ----------
    regressors : (n, k).
    lengths : samples of each of the g records, in order.

    Returns
    -------
    Regressors (n, k - 1 + g), the constants last; and the matrix (k, k - 1 + g) that turns their
    estimates into those of the k columns, where the constant is the mean of the g constants.

    >>> own_constants(np.array([[1.0, 2.0], [1.0, 3.0]]), [1, 1], 0)[0].tolist()
    [[2.0, 1.0, 0.0], [3.0, 0.0, 1.0]]
    """
    k, g = regressors.shape[1], len(lengths)
    wide = np.column_stack(
        [np.delete(regressors, constant, axis=1), np.repeat(np.eye(g), lengths, axis=0)]
    )
    mix = np.zeros((k, k - 1 + g))
    mix[np.delete(np.arange(k), constant), np.arange(k - 1)] = 1.0
    mix[constant, k - 1 :] = 1.0 / g
    return wide, mix


def with_mean_constant(
    fit: Regression, mix: Array, names: Sequence[str], constant: int
) -> Regression:
    """Turn a fit with `own_constants` back into one of the k columns `names`.

    The variance of the mean constant includes the scatter of the constants between records.
    `residual` and `r_squared` remain those of the fit with one constant per record.

    mix : (k, k - 1 + g) of `own_constants`. Units are those of the fit.
    """
    k = len(mix)
    intercepts = fit.estimates[k - 1 :]
    covariance = mix @ fit.covariance @ mix.T
    if len(intercepts) > 1:
        covariance[constant, constant] += float(intercepts.var(ddof=1)) / len(intercepts)
    return Regression(
        names=tuple(names),
        estimates=mix @ fit.estimates,
        covariance=covariance,
        white_covariance=mix @ fit.white_covariance @ mix.T,
        residual=fit.residual,
        r_squared=fit.r_squared,
        vif=np.insert(fit.vif[: k - 1], constant, 1.0),
    )


def coloured_sum(regressors: Array, residual: Array) -> Array:
    """``sum_ij x_i R(i-j) x_j'`` (k, k) of one record, computed by FFT.

    Its unit is the square of the product of a regressor's and the residual's. Morelli & Klein,
    Journal of Guidance, Control, and Dynamics 20(1), 1997, eq. 31.

    Parameters
    ----------
    regressors : x (n, k).
    residual : v (n,), with the autocorrelation ``R(k) = (1/n) sum v_i v_(i+k)``.
    """
    return shared_coloured_sum([(regressors, residual, len(residual))])


def shared_coloured_sum(equations: Sequence[tuple[Array, Array, int]]) -> Array:
    """`coloured_sum` (k, k) of m equations of one record, whose residuals may share errors: the sum
    runs over all pairs of equations, with the cross-correlation of their residuals.

    equations : regressors (n, k), zero where they are not used, residual (n,), zero there too, and
    the number of samples that are used.

    R is even, so that its transform weights the cross spectra of x. The residual is padded to twice
    its length, so that the transform of R is the squared transform of the residual. The product is
    computed in blocks too small for BLAS threads, whose contention costs more than the product.
    """
    n, k = equations[0][0].shape
    size = next_fast_len(2 * n)
    cross = np.zeros((size // 2 + 1, k), dtype=np.complex128)
    for regressors, residual, used in equations:
        weight = rfft(residual, size).conj() / np.sqrt(used)
        cross += rfft(regressors, size, axis=0) * weight[:, None]
    cross[1 : -1 if size % 2 == 0 else None] *= np.sqrt(2.0)
    total = np.zeros((k, k))
    rows = max(8, _SINGLE_THREAD // max(k, 1) ** 2)
    for start in range(0, len(cross), rows):
        for part in (cross.real[start : start + rows], cross.imag[start : start + rows]):
            block = np.ascontiguousarray(part)
            total += block.T @ block
    return total / size


def samples_per_independent(residual: Array) -> float:
    """Return how many samples of a coloured residual (n,) count as one independent sample, at least
    1.

    ``1 + 2 sum of its autocorrelation``, here up to the first zero crossing (Bartlett 1946).
    """
    size = next_fast_len(2 * len(residual))
    correlation = np.fft.irfft(np.abs(np.fft.rfft(residual, size)) ** 2, size)[: len(residual)]
    if correlation[0] <= 0:
        return 1.0
    crossing = np.flatnonzero(correlation <= 0)
    stop = int(crossing[0]) if len(crossing) else len(residual)
    return float(max(1.0, 2.0 * correlation[:stop].sum() / correlation[0] - 1.0))


def _variance_inflation(regressors: Array) -> Array:
    """Variance inflation factors (k,) due to the other regressors and the constant; 1 for a
    constant, `_LARGEST` for those of which a combination does not vary."""
    spread = regressors.std(axis=0)
    varying = spread > 1e-12 * np.abs(regressors).max(axis=0)
    vif = np.ones(regressors.shape[1])
    if varying.sum() > 1:
        standard = (regressors[:, varying] - regressors[:, varying].mean(axis=0)) / spread[varying]
        values, vectors = np.linalg.eigh(standard.T @ standard / len(standard))
        told = values > len(values) * np.finfo(float).eps * values[-1]
        shares = vectors**2
        tied = (shares[:, ~told] > _TIED).any(axis=1)
        vif[varying] = np.where(tied, _LARGEST, shares[:, told] @ (1.0 / values[told]))
    return vif
