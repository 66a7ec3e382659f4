from .axis_models import (
    cross_flight_tests,
    imitated_sensors,
    increment_models,
    significant_beside,
    supported_axes,
    trace_increment_models,
)
from .between_flights import FlightDependence, dependences_on_conditions
from .few_flights import (
    LINEAR,
    FewFlightFindings,
    accompanying_linear_terms,
    few_flight_findings,
    windows,
)
from .findings import ADDED, Finding, Traced, only_suspected
from .joint_model import joint_bands, joint_fit
from .refinement import Refined, downgraded_on_axes, refine
from .residual_records import FlightResidual
from .rotating_air import driven_by_rates, lost_in_rotating_air
from .shapes import FEWEST_SHAPED, with_checked_shapes
from .unexplained_residual import (
    UnexplainedResidual,
    model_errors,
    unexplained_by_axis,
    without_state_noise,
)
from .verdicts import trace

__all__ = [
    "ADDED",
    "FEWEST_SHAPED",
    "LINEAR",
    "FewFlightFindings",
    "Finding",
    "FlightDependence",
    "FlightResidual",
    "Refined",
    "Traced",
    "UnexplainedResidual",
    "accompanying_linear_terms",
    "cross_flight_tests",
    "dependences_on_conditions",
    "downgraded_on_axes",
    "driven_by_rates",
    "few_flight_findings",
    "imitated_sensors",
    "increment_models",
    "joint_bands",
    "joint_fit",
    "lost_in_rotating_air",
    "model_errors",
    "only_suspected",
    "refine",
    "significant_beside",
    "supported_axes",
    "trace",
    "trace_increment_models",
    "unexplained_by_axis",
    "windows",
    "with_checked_shapes",
    "without_state_noise",
]
