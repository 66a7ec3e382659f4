"""What noise of logged deflections does to increments and parameters, and its correction.

Noise of a deflection draws its effectiveness towards zero, and changes what moves with it (Fuller,
*Measurement Error Models*, 1987, section 2.2). The size of white noise shows in differences of the
log. The same noise added once more changes the normal equations once more by as much (Cook &
Stefanski, JASA 89, 1994): what it changes is taken off. Noise of both signs leaves nothing of first
order, and signs drawn for each sample leave no products of two deflections.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from math import comb
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.estimation import Regression
from aerodb.increments.model_file import Regressor
from aerodb.increments.samples import AxisSamples, as_compared, columns_of
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.tables import WIND_AXES, body_to_wind

#: Highest order of the differences in which noise is looked for.
_ORDERS: Final = 6
#: Noise, as a part of a deflection's range, below which it is left: 1e-5 of an effect.
_LEAST: Final = 1e-3
#: Least part of what the deflections tell that must be no noise, as for regressors of
#: `aerodb.estimation.total_least_squares`.
_RELIABLE: Final = 0.3

#: Normal equations of comparisons: ``X'X`` (k, k) and ``X'r`` (k,).
NormalEquations = Callable[[Sequence[Comparison]], tuple[Array, Array]]


def deflection_noise(channels: Mapping[str, Array]) -> dict[str, float]:
    """Return one sigma of the white noise of each deflection among the channels (n,), in its unit;
    those without noise are absent.

    The least that differences of order one to six show, by their median: a deflection that moves
    slowly for its rate leaves little in the higher orders, and steps leave little in the median
    (variate differences: Tintner, 1940).
    """
    found = {}
    for name, values in channels.items():
        if is_surface(name) and len(values) > 2 * _ORDERS and np.isfinite(values).all():
            sizes = [
                float(np.median(np.abs(np.diff(values, order)))) / comb(2 * order, order) ** 0.5
                for order in range(1, _ORDERS + 1)
            ]
            if (sigma := 1.4826 * min(sizes)) > _LEAST * np.ptp(values):
                found[name] = sigma
    return found


def without_deflection_noise(
    fit: Regression, comparisons: Sequence[Comparison], equations: NormalEquations
) -> tuple[Regression, list[str]]:
    """Return a fit without the draw of noisy deflections, and what speaks against it, in sentences.

    comparisons : at the full rate. equations : of comparisons, about the estimates of the fit.
    Where noise is most of what moves the deflections, the fit stays and this is said.
    """
    try:
        correction = _correction(comparisons, equations)
    except ValueError as error:
        return fit, [f"Effects of controls may be too small: {error}"]
    if correction is None:
        return fit, []
    grown, change = correction
    return replace(
        fit, estimates=fit.estimates + change, covariance=grown @ fit.covariance @ grown.T
    ), []


def with_deflections(samples: AxisSamples, names: Collection[str]) -> Comparison:
    """Return the comparison of samples beside these deflections as well: their noise counts too."""
    side = samples.comparison.database_side
    if side is None:
        return samples.comparison
    own = {name: samples.channels[name] for name in names}
    return replace(
        samples.comparison, database_side=replace(side, channels={**side.channels, **own})
    )


def with_noise_of(
    axis: str, regressors: Sequence[Regressor], samples: AxisSamples, noisier: Comparison
) -> tuple[Array, Array]:
    """Return the regressors (m, k) of used samples with the noise of a comparison, and what it
    changes of what the database predicts there (m,).

    noisier : one of those that `without_deflection_noise` asks for.
    """
    side = noisier.database_side
    if side is None:
        return samples.columns[samples.good], np.zeros(samples.count)
    moved = {name: values for name, values in side.channels.items() if is_surface(name)}
    channels = {**samples.channels, **moved}
    now, before = side.database.predict(side.channels), side.prediction
    change = {name: each - before.coefficients[name] for name, each in now.coefficients.items()}
    if axis in WIND_AXES:
        alpha, beta = channels["alpha"], channels.get("beta", np.zeros(len(noisier.time)))
        wind = body_to_wind(change["CX"], change["CY"], change["CZ"], alpha, beta)
        change = dict(zip(WIND_AXES, wind, strict=True))
    return (
        columns_of(axis, regressors, channels, noisier)[samples.good],
        as_compared(axis, change.get(axis, np.zeros(len(noisier.time))), noisier)[samples.good],
    )


def _correction(
    comparisons: Sequence[Comparison], equations: NormalEquations
) -> tuple[Array, Array] | None:
    """The matrix (k, k) by which errors grow, and the change (k,) of the estimates, in their units;
    None without noise. Raises ValueError where noise is most of what moves the deflections."""
    noisy = [_with_noise(comparison) for comparison in comparisons]
    if all(each is None for each in noisy):
        return None
    sides = [
        equations(
            [
                plain if both is None else both[side]
                for plain, both in zip(comparisons, noisy, strict=True)
            ]
        )
        for side in (0, 1)
    ]
    product, score = equations(comparisons)
    product_noisier, score_noisier = (0.5 * (sides[0][k] + sides[1][k]) for k in (0, 1))
    root = np.linalg.cholesky(np.linalg.inv(product))
    left = np.eye(len(product)) - root.T @ (product_noisier - product) @ root
    if np.linalg.eigvalsh(left)[0] < _RELIABLE:
        raise ValueError("noise of the deflections is most of what moves them")
    inverse = root @ np.linalg.inv(left) @ root.T
    return inverse @ product, inverse @ (score - score_noisier)


def _with_noise(comparison: Comparison) -> tuple[Comparison, Comparison] | None:
    """The comparison with the noise of its deflections once more, with both signs."""
    side = comparison.database_side
    if side is None or not (noise := deflection_noise(side.channels)):
        return None
    generator = np.random.default_rng(
        int.from_bytes(comparison.flight.encode()[:8].ljust(8, b"0"), "big")
    )
    added = {
        name: sigma * generator.choice((-1.0, 1.0), len(comparison.time))
        for name, sigma in noise.items()
    }

    def changed(sign: float) -> Comparison:
        moved = {name: side.channels[name] + sign * error for name, error in added.items()}
        return replace(comparison, database_side=replace(side, channels={**side.channels, **moved}))

    return changed(1.0), changed(-1.0)
