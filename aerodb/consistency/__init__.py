"""Check and correct a flight by flight-path reconstruction.

Accelerometers and gyros alone determine the motion of an aircraft, without an aerodynamic model.
Whatever disagrees with that motion is a sensor error or the wind. `make_consistent` does the whole
step for one flight; its stages, in order:

1. `records.records_from_flight` cuts the flight into records: stretches without gaps.
2. `plan.make_plan` chooses the parameters to estimate and their priors.
3. `sensors` predicts what every sensor shows along a path, with derivatives; `kinematics` and
   `motion` integrate the path.
4. `output_error` estimates sensor errors, winds and initial states (maximum likelihood) and
   combines them with their priors, or with a `Calibration` from earlier flights.
5. `smoother` adds gusts and inertial noise and gives every channel with its standard error.
6. `corrected.corrected_flight` corrects every sample of the flight and chooses, channel by channel,
   between sensor and smoother; `pressures` holds what concerns port errors and five-hole probes.
7. `verdict.judge` says whether the flight is good, limited or rejected, and why.

Main names: `make_consistent` -> `Consistent`; `joint_calibrations` -> `Calibration`, from several
flights; `StateNoise`, the error spectrum of the corrected channels; `Origin`, where
a channel's values come from. Method and references: docs/method/consistency.md.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from . import calibration
    from .air_velocity import air_velocity, probe_path
    from .calibration import Calibration, from_document
    from .corrected import Origin, air_data_of_sensors
    from .outlook import unmeasured_angles_outlook
    from .output_error import joint_calibrations
    from .plan import ReconstructionPlan
    from .smoother import StateNoise, state_noise_from
    from .verdict import Verdict, judge
    from .whole_flight import Consistent, make_consistent, unreadable_document

__getattr__, __dir__, __all__ = attach(__name__, __file__)
