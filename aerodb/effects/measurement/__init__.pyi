from . import (
    mass_properties,
    sensor_accelerometer,
    sensor_flow_angles,
    sensor_gyro,
    sensor_qbar,
    surface_calibration,
)
from .angle_errors import alpha_consider_parameters, with_attenuation
from .constant_errors import sensor_consider_parameters
from .reconstructed_angles import (
    hypotheses_for_flight,
    with_reconstructed_angles,
    within_reconstruction_accuracy,
)

__all__ = [
    "alpha_consider_parameters",
    "hypotheses_for_flight",
    "mass_properties",
    "sensor_accelerometer",
    "sensor_consider_parameters",
    "sensor_flow_angles",
    "sensor_gyro",
    "sensor_qbar",
    "surface_calibration",
    "with_attenuation",
    "with_reconstructed_angles",
    "within_reconstruction_accuracy",
]
