from .estimation import (
    FlightReconstruction,
    air_remarks,
    biases_that_may_be_air,
    decimated_records,
    estimate_sensors,
    joint_calibration,
    most_active,
    reconstruct_flight,
)
from .input_noise import inertial_noise
from .posterior import SensorEstimates, applied_corrections, shared_estimates, with_vehicle_priors
from .reconstruction import Estimate, ReconstructedPath, Reconstruction, reconstruct

__all__ = [
    "Estimate",
    "FlightReconstruction",
    "ReconstructedPath",
    "Reconstruction",
    "SensorEstimates",
    "air_remarks",
    "applied_corrections",
    "biases_that_may_be_air",
    "decimated_records",
    "estimate_sensors",
    "inertial_noise",
    "joint_calibration",
    "most_active",
    "reconstruct",
    "reconstruct_flight",
    "shared_estimates",
    "with_vehicle_priors",
]
