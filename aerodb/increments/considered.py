"""Constant sensor errors that are considered in a covariance, not estimated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.increments.samples import as_compared
from aerodb.support import Array, Mask


@dataclass(frozen=True)
class ConsiderParameter:
    """A constant sensor error that one flight's residual cannot reveal: considered in the
    covariance, not estimated.

    Parameters
    ----------
    name : of the error, such as ``alpha_bias``.
    sigma : one standard error, in the unit of the error.
    shared : true where it is the same error, by `name`, in all flights.
    columns : axis -> (n,), change of the residual per unit of the error.
    """

    name: str
    sigma: float
    shared: bool
    columns: Mapping[str, Array]


def consider_covariance(
    matrix: Array,
    parts: Sequence[tuple[str, Comparison, Mask]],
    consider: Mapping[str, Sequence[ConsiderParameter]],
    sizes: Mapping[str, float] = MappingProxyType({}),
) -> Array:
    """Covariance (k, k) of least-squares estimates due to constant sensor errors.

    matrix : X (n, k), samples of `parts` in order: axis, comparison, and which samples (n,). sizes
    : axis -> what its samples were divided by. An error of one sigma that adds d to the residual
    moves the estimates by ``(X'X)^-1 X' d``: consider covariance (Bierman, *Factorization Methods*,
    1977, chapter VIII). Changes by the same error are added before they are squared: over the axes
    of a flight, and over flights where these share it; other errors are independent.
    """
    gain, start = np.linalg.pinv(matrix), 0
    apart: dict[tuple[str, str], Array] = {}
    together: dict[str, Array] = {}
    for axis, comparison, good in parts:
        part, start = slice(start, start + int(good.sum())), start + int(good.sum())
        for parameter in consider.get(comparison.flight, ()):
            if axis not in parameter.columns:
                continue
            column = parameter.sigma / sizes.get(axis, 1.0) * parameter.columns[axis]
            column = as_compared(axis, column, comparison)
            moved = gain[:, part] @ column[good]
            if parameter.shared:
                together[parameter.name] = together.get(parameter.name, 0.0) + moved
            else:
                own = (comparison.flight, parameter.name)
                apart[own] = apart.get(own, 0.0) + moved
    total = np.zeros((matrix.shape[1], matrix.shape[1]))
    for moved in apart.values():
        total += np.outer(moved, moved)
    return total + sum(
        (np.outer(moved, moved) for moved in together.values()), np.zeros_like(total)
    )
