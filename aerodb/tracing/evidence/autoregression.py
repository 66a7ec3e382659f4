"""Whiten residual and columns by an autoregression, one filter per axis and flight."""

from collections.abc import Sequence

import numpy as np

from aerodb.support import Array


def fit(records: Sequence[Array], most: int) -> tuple[Array, float]:
    """Fit the autoregression ``v[k] = a1 v[k-1] + ... + ap v[k-p] + e[k]``, p <= `most` by BIC.

    Conditional least squares; all orders are compared on the samples that the longest uses. ``BIC =
    n log(SSE/n) + p log n`` (Schwarz, Ann. Stat. 6(2), 1978). Unstable models are not taken.

    Parameters
    ----------
    records : arrays (n_i,) with their mean removed; no lag reaches from one to another
    most : largest order

    Returns
    -------
    tuple[Array, float] : coefficients a (p,), and the standard deviation of e; 0 if all values are
        zero
    """
    most = max(0, min(most, max(len(record) for record in records) // 4))
    target = np.concatenate([record[most:] for record in records])
    lags = [
        np.concatenate(
            [record[most - k : len(record) - k] for record in records if len(record) > most]
        )
        for k in range(1, most + 1)
    ]
    n = len(target)
    best: tuple[float, Array, float] | None = None
    for order in range(most + 1):
        if n < 3 * (order + 1):
            break
        design = np.column_stack(lags[:order]) if order else np.zeros((n, 0))
        coefficients = np.linalg.lstsq(design, target, rcond=None)[0] if order else np.zeros(0)
        if order and np.abs(np.roots(np.r_[1.0, -coefficients])).max() >= 1.0:
            continue
        sse = float(np.sum((target - design @ coefficients) ** 2))
        if sse <= 0.0:
            return coefficients, 0.0
        bic = n * np.log(sse / n) + order * np.log(n)
        if best is None or bic < best[0]:
            best = (bic, coefficients, float(np.sqrt(sse / max(1, n - order))))
    return (best[1], best[2]) if best else (np.zeros(0), float(np.std(target)) if n else 0.0)


def whiten(columns: Array, coefficients: Array) -> Array:
    """Return ``e[k] = v[k] - a1 v[k-1] - ...`` for columns (n, k) of one record.

    The first p rows have no past and are left out.
    """
    order = len(coefficients)
    filtered = columns[order:].copy()
    for lag, coefficient in enumerate(coefficients, start=1):
        filtered -= coefficient * columns[order - lag : len(columns) - lag]
    return filtered


def correlation_time(records: Sequence[Array], step: float) -> float:
    """Integral time scale [s] of records with their mean removed.

    ``step (1/2 + sum rho_k)`` up to the first rho_k <= 0.

    Records are (n,), sampled at `step` [s].
    """
    total = sum(float(record @ record) for record in records)
    if total <= 0.0:
        return 0.0
    scale = 0.5
    for lag in range(1, max(len(record) for record in records)):
        rho = (
            sum(float(record[lag:] @ record[:-lag]) for record in records if len(record) > lag)
            / total
        )
        if rho <= 0.0:
            break
        scale += rho
    return step * scale
