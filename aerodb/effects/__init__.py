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

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
