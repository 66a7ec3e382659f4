"""Estimates inside their bounds."""

import numpy as np

from aerodb.support import Array, Mask


def within_bounds(
    estimates: Array, information: Array, low: Array, high: Array
) -> tuple[Array, Mask]:
    """Return the values (f,) within the bounds (f,) nearest to `estimates` (f,) as `information`
    (f, f) weighs their changes (a symmetric matrix), and which of them are at a bound.

    References
    ----------
    Quadratic programme: Lawson & Hanson, Solving Least Squares Problems, 1974 (scipy's
    `lsq_linear`).
    """
    if np.all((estimates >= low) & (estimates <= high)):
        return estimates, np.zeros(len(low), dtype=bool)
    from scipy.optimize import lsq_linear  # slow to import

    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    found = lsq_linear(
        root,
        root @ (estimates * scale),
        bounds=(low * scale, high * scale),
        method="bvls",
        tol=1e-12,
    )
    values = np.clip(found.x / scale, low, high)
    near = [np.isclose(values, end, rtol=1e-9, atol=0.0) for end in (low, high)]
    return values, np.asarray(near[0] | near[1])
