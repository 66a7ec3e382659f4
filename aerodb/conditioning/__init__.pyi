from .channel_rates import alpha_rate, beta_rate, with_accelerations
from .clock import clean_clock, interval, is_uniform
from .condition import (
    Conditioning,
    examine,
    flag_unusable,
    from_document,
    suspicion_documents,
    to_document,
)
from .delay import delay_between
from .differentiation import FEWEST_SAMPLES, band_passed, bridge, low_passed, smooth
from .duplicates import FEWEST_MARKS, Shared, fingerprint, shared_samples
from .local_gravity import local_gravity
from .plausibility import Suspicion, clock_suspicions, start_suspicions
from .resampling import (
    PASS_EDGE,
    Resampler,
    first_order_lag,
    hold,
    is_out_of_proportion,
    low_pass_taps,
    resampler,
    uniform_grid,
)
from .responses import runs
from .segmentation import STATES, Segment
from .wild_points import spikes, without_wild_points

__all__ = [
    "FEWEST_MARKS",
    "FEWEST_SAMPLES",
    "PASS_EDGE",
    "STATES",
    "Conditioning",
    "Resampler",
    "Segment",
    "Shared",
    "Suspicion",
    "alpha_rate",
    "band_passed",
    "beta_rate",
    "bridge",
    "clean_clock",
    "clock_suspicions",
    "delay_between",
    "examine",
    "fingerprint",
    "first_order_lag",
    "flag_unusable",
    "from_document",
    "hold",
    "interval",
    "is_out_of_proportion",
    "is_uniform",
    "local_gravity",
    "low_pass_taps",
    "low_passed",
    "resampler",
    "runs",
    "shared_samples",
    "smooth",
    "spikes",
    "start_suspicions",
    "suspicion_documents",
    "to_document",
    "uniform_grid",
    "with_accelerations",
    "without_wild_points",
]
