"""Quality of one flight before anything is estimated from it: flags, segments, delays.

The way through:

1. `flag_unusable` flags wild points, failed and clipped sensors, and samples on the ground; values
   stay as they are (`wild_points`, `failures`, `saturated`, `segmentation`, `condition`).
2. `segments` finds segments and manoeuvres (`segmentation`, `manoeuvres`, `responses`), `delays`
   the delay of each channel against its kinematics (`delay`, `channel_rates`).
3. `aerodb.suspicions.examine` adds each `Suspicion` and returns a `Conditioning`; `to_document` and
   `from_document` convert it to and from JSON.
4. `fingerprint` and `shared_samples` find records of the same flight (`duplicates`).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .channel_rates import (
        KINEMATICS,
        OPTIONAL,
        airspeed_rate,
        alpha_rate,
        beta_rate,
        with_accelerations,
    )
    from .condition import (
        Conditioning,
        flag_unusable,
        from_document,
        suspicion_documents,
        suspicions_from,
        to_document,
    )
    from .delay import (
        BAND,
        LARGEST_DELAY,
        LEAST_EXPLAINED,
        SAMPLES_PER_PERIOD,
        SCALE_TOLERANCE,
        delay_between,
        delays,
    )
    from .duplicates import FEWEST_MARKS, Shared, fingerprint, shared_samples
    from .failures import failures
    from .ground_motion import (
        STEADY_WIND_ALTITUDE,
        STEADY_WIND_TIME,
        despite_ground,
        ground_speed,
        places,
        wheel_speed,
    )
    from .local_gravity import local_gravity
    from .manoeuvres import SETTLED
    from .pitot import AIR, SLOW
    from .saturated import CLIPPED, saturated
    from .segment import STATES, Segment
    from .segmentation import carried, ground_and_air, segments, was_airborne
    from .selection import checked_conditions, selected
    from .suspicion import Suspicion, clock_suspicions
    from .wild_points import RAREST, SHORTEST_STUCK, spikes, stuck, without_wild_points

__getattr__, __dir__, __all__ = attach(__name__, __file__)
