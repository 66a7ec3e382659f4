from . import stall_hysteresis, stall_loop
from .stall_hysteresis import hypotheses, regressors
from .stall_shape import GAINS, StallFlight, cross_fitted, profiled

__all__ = [
    "GAINS",
    "StallFlight",
    "cross_fitted",
    "hypotheses",
    "profiled",
    "regressors",
    "stall_hysteresis",
    "stall_loop",
]
