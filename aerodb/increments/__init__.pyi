from .beyond import Beyond, Excursion, beyond_envelopes, with_extrapolated_slopes
from .chosen_knots import with_chosen_knots
from .derivatives import (
    DerivativeChange,
    derivative_changes,
    derivatives_document,
    judge_derivatives,
)
from .estimate import AxisUpdate, ConsiderParameter, Update, estimate_increments, keep_slope_signs
from .gate import (
    FILE_CHECKS,
    Check,
    Standing,
    Verdict,
    judge_import,
    judge_release,
    judge_rivals,
    sign_reasons,
)
from .model_file import (
    CONSTANT,
    INCREMENT_AXES,
    DeclaredIncrement,
    ModelFile,
    expand,
    parse_model_file,
)
from .samples import AxisSamples, axis_samples, channels_of, with_model_rates
from .validation import (
    UNCHANGED,
    AxisValidation,
    HoldOut,
    choose_hold_out,
    validate_by_leaving_one_out,
    validate_on_held_out,
    worse_axes,
)

__all__ = [
    "CONSTANT",
    "FILE_CHECKS",
    "INCREMENT_AXES",
    "UNCHANGED",
    "AxisSamples",
    "AxisUpdate",
    "AxisValidation",
    "Beyond",
    "Check",
    "ConsiderParameter",
    "DeclaredIncrement",
    "DerivativeChange",
    "Excursion",
    "HoldOut",
    "ModelFile",
    "Standing",
    "Update",
    "Verdict",
    "axis_samples",
    "beyond_envelopes",
    "channels_of",
    "choose_hold_out",
    "derivative_changes",
    "derivatives_document",
    "estimate_increments",
    "expand",
    "judge_derivatives",
    "judge_import",
    "judge_release",
    "judge_rivals",
    "keep_slope_signs",
    "parse_model_file",
    "sign_reasons",
    "validate_by_leaving_one_out",
    "validate_on_held_out",
    "with_chosen_knots",
    "with_extrapolated_slopes",
    "with_model_rates",
    "worse_axes",
]
