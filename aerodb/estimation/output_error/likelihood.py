"""Likelihood of measured outputs whose noise covariance is estimated with the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.estimation.output_error.sensitivities import ModelResponse
from aerodb.support import Array, Mask

#: Whether the noise of different outputs is taken as uncorrelated.
Covariance = Literal["diagonal", "full"]

#: Smallest noise of an output, as a share of its rms: below, only rounding is left.
_SMALLEST = 1e-10


@dataclass(frozen=True, eq=False)
class MeasuredOutputs:
    """Outputs of one record (n, o), and which of them were measured (n, o); others are 0."""

    values: Array
    mask: Mask

    def residual(self, outputs: Array) -> Array:
        """Measured minus model, 0 where not measured. Outputs (n, o), in SI units."""
        return np.where(self.mask, self.values - outputs, 0.0)


def measured(values: Array) -> MeasuredOutputs:
    """Return outputs (n, o) of a record, in SI units, with NaN where they were not measured, as
    values and mask."""
    mask = np.isfinite(values)
    return MeasuredOutputs(np.where(mask, values, 0.0), mask)


@dataclass(frozen=True, eq=False)
class Noise:
    """Estimated measurement noise of o outputs.

    Parameters
    ----------
    covariance : (o, o). count : (o,) samples of each output.
    log_likelihood : of the residuals that it was estimated from, without priors.
    """

    covariance: Array
    count: Array
    log_likelihood: float


def noise_of(
    records: Sequence[MeasuredOutputs], residuals: Sequence[Array], kind: Covariance
) -> Noise:
    """Covariance of the residuals, at which their likelihood is greatest for the parameters as they
    are: the relaxation step of output error.

    Residuals (n, o) of each record give a covariance (o, o), in the square of their SI units.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2016, eqs. 6.32 and 6.33.
    """
    squares = sum(residual.T @ residual for residual in residuals)
    together = sum(record.mask.T.astype(float) @ record.mask for record in records)
    count = np.diag(together).copy()
    floor = np.array(sum(np.sum(record.values**2, axis=0) for record in records)) / np.maximum(
        count, 1.0
    )
    floor = np.maximum(_SMALLEST**2 * floor, 1e-300)
    covariance = np.asarray(squares) / np.maximum(together, 1.0)
    variance = np.maximum(np.diag(covariance), floor)
    if kind == "diagonal":
        covariance = np.diag(variance)
        return Noise(
            covariance, count, -0.5 * float(count @ (np.log(2.0 * np.pi * variance) + 1.0))
        )
    deviation = np.sqrt(variance)
    correlation = covariance / np.outer(deviation, deviation)
    values, vectors = np.linalg.eigh(correlation)
    correlation = (vectors * np.maximum(values, _SMALLEST)) @ vectors.T
    noise = Noise(correlation * np.outer(deviation, deviation), count, 0.0)
    logs = 0.0
    for record, residual in zip(records, residuals, strict=True):
        white, _ = whitened(record, residual, np.zeros((*residual.shape, 0)), noise)
        logs -= 0.5 * float(np.sum(white**2)) + _log_determinants(record, noise)
    return Noise(noise.covariance, count, logs)


def _patterns(mask: Mask) -> list[tuple[Mask, Mask]]:
    """Each set of outputs that was measured together, and its samples."""
    return [(row, (mask == row).all(axis=1)) for row in np.unique(mask, axis=0) if row.any()]


def _log_determinants(record: MeasuredOutputs, noise: Noise) -> float:
    total = 0.0
    for outputs, samples in _patterns(record.mask):
        part = 2.0 * np.pi * noise.covariance[np.ix_(outputs, outputs)]
        total += 0.5 * float(samples.sum()) * float(np.linalg.slogdet(part)[1])
    return total


def whitened(
    record: MeasuredOutputs, residual: Array, slopes: Array, noise: Noise
) -> tuple[Array, Array]:
    """Residual (n, o) and slopes (n, o, g) in units of the noise, uncorrelated between outputs; 0
    where not measured."""
    off = noise.covariance - np.diag(np.diag(noise.covariance))
    if not off.any():
        weight = 1.0 / np.sqrt(np.diag(noise.covariance))
        if record.mask.all():
            return residual * weight, slopes * weight[:, None]
        scaled = record.mask * weight
        return residual * weight, np.where(scaled[:, :, None] > 0, slopes, 0.0) * scaled[:, :, None]
    white, out = np.zeros_like(residual), np.zeros_like(slopes)
    for outputs, samples in _patterns(record.mask):
        part = np.linalg.cholesky(noise.covariance[np.ix_(outputs, outputs)])
        inverse = solve_triangular(part, np.eye(len(part)), lower=True)
        at = np.ix_(samples, outputs)
        white[at] = residual[at] @ inverse.T
        out[at] = np.einsum("pq,nqg->npg", inverse, slopes[at])
    return white, out


@dataclass(frozen=True, eq=False)
class Beside:
    """What a cost holds beside the likelihood.

    Parameters
    ----------
    cycles : the deviation's lowest frequencies, up to so many cycles in a record, that count once
        more; 0: none do.
    held : (f, f) information of what is held near its start values; None where nothing is.
    """

    cycles: int = 0
    held: Array | None = None

    def counted(self, values: Array) -> Array:
        """Return samples (n, ...) of a record with their lowest frequencies once more, in their
        unit."""
        if not self.cycles:
            return values
        basis = lowest(len(values), self.cycles)
        return np.asarray(values + np.tensordot(basis, np.tensordot(basis.T, values, 1), 1))


def lowest(n: int, cycles: int) -> Array:
    """Orthonormal functions (n, 2 + 2 c), dimensionless, of a line and of the lowest c
    frequencies."""
    turn = 2.0 * np.pi * np.arange(n) / n
    rows = [np.ones(n), np.linspace(-1.0, 1.0, n)]
    for k in range(1, cycles + 1):
        rows += [np.cos(k * turn), np.sin(k * turn)]
    return np.asarray(np.linalg.qr(np.column_stack(rows))[0])


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of the f unknowns, without priors.

    Parameters
    ----------
    information : (f, f), of Fisher. gradient : (f,), of the log-likelihood.
    scatter : (f, f), covariance of the gradient for white residuals: the information, unless some
        of it counts once more.
    curvature : (f, f), information with what the estimate of the noise gives way when the
        parameters move: Newton's matrix of the likelihood that is maximised over the noise.
    gaps : (c,) of the constraints; gap_slopes (c, f) their derivatives.
    """

    information: Array
    gradient: Array
    scatter: Array
    curvature: Array
    gaps: Array
    gap_slopes: Array


def no_equations(unknowns: int) -> Normal:
    """Return the normal equations of f unknowns without any record. Zeros (f, f) and (f,), and
    constraints (0, f)."""
    square = np.zeros((unknowns, unknowns))
    return Normal(square, np.zeros(unknowns), square, square, np.zeros(0), np.zeros((0, unknowns)))


def normal_equations(
    records: Sequence[MeasuredOutputs],
    responses: Sequence[ModelResponse],
    noise: Noise,
    unknowns: int,
    kind: Covariance,
    beside: Beside,
) -> Normal:
    """Return sums over all records, weighted by the noise: matrix (f, f) and gradient (f,), in one
    over the unknowns' units. beside : which frequencies count once more.

    The second term of the curvature is ``-1/(2 N) tr(S_a S_b)``, S_a being the derivative of the
    sum of the squares of the whitened residuals: without it the noise and the parameters are
    estimated in turn, which takes several times as many steps.
    """
    information, gradient = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    scatter = np.zeros((unknowns, unknowns)) if beside.cycles else information
    gaps, gap_slopes = list[Array](), list[Array]()
    o = len(noise.covariance)
    square_slopes = np.zeros((o, o, unknowns))
    for record, response in zip(records, responses, strict=True):
        white, slopes = whitened(record, record.residual(response.outputs), response.slopes, noise)
        flat = slopes.reshape(-1, slopes.shape[-1])
        at = response.columns
        slopes = beside.counted(slopes)
        weighted = slopes.reshape(flat.shape)
        information[np.ix_(at, at)] += flat.T @ weighted
        if beside.cycles:
            scatter[np.ix_(at, at)] += weighted.T @ weighted
        for j in range(o):
            if kind == "full":
                square_slopes[:, j, at] += white.T @ slopes[:, j]
            else:
                square_slopes[j, j, at] += white[:, j] @ slopes[:, j]
        gaps.append(response.gaps)
        wide = np.zeros((len(response.gaps), unknowns))
        wide[:, at] = response.gap_slopes
        gap_slopes.append(wide)
    gradient = np.einsum("jjf->f", square_slopes)
    both = square_slopes + np.swapaxes(square_slopes, 0, 1)
    both = both / np.sqrt(2.0 * np.maximum(noise.count, 1.0))[:, None, None]
    both = both.reshape(-1, unknowns)
    return Normal(
        information,
        gradient,
        scatter,
        information - both.T @ both,
        np.concatenate(gaps),
        np.concatenate(gap_slopes),
    )


def coloured_information(
    records: Sequence[MeasuredOutputs],
    responses: Sequence[ModelResponse],
    noise: Noise,
    unknowns: int,
    beside: Beside,
) -> tuple[Array, float]:
    """``sum_ij S_i' R^-1 Rvv(i-j) R^-1 S_j`` (f, f), with the autocorrelation Rvv of the residuals
    v, which is the information where they are white; and how many independent samples the residuals
    of all outputs count as. Slopes S are those of the cost, with what counts once more (`beside`).

    The residuals are first made uncorrelated between outputs at each sample; the autocorrelation
    of each is that of an autoregressive model (`coloured_noise`).

    References
    ----------
    Morelli & Klein, Journal of Guidance, Control, and Dynamics 20(1), 1997, eq. 22.
    """
    total = np.zeros((unknowns, unknowns))
    whites, slopes = list[Array](), list[Array]()
    for record, response in zip(records, responses, strict=True):
        white, slope = whitened(record, record.residual(response.outputs), response.slopes, noise)
        whites.append(white)
        slopes.append(beside.counted(slope))
    squares = np.asarray(sum(white.T @ white for white in whites))
    deviation = np.sqrt(np.maximum(np.diag(squares), 1e-300))
    correlation = squares / np.outer(deviation, deviation)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    mix = np.linalg.cholesky((vectors * np.maximum(values, 1e-9)) @ vectors.T)
    apart = np.linalg.inv(mix)
    independent = 0.0
    for j in range(len(mix)):
        model = autoregressive_noise(
            [
                (white @ apart[j])[record.mask[:, j]]
                for record, white in zip(records, whites, strict=True)
                if record.mask[:, j].any()
            ]
        )
        independent += model.independent
        for slope, response in zip(slopes, responses, strict=True):
            own = np.einsum("nog,o->ng", slope, mix[:, j])
            at = response.columns
            total[np.ix_(at, at)] += model.summed(own)
    return total, independent
