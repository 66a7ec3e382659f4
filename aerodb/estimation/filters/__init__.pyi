from .filter_error import filter_error
from .kalman import extended_kalman, unscented_kalman
from .process_noise import Recommendation, output_or_filter_error

__all__ = [
    "Recommendation",
    "extended_kalman",
    "filter_error",
    "output_or_filter_error",
    "unscented_kalman",
]
