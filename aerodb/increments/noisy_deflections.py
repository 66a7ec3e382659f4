"""What noise of logged deflections does to increments and parameters, and its correction.

The normal equations of a fit, with the noise of its deflections once more
(`aerodb.estimation.input_noise`).
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.estimation import Regression, told_without_noise, with_noise_once_more
from aerodb.increments.model_file import Regressor
from aerodb.increments.samples import AxisSamples, as_compared, columns_of
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.tables import WIND_AXES, body_to_wind

#: Normal equations of comparisons: ``X'X`` (k, k) and ``X'r`` (k,).
NormalEquations = Callable[[Sequence[Comparison]], tuple[Array, Array]]


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
    noisy = [with_noise(comparison) for comparison in comparisons]
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
    inverse = root @ np.linalg.inv(told_without_noise(root, product_noisier - product)) @ root.T
    return inverse @ product, inverse @ (score - score_noisier)


def with_noise(comparison: Comparison) -> tuple[Comparison, Comparison] | None:
    """Return the comparison with the noise of its deflections once more, with both signs; None
    where they have none."""
    side = comparison.database_side
    if side is None:
        return None
    noisier = with_noise_once_more(side.channels, comparison.flight)
    if noisier is None:
        return None
    plus, minus = (
        replace(comparison, database_side=replace(side, channels=channels)) for channels in noisier
    )
    return plus, minus
