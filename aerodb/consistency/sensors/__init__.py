"""Sensor models: what each sensor shows along a path, and how that depends on every unknown.

- `parameters`: names, natural sizes and scopes of the unknowns (`parameter`, `unknowns`), and the
  channels that they act on (`channels_of`, `delays_of`).
- `prediction`: a `Record` is one stretch of flight; `predict_outputs` integrates its path and
  returns a `Response` (states, outputs and their derivatives); `corrected_inputs` removes bias and
  scale from the inertial sensors.
- `models`: the true quantity behind each output, as a formula in states and rates;
  `installation_from_vehicle` says where and how the sensors are mounted.

Three checks need no estimation. `detect_faults` (`expected`) finds gross faults: signs, units,
swapped axes, missing gravity. `process_noise` (`whiteness`) tells from residuals whether the air
moved. `position_against_velocity` and `flow_against_velocity` (`navigation`) check a logged
navigation solution against itself.

Next: `aerodb.consistency.output_error` estimates the unknowns.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
