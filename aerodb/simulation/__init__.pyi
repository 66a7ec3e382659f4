from .airframe_model import Airframe, MovingAir, airframe
from .autopilot import Autopilot, ControlDerivatives, control_derivatives
from .flight import History, fly
from .inputs import Event, superposed
from .motion import quaternion_from_euler
from .sensors import Instrument, Signal, at_instruments, measure
from .turbulence import DrydenGusts

__all__ = [
    "Airframe",
    "Autopilot",
    "ControlDerivatives",
    "DrydenGusts",
    "Event",
    "History",
    "Instrument",
    "MovingAir",
    "Signal",
    "airframe",
    "at_instruments",
    "control_derivatives",
    "fly",
    "measure",
    "quaternion_from_euler",
    "superposed",
]
