from .clock import clean_clock, interval, is_uniform
from .differentiation import FEWEST_SAMPLES, band_passed, bridge, low_passed, smooth
from .error_measures import Theil, rms, theil
from .masks import runs
from .resampling import (
    PASS_EDGE,
    Resampler,
    decimated,
    first_order_lag,
    hold,
    is_out_of_proportion,
    low_pass_taps,
    resampler,
    uniform_grid,
)

__all__ = [
    "FEWEST_SAMPLES",
    "PASS_EDGE",
    "Resampler",
    "Theil",
    "band_passed",
    "bridge",
    "clean_clock",
    "decimated",
    "first_order_lag",
    "hold",
    "interval",
    "is_out_of_proportion",
    "is_uniform",
    "low_pass_taps",
    "low_passed",
    "resampler",
    "rms",
    "runs",
    "smooth",
    "theil",
    "uniform_grid",
]
