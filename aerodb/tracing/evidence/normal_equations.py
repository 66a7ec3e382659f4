"""Normal equations of one flight: whitened cross-products of intercepts, hypotheses and residual.

Columns are ``intercepts | hypotheses | residual``; on each axis they are low-passed, decimated and
whitened alike and divided by the standard deviation of the innovation; the products are summed over
the axes. Later steps use nothing else of a flight, so that one more flight costs one such matrix.
docs/method/tracing.md, sections 5 and 6.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.support import Array, Mask
from aerodb.tracing.evidence.autoregression import correlation_time, fit, whiten
from aerodb.tracing.evidence.evidence import NUISANCE, Evidence
from aerodb.tracing.evidence.low_pass import BandLimitedFlight, Records, centred, in_band
from aerodb.tracing.settings import TracingSettings

#: Form of stored normal equations.
NORMAL_EQUATIONS_VERSION = 2


@dataclass(frozen=True)
class FlightNormalEquations:
    """Whitened cross-products of one flight, k = intercepts + hypotheses + 1 columns.

    flight : id of the unit. axes : those that carry residuals, in the order of the intercepts.
    hypotheses : ids, in the order of the columns. matrix (k, k). noisy : mean over the copies with
    the state noise added once more, same form, or None. spread (axes,) : standard deviation of the
    innovation, coefficient units; correlation (axes,) : s, of the residual; samples (axes,) : after
    decimation. excitation (hypotheses,) : rms of the column about its mean in the band, on the axis
    where it is largest against the noise. squares (axes, hypotheses + 1) : each column, and the
    residual, with itself about its mean on each axis; their sums are those of `matrix`.
    """

    flight: str
    axes: tuple[str, ...]
    hypotheses: tuple[str, ...]
    matrix: Array
    noisy: Array | None
    spread: Array
    correlation: Array
    samples: NDArray[np.int64]
    excitation: Array
    squares: Array

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return plain arrays for a store; absent matrices are empty (0, 0). See
        `normal_equations_from_arrays`.
        """
        return {
            "version": np.array(NORMAL_EQUATIONS_VERSION),
            "flight": np.array(self.flight),
            "axes": np.array(self.axes, dtype=np.str_),
            "hypotheses": np.array(self.hypotheses, dtype=np.str_),
            "matrix": self.matrix,
            "noisy": np.zeros((0, 0)) if self.noisy is None else self.noisy,
            "spread": self.spread,
            "correlation": self.correlation,
            "samples": self.samples,
            "excitation": self.excitation,
            "squares": self.squares,
        }


def normal_equations_from_arrays(
    arrays: Mapping[str, NDArray[np.generic]],
) -> FlightNormalEquations:
    """Invert `FlightNormalEquations.to_arrays`. Raises InputError for another format."""
    version = int(np.asarray(arrays["version"], dtype=np.int64)) if "version" in arrays else 0
    if version != NORMAL_EQUATIONS_VERSION:
        raise InputError(
            f"normal equations of format {version}, not {NORMAL_EQUATIONS_VERSION}",
            str(arrays.get("flight", "")),
            "make it anew from its flight",
        )

    def numbers(name: str) -> Array:
        return np.asarray(arrays[name], dtype=np.float64)

    return FlightNormalEquations(
        flight=str(arrays["flight"]),
        axes=tuple(str(axis) for axis in arrays["axes"]),
        hypotheses=tuple(str(name) for name in arrays["hypotheses"]),
        matrix=numbers("matrix"),
        noisy=numbers("noisy") if arrays["noisy"].size else None,
        spread=numbers("spread"),
        correlation=numbers("correlation"),
        samples=np.asarray(arrays["samples"], dtype=np.int64),
        excitation=numbers("excitation"),
        squares=numbers("squares"),
    )


def normal_equations_of(evidence: Evidence, settings: TracingSettings) -> FlightNormalEquations:
    """Return the normal equations of one flight.

    Axes without a usable stretch, or whose residual is exactly constant, stay out. A column that
    has an instrument is replaced by what its instrument predicts of it (`first_stage`).

    Raises InputError when no axis is left.
    """
    return normal_equations_of_band(in_band(evidence, settings), settings)


def normal_equations_of_band(
    band: BandLimitedFlight, settings: TracingSettings
) -> FlightNormalEquations:
    """Return the normal equations of one flight that is already in the band.

    The filter of an axis is fitted once, to its residual with the mean removed, and used for all
    columns, the noisy copies and the instruments: filtering is linear, so that linear relations
    between columns remain true.

    Raises InputError when no axis is left. The matrix is (k, k): intercepts, hypotheses and the
    residual, whitened.
    """
    fitted: dict[str, tuple[Array, float]] = {}
    times, counts = [], []
    for axis, records in band.records.items():
        residual = centred([record[:, -1] for record in records])
        coefficients, spread = fit(residual, settings.order)
        if spread > 0.0:
            fitted[axis] = coefficients, spread
            times.append(correlation_time(residual, band.step))
            counts.append(sum(len(record) for record in records))
    if not fitted:
        raise InputError(
            "no axis has a usable stretch",
            band.flight,
            "see why its samples are flagged; fly longer manoeuvres",
        )
    kept = np.array([not name.startswith(NUISANCE) for name in band.names], dtype=np.bool_)
    whole = np.r_[np.ones(len(fitted), dtype=np.bool_), kept, True]
    noisy = [eliminated(_products(band, copy, fitted)[0], whole) for copy in band.noisy]
    matrix, squares = _products(band, band.records, fitted)
    return FlightNormalEquations(
        flight=band.flight,
        axes=tuple(fitted),
        hypotheses=tuple(name for name, keep in zip(band.names, kept, strict=True) if keep),
        matrix=eliminated(matrix, whole),
        noisy=np.mean(noisy, axis=0) if noisy else None,
        spread=np.array([spread for _, spread in fitted.values()]),
        correlation=np.array(times),
        samples=np.array(counts, dtype=np.int64),
        excitation=_excitation(band, fitted)[kept],
        squares=squares[:, whole[len(fitted) :]],
    )


def _products(
    band: BandLimitedFlight, source: Records, fitted: Mapping[str, tuple[Array, float]]
) -> tuple[Array, Array]:
    """Cross-products (k, k) of whitened columns, summed over the axes, and the squares of each
    column about its mean on each axis."""
    k = len(fitted) + len(band.names) + 1
    total, squares = np.zeros((k, k)), np.zeros((len(fitted), k - len(fitted)))
    for number, (axis, (coefficients, spread)) in enumerate(fitted.items()):
        acting = np.flatnonzero(np.any([record.any(axis=0) for record in source[axis]], axis=0))
        white = _white([record[:, acting] for record in source[axis]], coefficients, spread)
        if axis in band.instruments:
            inner = acting[1:-1] if acting[-1] == len(band.names) + 1 else acting[1:]
            indices = np.r_[0, inner]
            drivers = _white(
                [record[:, indices] for record in band.instruments[axis]], coefficients, spread
            )
            last = len(inner) + 1
            white[:, 1:last] = first_stage(white[:, 0], white[:, 1:last], drivers[:, 1:])
        index = np.where(acting == 0, number, acting + len(fitted) - 1)
        own = white.T @ white
        total[np.ix_(index, index)] += own
        squares[number, index[1:] - len(fitted)] = (
            np.diagonal(own)[1:] - own[0, 1:] ** 2 / own[0, 0]
        )
    return total, squares


def eliminated(products: Array, kept: Mask) -> Array:
    """Cross-products (k, k) with the columns that are not `kept` (k,) eliminated.

    Each is a parameter whose prior has a standard deviation of one: ``H - H_n (H_nn + 1)^-1 H_n'``.

    >>> eliminated(np.array([[4.0, 3.0], [3.0, 8.0]]), np.array([True, False])).tolist()
    [[3.0]]
    """
    if kept.all():
        return products
    across = products[np.ix_(~kept, kept)]
    own = products[np.ix_(~kept, ~kept)] + np.eye(len(across))
    return np.asarray(products[np.ix_(kept, kept)] - across.T @ np.linalg.solve(own, across))


def _excitation(band: BandLimitedFlight, fitted: Mapping[str, tuple[Array, float]]) -> Array:
    """Standard deviation of each column on the axis where it is largest against the noise
    (hypotheses,).
    """
    best, excitation = np.zeros(len(band.names)), np.zeros(len(band.names))
    for axis, (_, spread) in fitted.items():
        size = np.concatenate(band.records[axis]).std(axis=0)[1:-1]
        stronger = size / spread > best
        best = np.where(stronger, size / spread, best)
        excitation = np.where(stronger, size, excitation)
    return excitation


def _white(records: Sequence[Array], coefficients: Array, spread: float) -> Array:
    return np.concatenate([whiten(record, coefficients) for record in records]) / spread


def first_stage(constant: Array, columns: Array, instruments: Array) -> Array:
    """Replace each column (m, k) that has an instrument (not zero) by what the instrument predicts
    of it.

    The first stage of two-stage least squares (Theil, 1953): what a controller adds to a rate in
    answer to the residual is not in the instrument, and no longer counts as the rate's effect. The
    regression on the constant (m,) is subtracted from both and added back to the result.
    """
    fitted = columns.copy()
    weight = float(constant @ constant)
    for index in np.flatnonzero(instruments.any(axis=0)):
        intercept = (constant @ columns[:, index]) / weight
        x = columns[:, index] - constant * intercept
        z = instruments[:, index] - constant * ((constant @ instruments[:, index]) / weight)
        power = float(z @ z)
        fitted[:, index] = constant * intercept + (z * ((z @ x) / power) if power > 0.0 else 0.0)
    return fitted
