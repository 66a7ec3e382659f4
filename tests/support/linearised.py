"""Jacobians of the glider simulator's equations of motion."""

from collections.abc import Callable

import numpy as np

from aerodb.support import Array


def jacobian(rate: Callable[[Array], Array], state: Array, step: float = 1e-4) -> Array:
    """Jacobian (m, m) at a state (m,) of a function of states (m, k) in columns, by central
    differences."""
    m = state.shape[0]
    perturbed = state[:, None] + step * np.concatenate([np.eye(m), -np.eye(m)], axis=1)
    rates = rate(perturbed)
    return np.asarray((rates[:, :m] - rates[:, m:]) / (2 * step))
