from .expected import Fault, faults
from .models import installed
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
from .prediction import LONGEST_DELAY, Record, Response, corrected_inputs, delayed, respond, to_body
from .whiteness import CALM, ProcessNoise, colour, process_noise

__all__ = [
    "AIR_DATA",
    "CALM",
    "LONGEST_DELAY",
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
    "colour",
    "corrected_inputs",
    "delayed",
    "delays_of",
    "faults",
    "flow_against_velocity",
    "installed",
    "parameter",
    "position_against_velocity",
    "process_noise",
    "respond",
    "to_body",
    "unknowns",
]
