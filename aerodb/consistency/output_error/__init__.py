"""Output-error estimation of sensor errors, winds and initial states, with priors.

The way through, for one flight:

1. `decimated_records` gives the flight's records at 25 Hz; `most_active` picks those with the most
   motion.
2. `estimate_sensors` estimates the parameters of a plan from these and keeps the significant ones.
   It calls `reconstruct` (`reconstruction`): maximum likelihood by Gauss-Newton (`gauss_newton`)
   from first states (`initial_states`), with normal equations per channel (`normal_equations`) and
   a covariance that includes coloured residuals and inertial noise (`input_noise`).
3. `reconstruct_flight` combines the estimates with the vehicle file's priors or a calibration
   (`posterior`) and reconstructs all records with them: a `FlightReconstruction`.
4. `applied_corrections` says which estimates are used to correct the flight.

For several flights, `joint_calibrations` does steps 1 to 3 and returns a `Calibration`.

Results are of `aerodb.consistency.reconstructed`; `SensorEstimates` are values with covariance.
Next: `aerodb.consistency.smoother`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .estimation import (
        FlightReconstruction,
        air_remarks,
        biases_that_may_be_air,
        decimated_records,
        estimate_sensors,
        most_active,
        reconstruct_flight,
    )
    from .input_noise import inertial_noise
    from .joint_calibration import joint_calibrations
    from .posterior import (
        SensorEstimates,
        applied_corrections,
        shared_estimates,
        with_vehicle_priors,
    )
    from .reconstruction import reconstruct

__getattr__, __dir__, __all__ = attach(__name__, __file__)
