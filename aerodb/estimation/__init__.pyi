from .affine import AffineMatrix, affine_matrix
from .delays import MOST_DELAY, DelayedStateSpace, delayed, with_delays
from .dynamic_model import DynamicModel, Values
from .filter_error import filter_error
from .fit import Fit, ParameterEstimate, Standing
from .frequency_domain import frequency_domain_regression
from .frequency_response import FrequencyResponse, frequency_responses
from .independence import InputCorrelation, dependent, input_correlations
from .kalman import extended_kalman, unscented_kalman
from .linear_equation import EquationRecord, LinearEquation
from .multiple_shooting import multiple_shooting
from .ordinary_least_squares import (
    Regression,
    coloured_sum,
    least_squares,
    own_constants,
    samples_per_independent,
    with_mean_constant,
)
from .output_error import output_error
from .parameters import Parameter, Parameters, bounds_of, priors_of
from .process_noise import Recommendation, output_or_filter_error
from .recursive import (
    FourierRegression,
    RecursiveLeastSquares,
    normalised_recursive_least_squares,
    recursive_least_squares,
)
from .regression_fit import regression
from .splines import SplineKind, chosen_knots, piecewise_polynomials
from .start_values import FROM_SUBSPACE, has_start_values, with_start_values
from .state_space import StateSpace, stabilised, state_space
from .statistics import Theil, rms, theil
from .time_history import TimeHistory
from .transfer_function import TransferFunction, transfer_function_fit

__all__ = [
    "FROM_SUBSPACE",
    "MOST_DELAY",
    "AffineMatrix",
    "DelayedStateSpace",
    "DynamicModel",
    "EquationRecord",
    "Fit",
    "FourierRegression",
    "FrequencyResponse",
    "InputCorrelation",
    "LinearEquation",
    "Parameter",
    "ParameterEstimate",
    "Parameters",
    "Recommendation",
    "RecursiveLeastSquares",
    "Regression",
    "SplineKind",
    "Standing",
    "StateSpace",
    "Theil",
    "TimeHistory",
    "TransferFunction",
    "Values",
    "affine_matrix",
    "bounds_of",
    "chosen_knots",
    "coloured_sum",
    "delayed",
    "dependent",
    "extended_kalman",
    "filter_error",
    "frequency_domain_regression",
    "frequency_responses",
    "has_start_values",
    "input_correlations",
    "least_squares",
    "multiple_shooting",
    "normalised_recursive_least_squares",
    "output_error",
    "output_or_filter_error",
    "own_constants",
    "piecewise_polynomials",
    "priors_of",
    "recursive_least_squares",
    "regression",
    "rms",
    "samples_per_independent",
    "stabilised",
    "state_space",
    "theil",
    "transfer_function_fit",
    "unscented_kalman",
    "with_delays",
    "with_mean_constant",
    "with_start_values",
]
