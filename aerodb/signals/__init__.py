"""Sampled signals: their clock, resampling, filters and errors; none of it knows about flight.

- `clean_clock`, `interval` and `is_uniform` work on time stamps (`clock`); `uniform_grid`,
  `resampler`, `hold` and `first_order_lag` bring values onto one grid (`resampling`).
- `smooth`, `low_passed`, `band_passed` and `bridge` are filters without delay
  (`differentiation`).
- `runs` finds stretches of samples (`masks`).
- `rms` and `theil` measure how well a prediction follows a measurement (`error_measures`).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
