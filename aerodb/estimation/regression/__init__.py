"""Equation error: least squares for a `LinearEquation` of several `EquationRecord`.

1. `regression` (`regression_fit`) takes fixed and tied parameters, priors and bounds. Its standard
   errors rest on a model of the coloured residuals (`coloured_noise`), so that intervals hold the
   truth as often as they say.
2. `principal_components` estimates the combinations that the records determine, and says which
   they do not; `total_least_squares` and `instrumental_variables` are for noisy regressors.
3. `stepwise` displays which terms are worth declaring, and how often it finds one that is not
   there; `orthogonal_functions` ranks products of the regressors.
4. `frequency_domain_regression` is least squares between finite Fourier transforms
   (`finite_fourier`): what lies outside the band does not matter.
5. `RecursiveLeastSquares` (with forgetting, normalised or not) and `FourierRegression` take one
   sample after the other, with constant memory. `recursive_least_squares`,
   `normalised_recursive_least_squares` and `fourier_regression` run them through records.

`equation_error` holds what the methods in time share; `linear_solution` what those over a band and
sample by sample do. Method and references: docs/method/equation-error.md.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .equation_error import ENOUGH_PER_ESTIMATE
    from .finite_fourier import band_limits
    from .frequency_domain import frequency_domain_regression, smoothed_spectrum
    from .instrumental_variables import instrumental_variables
    from .linear_equation import EquationRecord, LinearEquation
    from .principal_components import principal_components
    from .recursive import (
        FourierRegression,
        RecursiveLeastSquares,
        fourier_regression,
        normalised_recursive_least_squares,
        recursive_least_squares,
        running_frequencies,
    )
    from .regression_fit import regression
    from .stepwise import orthogonal_functions, stepwise
    from .total_least_squares import total_least_squares

__getattr__, __dir__, __all__ = attach(__name__, __file__)
