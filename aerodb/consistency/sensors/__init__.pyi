from .expected import Fault, detect_faults
from .models import installation_from_vehicle
from .navigation import FlowCheck, VelocityCheck, flow_against_velocity, position_against_velocity
from .parameters import (
    AIR_DATA,
    OUTPUTS,
    PER_FLIGHT,
    Parameter,
    channels_of,
    delays_of,
    parameter,
    unknowns,
)
from .prediction import (
    MAX_DELAY,
    Record,
    Response,
    corrected_inputs,
    delayed,
    earth_to_body,
    outputs_along,
    predict_outputs,
    thinned,
)
from .whiteness import CALM_GUST_SPEED, ProcessNoise, process_noise, residual_noise

__all__ = [
    "AIR_DATA",
    "CALM_GUST_SPEED",
    "MAX_DELAY",
    "OUTPUTS",
    "PER_FLIGHT",
    "Fault",
    "FlowCheck",
    "Parameter",
    "ProcessNoise",
    "Record",
    "Response",
    "VelocityCheck",
    "channels_of",
    "corrected_inputs",
    "delayed",
    "delays_of",
    "detect_faults",
    "earth_to_body",
    "flow_against_velocity",
    "installation_from_vehicle",
    "outputs_along",
    "parameter",
    "position_against_velocity",
    "predict_outputs",
    "process_noise",
    "residual_noise",
    "thinned",
    "unknowns",
]
