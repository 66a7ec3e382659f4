from .airframe_model import Airframe, MovingAir, airframe
from .autopilot import Autopilot, ControlDerivatives, control_derivatives
from .engine import Actuator, Engine, FlightModel, Simulation, flight_model, simulate
from .flight import History, fly
from .inputs import Event, superposed
from .motion import quaternion_from_euler
from .sensors import Instrument, Signal, at_instruments, measure
from .turbulence import DrydenGusts

__all__ = [
    "Actuator",
    "Airframe",
    "Autopilot",
    "ControlDerivatives",
    "DrydenGusts",
    "Engine",
    "Event",
    "FlightModel",
    "History",
    "Instrument",
    "MovingAir",
    "Signal",
    "Simulation",
    "airframe",
    "at_instruments",
    "control_derivatives",
    "flight_model",
    "fly",
    "measure",
    "quaternion_from_euler",
    "simulate",
    "superposed",
]
