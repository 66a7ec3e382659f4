from .channel_rates import (
    KINEMATICS,
    OPTIONAL,
    airspeed_rate,
    alpha_rate,
    beta_rate,
    with_accelerations,
)
from .condition import Conditioning, flag_unusable, from_document, suspicion_documents, to_document
from .delay import delay_between, delays
from .duplicates import FEWEST_MARKS, Shared, fingerprint, shared_samples
from .local_gravity import local_gravity
from .segmentation import STATES, Segment, ground_and_air, segments
from .suspicion import Suspicion, clock_suspicions
from .wild_points import spikes, stuck, without_wild_points

__all__ = [
    "FEWEST_MARKS",
    "KINEMATICS",
    "OPTIONAL",
    "STATES",
    "Conditioning",
    "Segment",
    "Shared",
    "Suspicion",
    "airspeed_rate",
    "alpha_rate",
    "beta_rate",
    "clock_suspicions",
    "delay_between",
    "delays",
    "fingerprint",
    "flag_unusable",
    "from_document",
    "ground_and_air",
    "local_gravity",
    "segments",
    "shared_samples",
    "spikes",
    "stuck",
    "suspicion_documents",
    "to_document",
    "with_accelerations",
    "without_wild_points",
]
