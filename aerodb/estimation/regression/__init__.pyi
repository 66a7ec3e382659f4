from .equation_error import ENOUGH_PER_ESTIMATE
from .frequency_domain import frequency_domain_regression
from .instrumental_variables import instrumental_variables
from .linear_equation import EquationRecord, LinearEquation
from .principal_components import principal_components
from .recursive import (
    FourierRegression,
    RecursiveLeastSquares,
    normalised_recursive_least_squares,
    recursive_least_squares,
)
from .regression_fit import regression
from .stepwise import orthogonal_functions, stepwise
from .total_least_squares import total_least_squares

__all__ = [
    "ENOUGH_PER_ESTIMATE",
    "EquationRecord",
    "FourierRegression",
    "LinearEquation",
    "RecursiveLeastSquares",
    "frequency_domain_regression",
    "instrumental_variables",
    "normalised_recursive_least_squares",
    "orthogonal_functions",
    "principal_components",
    "recursive_least_squares",
    "regression",
    "stepwise",
    "total_least_squares",
]
