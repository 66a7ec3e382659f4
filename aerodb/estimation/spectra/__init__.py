"""Frequency responses, and models of low order that are fitted to them.

1. `frequency_responses` gives a `FrequencyResponse` per input, with coherence, conditioned on the
   other inputs.
2. `transfer_function_fit` fits a `TransferFunction` of low order with a delay to one.
3. `gust_spectrum` gives intensity and scale of turbulence with their limits (`GustSpectrum`).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .frequency_response import FrequencyResponse, frequency_responses
    from .gust_spectrum import GustSpectrum, Interval, gust_spectrum
    from .transfer_function import TransferFunction, transfer_function_fit

__getattr__, __dir__, __all__ = attach(__name__, __file__)
