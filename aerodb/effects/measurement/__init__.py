"""Sensor and vehicle-data errors: hypotheses that compete with the aerodynamic ones.

A wrong sensor or vehicle file can produce the same residual as a wrong database. The templates
(`sensor_accelerometer`, `sensor_flow_angles`, `sensor_gyro`, `sensor_qbar`, `mass_properties`,
`surface_calibration`) give the tangent of the whole processing chain, from the sensor to the six
coefficients, per unit of error; `aerodb.effects.library` lists them, and `sensor` holds what they
share. `reconstructed_angles` adapts the hypotheses to flights without a vane.

Errors that no residual shows enter estimates as additional uncertainty: `constant_errors` (biases
and delays left by flight-path reconstruction) and `angle_errors` (errors in variables of a
reconstructed angle).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .air_rotation import air_rotation_columns
    from .angle_errors import alpha_consider_parameters, with_attenuation
    from .constant_errors import sensor_consider_parameters
    from .reconstructed_angles import hypotheses_for_flight, with_reconstructed_angles
    from .remaining_errors import within_reconstruction_accuracy

__getattr__, __dir__, __all__ = attach(__name__, __file__)
