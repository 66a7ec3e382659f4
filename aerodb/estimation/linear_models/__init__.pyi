from .affine import AffineMatrix, affine_matrix
from .delays import MOST_DELAY, DelayedStateSpace, delayed, with_delays
from .start_values import (
    FROM_SUBSPACE,
    LinearModel,
    has_start_values,
    with_regressed_start_values,
    with_start_values,
)
from .state_space import StateSpace, stabilised, state_space

__all__ = [
    "FROM_SUBSPACE",
    "MOST_DELAY",
    "AffineMatrix",
    "DelayedStateSpace",
    "LinearModel",
    "StateSpace",
    "affine_matrix",
    "delayed",
    "has_start_values",
    "stabilised",
    "state_space",
    "with_delays",
    "with_regressed_start_values",
    "with_start_values",
]
