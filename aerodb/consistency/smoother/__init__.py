"""Kalman smoother for a reconstructed flight: adds gusts and inertial noise to its path.

1. `path_error` writes the error of a reconstructed path and the gusts as a linear system.
2. `gusts` estimates the intensities of gusts, sensor drifts and noise by maximum likelihood
   (`intensities_of` -> `Intensities`, with `Gusts`).
3. `kalman` filters and smooths that system (compiled).
4. `smooth_flight` (`smoothing`) puts these together and returns a `SmoothedFlight`: one
   `SmoothedPath` (`smoothed_path`) per record, with standard errors and, on request, random draws
   of the error.
5. `state_noise` (`state_error_spectrum`) turns the draws into the spectrum of the error of every
   channel: a `StateNoise`, stored with the flight; `state_noise_from` reads it back.

Before: `aerodb.consistency.output_error`. After: `aerodb.consistency.corrected`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .gusts import Gusts, Intensities
    from .smoothed_path import SmoothedPath
    from .smoothing import SmoothedFlight, intensities_of, smooth_flight
    from .state_error_spectrum import Source, StateNoise, state_noise, state_noise_from

__getattr__, __dir__, __all__ = attach(__name__, __file__)
