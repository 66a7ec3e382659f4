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

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
