from .check_cases import SignalEvaluator, read_check_cases, verify_cases
from .export import export_daveml
from .names import read_unit
from .reader import import_daveml
from .xml_elements import is_daveml

__all__ = [
    "SignalEvaluator",
    "export_daveml",
    "import_daveml",
    "is_daveml",
    "read_check_cases",
    "read_unit",
    "verify_cases",
]
