from .adding import add_effects, envelopes_of
from .aerodynamic import from_zero_lift, zero_lift_alpha
from .flight_view import FlightView, view_of
from .hypothesis import Columns, Hypothesis
from .library import hypotheses_for, library_sha256
from .measurement import (
    columns_of,
    doubts,
    doubts_of_alpha,
    of_flow_angles,
    with_flattening,
    within_what_is_known,
)
from .spline import ramp_terms, spline_over, variables_of
from .stall import GAINS, StallFlight, cross_fitted, hypotheses, profiled, regressors, stall_loop
from .surfaces import surfaces_of
from .template import FELT_ON, Scene
from .user_effects import parse_effects, registered_templates

__all__ = [
    "FELT_ON",
    "GAINS",
    "Columns",
    "FlightView",
    "Hypothesis",
    "Scene",
    "StallFlight",
    "add_effects",
    "columns_of",
    "cross_fitted",
    "doubts",
    "doubts_of_alpha",
    "envelopes_of",
    "from_zero_lift",
    "hypotheses",
    "hypotheses_for",
    "library_sha256",
    "of_flow_angles",
    "parse_effects",
    "profiled",
    "ramp_terms",
    "registered_templates",
    "regressors",
    "spline_over",
    "stall_loop",
    "surfaces_of",
    "variables_of",
    "view_of",
    "with_flattening",
    "within_what_is_known",
    "zero_lift_alpha",
]
