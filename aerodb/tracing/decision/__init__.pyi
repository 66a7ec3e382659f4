from .few_flights import LINEAR, Suspicion, linear_companions, suspect, windows
from .findings import ADDED, Finding, Traced
from .joint_model import joint_bands, joint_fit
from .refinement import Refined, beside_wrong_shapes, refined
from .unexplained_residual import Left, Remainder, remainders
from .verdicts import trace

__all__ = [
    "ADDED",
    "LINEAR",
    "Finding",
    "Left",
    "Refined",
    "Remainder",
    "Suspicion",
    "Traced",
    "beside_wrong_shapes",
    "joint_bands",
    "joint_fit",
    "linear_companions",
    "refined",
    "remainders",
    "suspect",
    "trace",
    "windows",
]
