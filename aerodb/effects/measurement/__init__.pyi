from . import (
    mass_properties,
    sensor_accelerometer,
    sensor_flow_angles,
    sensor_gyro,
    sensor_qbar,
    surface_calibration,
)
from .angle_errors import doubts_of_alpha, with_flattening
from .constant_errors import doubts
from .reconstructed_angles import columns_of, of_flow_angles, within_what_is_known

__all__ = [
    "columns_of",
    "doubts",
    "doubts_of_alpha",
    "mass_properties",
    "of_flow_angles",
    "sensor_accelerometer",
    "sensor_flow_angles",
    "sensor_gyro",
    "sensor_qbar",
    "surface_calibration",
    "with_flattening",
    "within_what_is_known",
]
