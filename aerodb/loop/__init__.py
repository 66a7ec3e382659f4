"""The closed loop: trace the residuals of flights, add what is found, and validate the candidate.

The way through, with flights from any `FlightSource` (a store, or memory):

1. `freeze_library(source, flights, baseline)` fixes the hypotheses and settings before any residual
   is read; it returns a `Library` with its hash.
2. `run_loop(source, flights, baseline, library, Accept())` traces, adds what is found, and repeats
   until nothing more is found; it returns a `LoopResult` with the candidate, all findings and those
   that were added (`loop.added`, each with a sentence `because`).
3. `validate_loop(source, hold_out, library, loop, Accept())` gives the error before and after on
   flights, or parts of flights, that did not identify, and `noise_floors` what the true model would
   leave. `without_gain(loop, validation)` names what was added and lowers none of these errors,
   `beside_larger_unnamed` what was added beside more that has no name; `run_loop` again leaves them
   out.
4. `unexplained_residuals(source, flights, loop.candidate, library)` reports, per axis, what is
   still predictable and named by no hypothesis, `unexplained_levels` large constants,
   `dependences_between_flights` which effects change with the conditions of the flights.
5. `with_model_error(source, flights, loop, library)` gives the candidate with bands that contain
   what the shapes of the additions miss.
6. `estimate_declared` and `validate_declared` are an update by declared increments;
   `consider_parameters` and `noisier_flights` give the sensor errors that the reconstruction leaves
   open, for declared increments; `sensor_rivals` the errors of sensors that the loop finds where
   they are declared.

7. `search_rolls` is the loop of rolls on the ground: which parameters of the legs they contradict,
   beside the drag of the air (`with_air_drag`).

Modules: `flight_source` (what a source of flights gives) and `without_store`, `freezing` and
`frozen_library`, `accept` (what a user admits), `evidence` (of one flight and a database), `rounds`
and what it says in `remarks`, `adding` to a database, `constant_lift` and `turned_slopes` (what
turns with the angle of attack), `manoeuvre_units` (too few flights), `stall`, `stall_windows` and
`stall_hysteresis`, `refit` (gains and shapes once more), `validation`, `within_flight` and
`noise_floor`, `unexplained`, `levels`, `between_flights`, `shapes` and `model_error`, `consider`
and `angle_errors`, `rivals`. The method:
docs/method/tracing.md, sections 13 to 16, 25 and 26.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .accept import ALL, Accept
    from .angle_errors import with_attenuation
    from .between_flights import dependences_between_flights
    from .consider import consider_parameters, noisier_flights
    from .declared import ByMethod, estimate_declared, outside_envelopes, validate_declared
    from .evidence import evidence_beside, normal_equations_beside
    from .flight_source import FlightSource, ReconstructionErrors
    from .freezing import freeze_library
    from .frozen_library import Library
    from .levels import LevelRival, UnexplainedLevel, unexplained_levels
    from .model_error import with_model_error
    from .noise_floor import noise_floor_of, noise_floors_of
    from .rivals import SensorRival, sensor_rivals
    from .roll_search import RollSearch, search_rolls, with_air_drag, without_added
    from .rounds import LoopResult, run_loop
    from .stall_windows import StallWindow, stall_windows
    from .unexplained import unexplained_residuals
    from .validation import beside_larger_unnamed, until_all_gain, validate_loop, without_gain
    from .without_store import WithoutStore

__getattr__, __dir__, __all__ = attach(__name__, __file__)
