from . import lift_hysteresis
from .stall_hysteresis import stall_hypotheses, stall_regressors
from .stall_shape import STALL_GAIN_BOUNDS, StallFlight, cross_fit_shapes, fit_shape

__all__ = [
    "STALL_GAIN_BOUNDS",
    "StallFlight",
    "cross_fit_shapes",
    "fit_shape",
    "lift_hysteresis",
    "stall_hypotheses",
    "stall_regressors",
]
