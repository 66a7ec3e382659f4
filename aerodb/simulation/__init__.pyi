from .autopilot import Autopilot, ControlDerivatives, control_derivatives
from .closed_loop import History, fly
from .engine import (
    Actuator,
    FlightModel,
    Propulsion,
    Simulation,
    flight_model,
    simulate,
    with_feedback,
)
from .flown_vehicle import FlownVehicle, flown_of, stretch_model, surface_limits
from .inputs import Event, superposed
from .linear_model import LinearModel, linear_model
from .manoeuvre import Manoeuvre, Wave, parse_manoeuvre
from .modes import Mode, modes
from .oscillation import Oscillation, at_rest_from, oscillation
from .planning import (
    DesignedManoeuvre,
    Expansion,
    Growth,
    Margins,
    design_manoeuvre,
    expand_envelope,
    expected_noise,
    manoeuvre_text,
)
from .replay import RESPONSES, Stretch, fly_stretch, moved_controls, stretch_of, with_trim_offset
from .sensors import Instrument, Signal, at_instruments, measure
from .stabilisation import stabilising_feedback
from .sweep import HeldSweep, SweepPoint, held_sweep, sweep
from .tolerances import (
    CheckResult,
    Response,
    Tolerances,
    check_responses,
    parse_tolerances,
    response_agreement,
)
from .trim import NoTrimError, Trim, trim
from .trim_problem import Condition, control_inputs
from .turbulence import DrydenGusts

__all__ = [
    "RESPONSES",
    "Actuator",
    "Autopilot",
    "CheckResult",
    "Condition",
    "ControlDerivatives",
    "DesignedManoeuvre",
    "DrydenGusts",
    "Event",
    "Expansion",
    "FlightModel",
    "FlownVehicle",
    "Growth",
    "HeldSweep",
    "History",
    "Instrument",
    "LinearModel",
    "Manoeuvre",
    "Margins",
    "Mode",
    "NoTrimError",
    "Oscillation",
    "Propulsion",
    "Response",
    "Signal",
    "Simulation",
    "Stretch",
    "SweepPoint",
    "Tolerances",
    "Trim",
    "Wave",
    "at_instruments",
    "at_rest_from",
    "check_responses",
    "control_derivatives",
    "control_inputs",
    "design_manoeuvre",
    "expand_envelope",
    "expected_noise",
    "flight_model",
    "flown_of",
    "fly",
    "fly_stretch",
    "held_sweep",
    "linear_model",
    "manoeuvre_text",
    "measure",
    "modes",
    "moved_controls",
    "oscillation",
    "parse_manoeuvre",
    "parse_tolerances",
    "response_agreement",
    "simulate",
    "stabilising_feedback",
    "stretch_model",
    "stretch_of",
    "superposed",
    "surface_limits",
    "sweep",
    "trim",
    "with_feedback",
    "with_trim_offset",
]
