from .adding import add_effects, envelopes_of
from .aerodynamic import from_zero_lift, zero_lift_alpha
from .flight_view import FlightView, view_of
from .hypothesis import Columns, Hypothesis
from .library import hypotheses_for, library_sha256
from .measurement import (
    air_rotation_columns,
    alpha_consider_parameters,
    hypotheses_for_flight,
    sensor_consider_parameters,
    with_attenuation,
    with_reconstructed_angles,
    within_reconstruction_accuracy,
)
from .spline import ramp_terms, spline_over, variables_of
from .stall import (
    STALL_GAIN_BOUNDS,
    StallFlight,
    cross_fit_shapes,
    fit_shape,
    lift_hysteresis,
    stall_hypotheses,
    stall_regressors,
)
from .surfaces import surfaces_at_rest, surfaces_of
from .template import WIND_TO_BODY_AXES, LibraryContext
from .user_effects import parse_effects, registered_templates

__all__ = [
    "STALL_GAIN_BOUNDS",
    "WIND_TO_BODY_AXES",
    "Columns",
    "FlightView",
    "Hypothesis",
    "LibraryContext",
    "StallFlight",
    "add_effects",
    "air_rotation_columns",
    "alpha_consider_parameters",
    "cross_fit_shapes",
    "envelopes_of",
    "fit_shape",
    "from_zero_lift",
    "hypotheses_for",
    "hypotheses_for_flight",
    "library_sha256",
    "lift_hysteresis",
    "parse_effects",
    "ramp_terms",
    "registered_templates",
    "sensor_consider_parameters",
    "spline_over",
    "stall_hypotheses",
    "stall_regressors",
    "surfaces_at_rest",
    "surfaces_of",
    "variables_of",
    "view_of",
    "with_attenuation",
    "with_reconstructed_angles",
    "within_reconstruction_accuracy",
    "zero_lift_alpha",
]
