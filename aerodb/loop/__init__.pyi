from .between_flights import dependences_between_flights
from .consider import consider_parameters, noisier_flights
from .evidence import evidence_beside
from .flight_source import FlightSource, ReconstructionErrors
from .freezing import freeze_library
from .frozen_library import Library
from .model_error import with_model_error
from .rivals import SensorRival, sensor_rivals
from .rounds import Accept, LoopResult, run_loop
from .stall_windows import StallWindow, stall_windows
from .unexplained import unexplained_residuals
from .validation import beside_larger_unnamed, until_all_gain, validate_loop, without_gain
from .without_store import WithoutStore

__all__ = [
    "Accept",
    "FlightSource",
    "Library",
    "LoopResult",
    "ReconstructionErrors",
    "SensorRival",
    "StallWindow",
    "WithoutStore",
    "beside_larger_unnamed",
    "consider_parameters",
    "dependences_between_flights",
    "evidence_beside",
    "freeze_library",
    "noisier_flights",
    "run_loop",
    "sensor_rivals",
    "stall_windows",
    "unexplained_residuals",
    "until_all_gain",
    "validate_loop",
    "with_model_error",
    "without_gain",
]
