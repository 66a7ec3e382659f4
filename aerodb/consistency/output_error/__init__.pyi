from .estimation import (
    decimated_records,
    estimate_sensors,
    joint_calibration,
    most_active,
    reconstruct_flight,
)
from .input_noise import inertial_noise
from .posterior import SensorEstimates, applied_corrections, shared_estimates, with_vehicle_priors
from .reconstruction import Estimate, ReconstructedPath, Reconstruction

__all__ = [
    "Estimate",
    "SensorEstimates",
    "ReconstructedPath",
    "Reconstruction",
    "applied_corrections",
    "most_active",
    "estimate_sensors",
    "inertial_noise",
    "joint_calibration",
    "reconstruct_flight",
    "shared_estimates",
    "decimated_records",
    "with_vehicle_priors",
]
