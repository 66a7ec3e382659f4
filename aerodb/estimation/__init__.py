"""Estimation methods of system identification, independent of aircraft and databases.

A `DynamicModel` with named `Parameters` is fitted to `TimeHistory` records. Every method answers
with a `Fit`: a `ParameterEstimate` per parameter with its `Standing`, the residuals, and what the
method assumes.

Least squares (`ordinary_least_squares`):

1. `least_squares` fits stacked records and gives a `Regression`, whose covariance stays valid when
   residuals are correlated in time; `coloured_sum` and `shared_coloured_sum` are behind it,
   and `samples_per_independent` what a coloured residual counts.
2. `own_constants` replaces one constant by one per record before the fit, and `with_mean_constant`
   turns the fit back into one constant, their mean.

The methods, by what they fit:

1. `regression`: linear equations of measured quantities (equation error), in time, over a band of
   frequencies, or sample by sample. `splines` are regressors: a function by its values at knots,
   given or `chosen_knots`.
2. `spectra`: frequency responses, and transfer functions.
3. `linear_models`: `state_space` models of named entries, with delays, and their start values.
4. `output_error`: models that are simulated; `multiple_shooting` for unstable ones.
5. `filters`: models that a Kalman filter follows through turbulence: `filter_error`,
   `extended_kalman` and `unscented_kalman`.

Shared by them: `parameters`, `time_history` and `dynamic_model` (what is fitted), `fit` and
`standing` (the answer), `coloured_noise` and `whiteness` (residuals), `input_noise` (of
deflections), `bounded`, `independence`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .bounded import within_bounds
    from .dynamic_model import DynamicModel, Values
    from .filters import (
        Recommendation,
        extended_kalman,
        filter_error,
        output_or_filter_error,
        unscented_kalman,
    )
    from .fit import AxisError, Fit, ParameterEstimate, Standing
    from .independence import InputCorrelation, dependent, input_correlations
    from .input_noise import deflection_noise, noise_alone, told_without_noise, with_noise_once_more
    from .linear_models import (
        FROM_SUBSPACE,
        MOST_DELAY,
        AffineMatrix,
        DelayedStateSpace,
        StateSpace,
        affine_matrix,
        delayed,
        has_start_values,
        stabilised,
        state_space,
        with_delays,
        with_start_values,
    )
    from .ordinary_least_squares import (
        Regression,
        coloured_sum,
        least_squares,
        own_constants,
        samples_per_independent,
        shared_coloured_sum,
        with_mean_constant,
    )
    from .output_error import (
        frequency_domain_output_error,
        multiple_shooting,
        nonlinear_refinement,
        output_error,
    )
    from .parameters import Parameter, Parameters, bounds_of, priors_of
    from .regression import (
        EquationRecord,
        FourierRegression,
        LinearEquation,
        RecursiveLeastSquares,
        fourier_regression,
        frequency_domain_regression,
        instrumental_variables,
        normalised_recursive_least_squares,
        recursive_least_squares,
        regression,
        running_frequencies,
    )
    from .spectra import (
        FrequencyResponse,
        GustSpectrum,
        Interval,
        TransferFunction,
        frequency_responses,
        gust_spectrum,
        transfer_function_fit,
    )
    from .splines import SplineKind, chosen_knots, piecewise_polynomials
    from .time_history import TimeHistory
    from .whiteness import FALSE_ALARMS, coloured_innovations

__getattr__, __dir__, __all__ = attach(__name__, __file__)
