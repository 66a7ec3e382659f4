"""Parameters of a database as unknowns of an equation that all axes share.

A parameter acts on several axes through several expressions, and not always linearly. So the
equation is linear about the present values and is solved again until they stay (Gauss-Newton); each
axis of each stretch of flight is a record of it, in units of the error that is left there.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.estimation import EquationRecord, Fit, LinearEquation, Parameter, Parameters
from aerodb.identification.equations import usable_runs
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.increments import check_parameters_of, parameter_samples
from aerodb.tables import AeroDatabase, parameter_inside, sigma_of, with_parameters

#: The search ends when no value moves by more than this part of its standard error,
_SETTLED: Final = 0.05
#: or after so many solutions.
_MOST: Final = 8


def unknown(name: str, database: AeroDatabase) -> Parameter:
    """A parameter of a database as an unknown: from its value, within its bounds, with its prior
    where no flight has estimated it yet. In its own unit."""
    variable, value = database.variables[name], database.parameters[name]
    known, sigma = variable.parameter, sigma_of(variable.uncertainty)
    low, high = (-np.inf, np.inf) if known is None else known.bounds
    prior = None if sigma is None or (known is not None and known.flights) else value
    return Parameter(
        name, value, variable.unit, lower=low, upper=high, prior=prior,
        prior_error=None if prior is None else sigma,
    )  # fmt: skip


def fit_parameters(
    function: Callable[[LinearEquation], Fit],
    flights: Sequence[IdentificationFlight],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool = True,
) -> Fit:
    """Return the fit of some parameters of a database by a method of equation error.

    Each stretch counts about its mean on each axis that the parameters reach: the rest is what
    biased sensors may leave; not so without `own_constants`. Raises InputError for an unknown
    parameter, and for one that no flight moves.
    """
    check_parameters_of(names, database)
    present, fit = database, None
    for round_ in range(1, _MOST + 1):
        fit = replace(
            function(_equation(flights, names, present, database, own_constants)), iterations=round_
        )
        estimates = {e.name: e for e in fit.estimates if e.name in names and np.isfinite(e.value)}
        moved = [
            abs(e.value - present.parameters[name]) / (e.standard_error or np.inf)
            for name, e in estimates.items()
        ]
        present = with_parameters(present, within_bounds(fit, database))
        if max(moved, default=0.0) <= _SETTLED:
            return fit
    assert fit is not None
    return replace(
        fit,
        converged=False,
        notes=(*fit.notes, f"The values still move after {_MOST} solutions: start nearer."),
    )


def within_bounds(fit: Fit, database: AeroDatabase) -> dict[str, float]:
    """Return the estimates of a fit that are of parameters of a database, inside their bounds, in
    their units."""
    return {
        each.name: parameter_inside(database, each.name, each.value)
        for each in fit.estimates
        if each.name in database.parameters and np.isfinite(each.value)
    }


def _equation(
    flights: Sequence[IdentificationFlight],
    names: Sequence[str],
    present: AeroDatabase,
    database: AeroDatabase,
    own_constants: bool,
) -> LinearEquation:
    """The equation about the present values; bounds and priors are those of `database`."""
    values = np.array([present.parameters[name] for name in names])
    records = []
    comparisons = [flight.comparison for flight in flights]
    for each in parameter_samples(comparisons, names, present, own_constants):
        time, flight = each.comparison.time, each.comparison.flight
        for count, run in enumerate(usable_runs(each.good, time)):
            x, left = each.over(run)
            name = f"{flight}#{count + 1} {each.axis}"
            records.append(EquationRecord(name, time[run], x, left + x @ values))
    items = tuple(unknown(name, database) for name in names)
    return LinearEquation("coefficients", Parameters(items), tuple(records))
