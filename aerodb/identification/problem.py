"""A method's fits over all declared increments."""

from collections.abc import Sequence

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification.database_parameters import fit_parameters
from aerodb.identification.equations import axis_equations
from aerodb.identification.flown import DISTURBED, flown_problem, with_names
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.identification.methods import Method
from aerodb.increments import ModelFile
from aerodb.tables import AeroDatabase


def fits_of(
    method: Method,
    flights: Sequence[IdentificationFlight],
    model: ModelFile,
    database: AeroDatabase,
) -> list[Fit]:
    """Return the fits of a method over all declared increments: one per axis of equation error, or
    one of the flights flown.

    Raises InputError where the method cannot give any. Values are in the unit of each parameter,
    covariance (k, k).
    """
    function = method.load()
    if method.kind == "dynamic":
        dynamics, records, named = flown_problem(flights, model, database)
        shown = [state for state in DISTURBED if state in dynamics.outputs]
        options = {"process_noise": shown} if method.disturbed else {}
        return [with_names(function(dynamics, records, **options), named)]
    if model.inertias:
        raise InputError(
            f"{method.name} estimates no {', '.join(model.inertias)}: it takes the vehicle's",
            "model file",
            "use a method that flies, such as nonlinear-refinement",
        )
    if model.parameters:
        if model.increment:
            raise InputError(
                f"{method.name} estimates increments or parameters, not both at once",
                "model file",
                "use output-error, or two model files",
            )
        return [fit_parameters(function, flights, model.parameters, database, model.own_constants)]
    equations = axis_equations(
        [f.flight for f in flights], [f.comparison for f in flights], model, database
    )
    return [function(equation) for equation in equations]
