"""Sensor models: what each sensor shows along a path, and how that depends on every unknown.

- `parameters`: names, natural sizes and scopes of the unknowns (`parameter`, `unknowns`), and the
  channels that they act on (`channels_of`, `delays_of`).
- `prediction`: a `FlightRecord` is one stretch of flight; `predict_outputs` integrates its path and
  returns a `RecordPrediction` (states, outputs and their derivatives); `corrected_inputs` removes
  bias and scale from the inertial sensors.
- `models`: the true quantity behind each output, as a formula in states and rates;
  `installation_from_vehicle` says where and how the sensors are mounted.

Three checks need no estimation. `detect_faults` (`expected`) finds gross faults: signs, units,
swapped axes, missing gravity. `process_noise` (`whiteness`) tells from residuals whether the air
moved. `position_against_velocity` and `flow_against_velocity` (`navigation`) check a logged
navigation solution against itself.

Next: `aerodb.consistency.output_error` estimates the unknowns.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .expected import SensorFault, detect_faults
    from .models import installation_from_vehicle
    from .navigation import (
        FlowCheck,
        VelocityCheck,
        flow_against_velocity,
        position_against_velocity,
    )
    from .parameters import (
        AIR_DATA,
        OUTPUTS,
        PER_FLIGHT,
        SensorParameter,
        channels_of,
        delays_of,
        parameter,
        unknowns,
    )
    from .prediction import (
        MAX_DELAY,
        FlightRecord,
        RecordPrediction,
        corrected_inputs,
        delayed,
        earth_to_body,
        outputs_along,
        predict_outputs,
        thinned,
    )
    from .whiteness import CALM_GUST_SPEED, ProcessNoise, process_noise, residual_noise

__getattr__, __dir__, __all__ = attach(__name__, __file__)
