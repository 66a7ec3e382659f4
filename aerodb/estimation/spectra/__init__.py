"""Frequency responses, and models of low order that are fitted to them.

1. `frequency_responses` gives a `FrequencyResponse` per input, with coherence, conditioned on the
   other inputs.
2. `transfer_function_fit` fits a `TransferFunction` of low order with a delay to one.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
