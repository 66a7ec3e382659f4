"""Trace residuals of flights to effects that the database lacks, and to sensors that are wrong.

A flight is one observation: the samples within it are autocorrelated, flights are independent.
docs/method/tracing.md has the method at length; its section numbers stand in brackets.

1. A *hypothesis* is one parameter. `evidence_of` forms the flight's residual and one regressor
   column per hypothesis, aerodynamic and sensors alike [2-4]. Optional: `noisy_copies` (more state
   noise, for SIMEX), `with_shape_terms`, `with_instruments` [17, 19, 20]; `thinned` for long
   flights [21].
2. `normal_equations_of` low-passes and decimates all columns alike (band: `tracing_bandwidth`),
   whitens them by an autoregression fitted to the residual, and keeps their cross-products per
   flight: `FlightNormalEquations` [5, 6]. No later step uses samples.
3. `estimates.campaign` puts the flights on one order of columns and projects out the intercepts
   (trims). `estimates.elimination` eliminates the sensor parameters under their priors, then the
   accepted terms. What remains is, per flight and hypothesis, an estimate and its information:
   `estimates.FlightEstimates` [7]. Reports call such an estimate a vote.
4. `estimates.over_flights` tests each hypothesis by a t-test over flights, with moderated variance
   and a systematic bound for sensors and state noise; p-values are adjusted after Holm [8].
5. `decision.selection.decide` selects terms forward; sensors are rivals at each step [9].
6. `decision.explanation_sets.explain` collects the rivals and the single sensors that explain a
   term as well: its explanation set [10].
7. `trace` runs steps 3 to 6, repeats the selection without one fold of the flights after another,
   and returns a `Traced`: findings with interval and verdict, bounds for everything else [11, 12],
   and what to fly next (`decision.next_flight.next_flights`) [15].
8. Too few flights: `units` cuts them into manoeuvres (`SamplingUnit`), `few_flight_findings` fits
   these jointly (`joint_fit`); nothing found so is more than suspected [16].
9. With a candidate database: `refine` fits gains and shapes once more, `unexplained_by_axis` asks
   whether anything in the state still predicts the residual [14], `dependences_on_conditions`
   whether an effect changes with the conditions of the flights [25].

`TracingSettings` holds all settings and their hash [22]. Modules: `evidence` is one flight,
`estimates` all flights and one model, `decision` the choice between models.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .decision import (
        ADDED,
        FEWEST_SHAPED,
        LINEAR,
        CrossFlightTests,
        FewFlightFindings,
        Finding,
        FlightDependence,
        FlightResidual,
        NotFound,
        Refined,
        Traced,
        UnexplainedResidual,
        Verdict,
        Vote,
        accompanying_linear_terms,
        agreement,
        cross_flight_tests,
        dependences_on_conditions,
        doubted,
        downgraded_on_axes,
        driven_by_rates,
        few_flight_findings,
        imitated_sensors,
        imitations,
        increment_models,
        joint_bands,
        joint_covariance,
        joint_fit,
        lost_in_rotating_air,
        may_be_off_by,
        model_errors,
        only_suspected,
        outdoing_sensors,
        refine,
        significant_beside,
        supported_axes,
        trace,
        trace_increment_models,
        unexplained_by_axis,
        windows,
        with_checked_shapes,
        without_state_noise,
    )
    from .estimates import paired_p, prepare_elimination
    from .evidence import (
        LONG,
        Evidence,
        FlightNormalEquations,
        SamplingUnit,
        bounded_noise,
        evidence_of,
        noisy_copies,
        normal_equations_from_arrays,
        normal_equations_of,
        roll_rates,
        rotating_air,
        thinned,
        tracing_bandwidth,
        units,
        with_air_data_noise,
        with_commanded_rates,
        with_deflection_noise,
        with_instruments,
        with_shape_terms,
    )
    from .settings import TracingSettings

__getattr__, __dir__, __all__ = attach(__name__, __file__)
