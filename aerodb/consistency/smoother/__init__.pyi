from .gusts import Gusts, Intensities
from .smoothing import Smoothed, SmoothedPath, intensities_of, smooth_flight
from .state_error_spectrum import Source, StateNoise, state_noise, state_noise_from

__all__ = [
    "Gusts",
    "Intensities",
    "Smoothed",
    "SmoothedPath",
    "Source",
    "StateNoise",
    "intensities_of",
    "smooth_flight",
    "state_noise",
    "state_noise_from",
]
