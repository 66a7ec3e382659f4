from . import calibration
from .calibration import Calibration, from_document
from .corrected import ChannelSource, Origin
from .output_error import joint_calibration
from .smoother import StateNoise, state_noise_from
from .whole_flight import Consistent, make_consistent

__all__ = [
    "Calibration",
    "ChannelSource",
    "Consistent",
    "Origin",
    "StateNoise",
    "calibration",
    "from_document",
    "joint_calibration",
    "make_consistent",
    "state_noise_from",
]
