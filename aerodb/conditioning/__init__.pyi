from .channel_rates import alpha_rate, beta_rate, with_accelerations
from .condition import (
    Conditioning,
    examine,
    flag_unusable,
    from_document,
    suspicion_documents,
    to_document,
)
from .delay import delay_between
from .duplicates import FEWEST_MARKS, Shared, fingerprint, shared_samples
from .local_gravity import local_gravity
from .plausibility import Suspicion, clock_suspicions, start_suspicions
from .segmentation import STATES, Segment
from .wild_points import spikes, without_wild_points

__all__ = [
    "FEWEST_MARKS",
    "STATES",
    "Conditioning",
    "Segment",
    "Shared",
    "Suspicion",
    "alpha_rate",
    "beta_rate",
    "clock_suspicions",
    "delay_between",
    "examine",
    "fingerprint",
    "flag_unusable",
    "from_document",
    "local_gravity",
    "shared_samples",
    "spikes",
    "start_suspicions",
    "suspicion_documents",
    "to_document",
    "with_accelerations",
    "without_wild_points",
]
