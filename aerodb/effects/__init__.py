"""The effect library: what may be wrong in a database, a sensor or the vehicle file, as hypotheses.

A hypothesis is one parameter and its column, the derivative of measured - predicted with respect to
it. `aerodb.tracing` tests hypotheses; this package says which exist and computes their columns.

1. `hypotheses_for` expands all templates for a database, a vehicle and the channels of its flights;
   `parse_effects` and `registered_templates` add the templates of the user. `library_sha256` hashes
   the result before any residual is looked at.
2. `view_of` makes a `FlightView`: what hypotheses may use of one flight. `Hypothesis.columns` gives
   the columns of that flight, per body axis.
3. `add_effects` adds accepted hypotheses to a database as increments, inside the envelope that
   `envelopes_of` finds.

Modules: `template` (how an effect becomes hypotheses), `library` (all templates), `hypothesis`,
`flight_view` (columns), `surfaces` (roles of control surfaces), `spline` (shape
refinement), `interpolation_terms` (tables as expressions), `user_effects`, `adding`. Packages:
`aerodynamic` (terms that a database can lack), `measurement` (sensor and vehicle-data errors),
`stall` (separated flow with hysteresis).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .adding import add_effects, envelopes_of
    from .aerodynamic import from_zero_lift, lift_curve, zero_lift_alpha
    from .flight_view import FlightView, view_of
    from .hypothesis import Columns, Hypothesis
    from .library import hypotheses_for, library_sha256
    from .measurement import (
        BELIEVED,
        ERROR_COLUMNS,
        NATURAL_ANGLE_ERRORS,
        SURFACE_MOTION,
        air_rotation_columns,
        half_width,
        hypotheses_for_flight,
        predicted_change,
        with_reconstructed_angles,
        with_wind,
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

__getattr__, __dir__, __all__ = attach(__name__, __file__)
