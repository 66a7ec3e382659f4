"""Fly any aerodynamic database; simulate flights with a controller, instruments and logs.

`flight_model` makes a `FlightModel` of a database, `simulate` flies it over given inputs (engine;
layout, kernel and integration are its compiled part). `trim` finds the steady flight at a
`Condition`, `linear_model` the `LinearModel` about it, `modes` its modes, and `sweep` all of these
along one variable. `planning` designs manoeuvres and the steps of an envelope expansion. `flown_of`
makes of a vehicle file and a database what flies: masses at a fuel state, propulsion, limits and
the model (flown_vehicle). Flights with a controller and logs:

1. `control_derivatives` gives the coefficients' derivatives for which an `Autopilot` is designed
   (autopilot); `superposed` adds test inputs, each an `Event`, to its commands (inputs).
2. `fly` flies many flights of a `FlownVehicle` at once in closed loop, with wind and `DrydenGusts`
   (turbulence), and returns their true channels as a `History` (closed_loop).
3. `at_instruments` converts the channels to the positions of the instruments; `measure` samples
   them with delay, bias and noise into log topics, as each `Instrument` and its `Signal` states
   (sensors).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
