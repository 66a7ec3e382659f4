from . import calibration
from .calibration import Calibration, from_document
from .corrected import WITHOUT_SENSOR
from .output_error import joint_calibration
from .smoother import StateNoise, state_noise_from
from .whole_flight import Consistent, make_consistent

__all__ = [
    "WITHOUT_SENSOR",
    "Calibration",
    "Consistent",
    "StateNoise",
    "calibration",
    "from_document",
    "joint_calibration",
    "make_consistent",
    "state_noise_from",
]
