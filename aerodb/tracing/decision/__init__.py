"""Choose terms and sensors, explain each choice, and state what the flights exclude.

`trace` is the whole decision for enough flights: selection, explanation sets, refits without a
fold, verdicts, next flight; it returns a `Traced` of `Finding`s and bounds. `few_flight_findings`
takes its place where manoeuvres have to count as units. `refine` fits what was accepted once more,
`unexplained_by_axis` looks for what no hypothesis names, `dependences_on_conditions` for what
differs between flights.

Modules: `selection` (forward selection, `CrossFlightTests`), `explanation_sets`, `verdicts`,
`next_flight`, `findings` (results and their JSON); `few_flights` and `joint_model`; `refinement`;
`unexplained_residual` with `residual_records` and `ridge_model`; `between_flights`; `shapes` and
`functions`. The method: docs/method/tracing.md, sections 9 to 16, 25 and 26.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .axis_models import (
        cross_flight_tests,
        imitated_sensors,
        increment_models,
        outdoing_sensors,
        significant_beside,
        supported_axes,
        trace_increment_models,
    )
    from .between_flights import FlightDependence, dependences_on_conditions
    from .covariance import joint_covariance
    from .explanation_sets import agreement, may_be_off_by
    from .few_flights import (
        LINEAR,
        FewFlightFindings,
        accompanying_linear_terms,
        few_flight_findings,
        windows,
    )
    from .findings import ADDED, Finding, NotFound, Traced, Verdict, Vote, doubted, only_suspected
    from .joint_model import joint_bands, joint_fit
    from .refinement import Refined, downgraded_on_axes, refine
    from .residual_records import FlightResidual
    from .rotating_air import driven_by_rates, lost_in_rotating_air
    from .selection import CrossFlightTests
    from .shapes import FEWEST_SHAPED, imitations, with_checked_shapes
    from .unexplained_residual import (
        UnexplainedResidual,
        model_errors,
        unexplained_by_axis,
        without_state_noise,
    )
    from .verdicts import trace

__getattr__, __dir__, __all__ = attach(__name__, __file__)
