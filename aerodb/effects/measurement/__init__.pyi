from .air_rotation import air_rotation_columns
from .angle_errors import alpha_consider_parameters, with_attenuation
from .constant_errors import sensor_consider_parameters
from .reconstructed_angles import hypotheses_for_flight, with_reconstructed_angles
from .remaining_errors import within_reconstruction_accuracy

__all__ = [
    "air_rotation_columns",
    "alpha_consider_parameters",
    "hypotheses_for_flight",
    "sensor_consider_parameters",
    "with_attenuation",
    "with_reconstructed_angles",
    "within_reconstruction_accuracy",
]
