from .dynamic_model import DynamicModel, Values
from .fit import Fit, ParameterEstimate, Standing
from .linear_equation import EquationRecord, LinearEquation
from .parameters import Parameter, Parameters, bounds_of, priors_of
from .regression import (
    Regression,
    coloured_sum,
    least_squares,
    own_constants,
    samples_per_independent,
    with_mean_constant,
)
from .statistics import Theil, rms, theil
from .time_history import TimeHistory

__all__ = [
    "DynamicModel",
    "EquationRecord",
    "Fit",
    "LinearEquation",
    "Parameter",
    "ParameterEstimate",
    "Parameters",
    "Regression",
    "Standing",
    "Theil",
    "TimeHistory",
    "Values",
    "bounds_of",
    "coloured_sum",
    "least_squares",
    "own_constants",
    "priors_of",
    "rms",
    "samples_per_independent",
    "theil",
    "with_mean_constant",
]
