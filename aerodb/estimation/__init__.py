"""Estimation methods of system identification, independent of aircraft and databases.

A `DynamicModel` with named `Parameters` is fitted to `TimeHistory` records. Every method answers
with a `Fit`: a `ParameterEstimate` per parameter with its `Standing`, the residuals, and what the
method assumes.

Least squares:

1. `least_squares` fits stacked records and gives a `Regression`, whose covariance stays valid when
   residuals are correlated in time; `coloured_sum` is the sum behind it,
   and `samples_per_independent` what a coloured residual counts.
2. `own_constants` replaces one constant by one per record before the fit, and `with_mean_constant`
   turns the fit back into one constant, their mean.
3. `rms` and `theil` (`Theil`) measure how well a prediction follows a measurement.

Equation error, a `LinearEquation` of several `EquationRecord`:

1. `regression` is least squares with fixed and tied parameters, priors and bounds. Its standard
   errors rest on a model of the coloured residuals (`coloured_noise`), so that intervals hold the
   truth as often as they say.
2. `principal_components` estimates the combinations that the records determine, and says which
   they do not; `total_least_squares` and `instrumental_variables` are for noisy regressors.
3. `splines` are regressors: a function by its values at knots, given or `chosen_knots`.
4. `stepwise` displays which terms are worth declaring, and how often it finds one that is not
   there.
5. `equation_error` holds what all of these methods share.

Equation error over a band of frequencies, and sample by sample:

1. `frequency_domain_regression` is least squares between finite Fourier transforms: what lies
   beside the band does not matter.
2. `RecursiveLeastSquares` (with forgetting, normalised or not) and `FourierRegression` take one
   sample after the other, with constant memory. `recursive_least_squares` and
   `normalised_recursive_least_squares` run them through records.

Frequency responses:

1. `frequency_responses` gives a `FrequencyResponse` per input, with coherence, conditioned on the
   other inputs.
2. `transfer_function_fit` fits a `TransferFunction` of low order with a delay to one.

Models that are integrated:

1. `state_space` makes a linear `StateSpace` model of named entries (`affine`), each a sum of
   parameters, simulated exactly (`recursion` is its compiled loop); `stabilised` feeds measured
   outputs back into an unstable one, `with_delays` lets inputs act and outputs be measured late.
2. `output_error` finds the parameters whose outputs are most likely (`likelihood`,
   `gauss_newton`), with `sensitivities` of the model itself or by runs side by side; `standing`
   says what each estimate is worth.
3. An unstable motion (`instability`) needs `stabilised` or `multiple_shooting`.
4. `filter_error`, `extended_kalman` and `unscented_kalman` are for turbulence. A model that is not
   linear is linearised along the motion that the filter sees (`linearisation`, `one_step`); the
   filter (`filtering`, `filter_kernels`) then gives the likelihood (`filter_problem`) that
   `scoring` climbs.

Start values: `subspace` identifies a linear model of records without any, and says how its order
came about; `start_values` turns it into those of a declared `StateSpace`, which `output_error` does
where all of them are zero.

`ordinary_least_squares` holds the fit, `statistics` the error measures, `finite_fourier` the
transforms, `linear_solution` what estimates are worth.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
