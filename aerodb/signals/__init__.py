"""Sampled signals: their clock, resampling, filters and errors; none of it knows about flight.

- `clean_clock`, `interval` and `is_uniform` work on time stamps (`clock`); `uniform_grid`,
  `resampler`, `hold` and `first_order_lag` bring values onto one grid (`resampling`).
- `smooth`, `low_passed`, `low_passed_rate`, `band_passed` and `bridge` are filters without delay;
  `integrated` is their inverse of a rate (`differentiation`).
- `played` is what follows through a play (`backlash`).
- `runs` finds stretches of samples (`masks`).
- `rms` and `theil` measure how well a prediction follows a measurement (`error_measures`).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .backlash import played
    from .clock import clean_clock, interval, is_uniform
    from .differentiation import (
        FEWEST_SAMPLES,
        band_passed,
        bridge,
        integrated,
        low_passed,
        low_passed_rate,
        smooth,
    )
    from .error_measures import Theil, rms, theil
    from .masks import runs
    from .resampling import (
        PASS_EDGE,
        Resampler,
        decimated,
        first_order_lag,
        hold,
        is_out_of_proportion,
        low_pass,
        low_pass_taps,
        resampler,
        uniform_grid,
    )

__getattr__, __dir__, __all__ = attach(__name__, __file__)
