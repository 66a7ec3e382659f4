from .agreement import Agreement, MethodComparison, compare_methods
from .candidate import update_by
from .conversion import (
    Derivatives,
    SteadyFlight,
    coefficient_derivatives,
    dimensional_derivatives,
    exact,
    matrix_derivatives,
)
from .equations import no_database
from .fit_report import fit_report
from .flight_dynamics import FlightDynamics, flight_dynamics
from .identification_flight import IdentificationFlight
from .methods import METHODS, REGRESSION, Method, chosen_methods
from .online import ONLINE_METHODS, OnlineEstimation, OnlineSettings
from .problem import fits_of

__all__ = [
    "METHODS",
    "ONLINE_METHODS",
    "REGRESSION",
    "Agreement",
    "Derivatives",
    "FlightDynamics",
    "IdentificationFlight",
    "Method",
    "MethodComparison",
    "OnlineEstimation",
    "OnlineSettings",
    "SteadyFlight",
    "chosen_methods",
    "coefficient_derivatives",
    "compare_methods",
    "dimensional_derivatives",
    "exact",
    "fit_report",
    "fits_of",
    "flight_dynamics",
    "matrix_derivatives",
    "no_database",
    "update_by",
]
