from .estimate import AxisUpdate, Doubt, Update, estimate_increments, keep_slope_signs
from .gate import Check, Standing, Verdict, judge, sign_reasons
from .model_file import INCREMENT_AXES, ModelFile, parse_model_file
from .validation import (
    UNCHANGED,
    AxisProof,
    HoldOut,
    choose_hold_out,
    prove,
    prove_by_leaving_one_out,
    worse_axes,
)

__all__ = [
    "INCREMENT_AXES",
    "UNCHANGED",
    "AxisProof",
    "AxisUpdate",
    "Check",
    "Doubt",
    "HoldOut",
    "ModelFile",
    "Standing",
    "Update",
    "Verdict",
    "choose_hold_out",
    "estimate_increments",
    "judge",
    "keep_slope_signs",
    "parse_model_file",
    "prove",
    "prove_by_leaving_one_out",
    "sign_reasons",
    "worse_axes",
]
