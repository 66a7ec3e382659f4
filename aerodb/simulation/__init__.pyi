from .airframe_model import Airframe, MovingAir, airframe
from .autopilot import Autopilot, ControlDerivatives, control_derivatives
from .engine import Actuator, Engine, FlightModel, Simulation, flight_model, simulate
from .flight import History, fly
from .inputs import Event, superposed
from .linear_model import LinearModel, linear_model
from .modes import Mode, modes
from .motion import quaternion_from_euler
from .sensors import Instrument, Signal, at_instruments, measure
from .sweep import SweepPoint, sweep
from .trim import Condition, NoTrimError, Trim, trim
from .turbulence import DrydenGusts

__all__ = [
    "Actuator",
    "Airframe",
    "Autopilot",
    "Condition",
    "ControlDerivatives",
    "DrydenGusts",
    "Engine",
    "Event",
    "FlightModel",
    "History",
    "Instrument",
    "LinearModel",
    "Mode",
    "MovingAir",
    "NoTrimError",
    "Signal",
    "Simulation",
    "SweepPoint",
    "Trim",
    "airframe",
    "at_instruments",
    "control_derivatives",
    "flight_model",
    "fly",
    "linear_model",
    "measure",
    "modes",
    "quaternion_from_euler",
    "simulate",
    "superposed",
    "sweep",
    "trim",
]
