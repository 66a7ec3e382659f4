"""Every estimation method on the same flights, with answers in the same format.

The way through:

1. A model file declares increments on a version, or on `no_database`, which makes the increments
   whole derivatives. `axis_equations` states them as one `LinearEquation` per axis, for methods of
   equation error.
2. `METHODS` lists the methods by their names on the command line, each a `Method`.
3. `compare_methods` puts the answers beside each other (`MethodAgreement` per parameter) and says
   which to believe and why.
4. `with_fitted_estimates` makes the answer of a method a candidate database.

`equations` states the increments, `methods` lists the methods, `method_comparison` compares them,
`candidate` turns them into a database.

Of parameters of a database's legs (`ground_parameters`) only rolls on the ground tell: `ground_fit`
flies these from start to stop (`ground_roll`, `recorded_rolls`), in an unknown steady wind;
`likelihood_bounds` says what the rolls exclude where they determine no value. `updated_by_rolls`
makes the estimates a candidate; `roll_errors` and `validated_rolls` say what it leaves of rolls.
`seen_rolls` says how a roll slows down whose brakes are not known.

While a log is being written, `OnlineEstimation` gives the estimates so far by recursive methods
(`online`).

A file may declare a linear model of the flights' channels instead (`parse_state_space`,
`state_space_fit`: model_file), with steady values from what was recorded (`with_recorded_trim`);
methods of equation error take its rows as equations (`state_equations`). `fitted_modes` gives the
modes of what was found.

Beside it: `flight_dynamics` makes the equations of motion on a database a `FlightDynamics` model
with unknown parameters. `conversion` turns dimensional derivatives of linear models
(`matrix_derivatives`) into coefficients and back, with covariance (`coefficient_derivatives`,
`dimensional_derivatives`); `parse_derivative_file` and `converted` do so for a file. Such
derivatives tell of tails by single equations (`tails_of`), or of a database's parameters by its own
linear model (`back_out`).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .back_out import BackedOut, back_out, of_motion
    from .candidate import update_by
    from .conversion import Derivatives, LinearisedFlight, matrix_derivatives
    from .declared_terms import with_known_terms, with_terms
    from .derivative_file import DerivativeFile, converted, parse_derivative_file, tails_of
    from .equations import no_database, no_database_beside, parameter_name
    from .fitted_modes import fitted_modes
    from .flight_dynamics import FlightDynamics, flight_dynamics
    from .ground_records import (
        RolledFlight,
        Rolls,
        bounded_roll_fit,
        ground_fit,
        ground_rolls,
        recorded_rolls,
        roll_fit,
    )
    from .ground_roll import ground_parameters, leg_parameters
    from .identification_flight import IdentificationFlight, within
    from .method_comparison import MethodAgreement, compare_methods
    from .methods import METHODS, REGRESSION, Method, chosen_methods
    from .model_file import (
        declares_state_space,
        file_records,
        flight_records,
        parse_state_space,
        state_space_fit,
    )
    from .online import ONLINE_METHODS, OnlineEstimation, OnlineSettings
    from .problem import fits_of
    from .recorded_trim import with_recorded_trim
    from .roll_errors import RollError, flown_to_stop, roll_errors, validated_rolls
    from .roll_update import RollUpdate, updated_by_rolls, with_fitted_legs
    from .seen_rolls import Phase, SeenRoll, seen_rolls
    from .wake_encounter import WakeEncounter, identify_wake

__getattr__, __dir__, __all__ = attach(__name__, __file__)
