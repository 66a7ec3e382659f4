"""Declared updates: estimate increments from flights, validate them, and judge their release.

The way through:

1. `parse_model_file` reads which increments are declared, axis by axis (`ModelFile`).
2. `choose_hold_out` splits the flights into identification and validation (`HoldOut`).
3. `estimate_increments` fits the declared terms to the residuals of the identifying flights and
   gives an `Update`: the candidate database, and per axis an `AxisUpdate`. `ConsiderParameter`
   carries sensor errors that widen its standard errors.
4. `keep_slope_signs` lengthens fades that would change the sign of a slope outside the data.
5. `validate_on_held_out`, or `validate_by_leaving_one_out` with few flights, gives the error per
   axis before and after (`AxisValidation`); `worse_axes` names axes that became worse.
6. `beyond_envelopes` gives both errors, held and extrapolated, of flights that leave the envelope
   of what predicts them (`Beyond`, `with_extrapolated_slopes`).
7. `derivative_changes` gives what the update changes of the derivatives inside the data
   (`DerivativeChange`).
8. `held_or_free` says whether the terms of the database should be freed beside the declared ones.
9. `judge_release`, `judge_derivatives`, `judge_rivals`, `judge_shapes` and
   `judge_contradictions` decide whether a version may be released (`GateVerdict`).

`model_file` holds the file format, `chosen_knots` the knots of splines that it leaves open,
`estimate` the regression and `parameters` that of parameters of the database, `considered`,
`unmeasured_air` and `constraints` what widens and holds estimates, `validation` hold-out and
errors, `beyond` flights outside the envelope, `derivatives` what changes inside it, `gate` the
release checks, `acceptable` those that a person may overrule.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .acceptable import (
        CONTRADICTIONS,
        SENSORS,
        judge_aliases,
        judge_contradictions,
        judge_rivals,
        judge_shapes,
        open_shapes,
    )
    from .beyond import Beyond, Excursion, beyond_envelopes, with_extrapolated_slopes
    from .chosen_knots import with_chosen_knots
    from .considered import ConsiderParameter
    from .constraints import alias_groups, correlation_of
    from .derivatives import (
        DerivativeChange,
        derivative_changes,
        derivatives_document,
        judge_derivatives,
    )
    from .estimate import AxisUpdate, Update, estimate_increments, keep_slope_signs
    from .gate import (
        AT_LEAST,
        CONTENT,
        FILE_CHECKS,
        GateCheck,
        GateVerdict,
        Measure,
        Standing,
        judge_import,
        judge_release,
        notes_on_release,
        sign_reasons,
    )
    from .held_or_free import HeldOrFree, held_or_free, with_all_terms_free
    from .held_out import NEAR_FLOOR, UNCHANGED, held_out_error
    from .model_file import CONSTANT, DeclaredIncrement, ModelFile, expand, parse_model_file
    from .parameters import (
        ParameterSamples,
        between_bounds,
        check_parameters_of,
        moved_by_noise_alone,
        parameter_samples,
        start_of_search,
        tells_nothing,
    )
    from .samples import AxisSamples, axis_samples, channels_of, with_model_rates
    from .unmeasured_air import air_covariance
    from .validation import (
        AxisValidation,
        Floors,
        HoldOut,
        NoiseFloor,
        axis_outcome,
        choose_hold_out,
        repeatability,
        validate_by_leaving_one_out,
        validate_on_held_out,
        worse_axes,
    )

__getattr__, __dir__, __all__ = attach(__name__, __file__)
