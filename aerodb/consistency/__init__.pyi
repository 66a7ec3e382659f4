from . import calibration
from .calibration import Calibration, from_document
from .corrected import CorrectedFlight, Origin, corrected_flight
from .output_error import joint_calibration
from .plan import Plan, make_plan
from .records import records_from_flight
from .smoother import StateNoise, state_noise_from
from .verdict import Verdict, judge
from .whole_flight import Consistent, make_consistent, unreadable_document

__all__ = [
    "Calibration",
    "Consistent",
    "CorrectedFlight",
    "Origin",
    "Plan",
    "StateNoise",
    "Verdict",
    "calibration",
    "corrected_flight",
    "from_document",
    "joint_calibration",
    "judge",
    "make_consistent",
    "make_plan",
    "records_from_flight",
    "state_noise_from",
    "unreadable_document",
]
