"""Fly any aerodynamic database; simulate flights with a controller, instruments and logs.

`flight_model` makes a `FlightModel` of a database, `simulate` flies it over given inputs (engine;
layout, kernel and integration are its compiled part). `trim` finds the steady flight at a
`Condition`, `linear_model` the `LinearModel` about it, `modes` its modes, and `sweep` all of these
along one variable. `planning` designs manoeuvres and the steps of an envelope expansion. `flown_of`
makes of a vehicle file and a database what flies: masses at a fuel state, propulsion, limits and
the model (flown_vehicle). Flights with a controller and logs:

1. `control_derivatives` gives the coefficients' derivatives for which an `Autopilot` is designed
   (autopilot); `superposed` adds test inputs, each an `Event`, to its commands (inputs).
2. `fly` flies many flights of a `FlownVehicle` at once in closed loop, with wind and turbulence
   (`aerodb.physics.DrydenGusts`), and returns their true channels as a `History` (closed_loop).
3. `at_instruments` converts the channels to the positions of the instruments; `measure` samples
   them with delay, bias and noise into log topics, as each `Instrument` and its `SensorSignal`
   states (sensors).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .autopilot import Autopilot, ControlDerivatives, control_derivatives
    from .closed_loop import History, fly
    from .condition import Condition
    from .engine import (
        Actuator,
        FlightModel,
        Propulsion,
        Simulation,
        flight_model,
        simulate,
        with_feedback,
    )
    from .flown_vehicle import (
        MASS_PROPERTIES,
        FlownVehicle,
        flown_of,
        stretch_model,
        surface_limits,
    )
    from .ground import Standstill, standstill
    from .inputs import Event, superposed
    from .linear_model import LinearModel, linear_model
    from .manoeuvre import Manoeuvre, parse_manoeuvre
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
    from .replay import (
        RESPONSES,
        FlightStretch,
        bridged,
        fly_stretch,
        moved_controls,
        stretch_of,
        with_trim_offset,
    )
    from .sensors import Instrument, SensorSignal, at_instruments, measure
    from .stabilisation import fastest_growth, stabilising_feedback
    from .sweep import held_sweep, sweep
    from .tolerances import Tolerances, check_responses, parse_tolerances, response_agreement
    from .trim import NoTrimError, Trim, trim

__getattr__, __dir__, __all__ = attach(__name__, __file__)
