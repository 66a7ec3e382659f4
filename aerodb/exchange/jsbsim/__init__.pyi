from .check_cases import Agreement, check_in_jsbsim, jsbsim_check_cases, read_jsbsim_cases
from .export import export_jsbsim, input_properties
from .mass_balance import MassBalance, mass_balance_of
from .merge import Merged, merge_jsbsim
from .properties import (
    STALL_HYSTERESIS,
    hysteresis_description,
    property_expression,
    property_identifier,
    property_unit,
)
from .reader import import_jsbsim

__all__ = [
    "STALL_HYSTERESIS",
    "Agreement",
    "MassBalance",
    "Merged",
    "check_in_jsbsim",
    "export_jsbsim",
    "hysteresis_description",
    "import_jsbsim",
    "input_properties",
    "jsbsim_check_cases",
    "mass_balance_of",
    "merge_jsbsim",
    "property_expression",
    "property_identifier",
    "property_unit",
    "read_jsbsim_cases",
]
