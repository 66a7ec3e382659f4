from .check_cases import check_in_jsbsim, jsbsim_check_cases
from .export import export_jsbsim, input_properties
from .properties import HYSTERESIS, hysteresis_text, own_name
from .reader import import_jsbsim

__all__ = [
    "HYSTERESIS",
    "check_in_jsbsim",
    "export_jsbsim",
    "hysteresis_text",
    "import_jsbsim",
    "input_properties",
    "jsbsim_check_cases",
    "own_name",
]
