from .candidate import update_by
from .declared_terms import with_known_terms, with_terms
from .derivative_file import converted, parse_derivative_file
from .equations import no_database, no_database_beside, parameter_name
from .flight_dynamics import FlightDynamics, flight_dynamics
from .identification_flight import IdentificationFlight
from .method_comparison import Agreement, MethodComparison, compare_methods
from .methods import METHODS, REGRESSION, Method, chosen_methods
from .model_file import (
    StateSpaceFile,
    declares_state_space,
    file_records,
    flight_records,
    parse_state_space,
    state_space_fit,
)
from .online import ONLINE_METHODS, OnlineEstimation, OnlineSettings
from .problem import fits_of

__all__ = [
    "METHODS",
    "ONLINE_METHODS",
    "REGRESSION",
    "Agreement",
    "FlightDynamics",
    "IdentificationFlight",
    "Method",
    "MethodComparison",
    "OnlineEstimation",
    "OnlineSettings",
    "StateSpaceFile",
    "chosen_methods",
    "compare_methods",
    "converted",
    "declares_state_space",
    "file_records",
    "fits_of",
    "flight_dynamics",
    "flight_records",
    "no_database",
    "no_database_beside",
    "parameter_name",
    "parse_derivative_file",
    "parse_state_space",
    "state_space_fit",
    "update_by",
    "with_known_terms",
    "with_terms",
]
