from .frequency_response import FrequencyResponse, frequency_responses
from .transfer_function import TransferFunction, transfer_function_fit

__all__ = [
    "FrequencyResponse",
    "TransferFunction",
    "frequency_responses",
    "transfer_function_fit",
]
