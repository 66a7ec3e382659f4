from .regression import (
    Regression,
    coloured_sum,
    least_squares,
    own_constants,
    samples_per_independent,
    with_mean_constant,
)
from .statistics import Theil, rms, theil

__all__ = [
    "Regression",
    "Theil",
    "coloured_sum",
    "least_squares",
    "own_constants",
    "rms",
    "samples_per_independent",
    "theil",
    "with_mean_constant",
]
