"""Sensor and vehicle-data errors: hypotheses that compete with the aerodynamic ones.

A wrong sensor or vehicle file can produce the same residual as a wrong database. The templates
(`sensor_accelerometer`, `sensor_flow_angles`, `sensor_gyro`, `sensor_qbar`, `mass_properties`,
`surface_calibration`, `surface_motion`) give the tangent of the whole processing chain, from the
sensor to the six coefficients, per unit of error; `aerodb.effects.library` lists them, and `sensor`
holds what they share. `reconstructed_angles` adapts the hypotheses to flights without a vane.

`error_columns` are the tangents of biases and delays that flight-path reconstruction leaves open.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .air_rotation import air_rotation_columns
    from .error_columns import ERROR_COLUMNS, with_wind
    from .reconstructed_angles import hypotheses_for_flight, with_reconstructed_angles
    from .remaining_errors import within_reconstruction_accuracy
    from .sensor import BELIEVED, predicted_change
    from .sensor_flow_angles import NATURAL_ANGLE_ERRORS
    from .surface_motion import SURFACE_MOTION, half_width

__getattr__, __dir__, __all__ = attach(__name__, __file__)
