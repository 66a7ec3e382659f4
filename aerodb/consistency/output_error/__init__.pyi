from .estimation import busiest, estimate, joint_calibration, settled, slow_records
from .input_noise import inertial_noise
from .posterior import Knowledge, applied, shared, with_stated
from .reconstruction import Estimate, Path, Reconstruction

__all__ = [
    "Estimate",
    "Knowledge",
    "Path",
    "Reconstruction",
    "applied",
    "busiest",
    "estimate",
    "inertial_noise",
    "joint_calibration",
    "settled",
    "shared",
    "slow_records",
    "with_stated",
]
