"""Parameters of a database as unknowns of an equation that all axes share.

A parameter acts on several axes through several expressions, and not always linearly. So the
equation is linear about the present values and is solved again until they stay (Gauss-Newton); each
axis of each stretch of flight is a record of it, in units of the error that is left there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison, compare
from aerodb.errors import InputError, nearest
from aerodb.estimation import EquationRecord, Fit, LinearEquation, Parameter, Parameters
from aerodb.identification.equations import usable_runs
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.nomenclature import AXES
from aerodb.signals import rms
from aerodb.support import Array, in_threads
from aerodb.tables import AeroDatabase, ends_about, parameter_inside, sigma_of, with_parameters

#: Variation, as a part of the largest value, below which a column is a constant.
_STILL: Final = 1e-9
#: The search ends when no value moves by more than this part of its standard error,
_SETTLED: Final = 0.05
#: or after so many solutions.
_MOST: Final = 8


def check_parameters_of(names: Sequence[str], database: AeroDatabase) -> None:
    """Raise InputError, with the nearest known one, for a name that is no parameter of a
    database."""
    for name in names:
        if name not in database.parameters:
            raise InputError(
                f"the database has no parameter '{name}'",
                f"database {database.name}",
                nearest(name, database.parameters)
                if database.parameters
                else "write [parameters] in the database file, and import it",
            )


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
) -> Fit:
    """Return the fit of some parameters of a database by a method of equation error.

    Each stretch counts about its mean on each axis that the parameters reach: the rest is what
    biased sensors may leave. Raises InputError for an unknown parameter, and for one that no flight
    moves.
    """
    check_parameters_of(names, database)
    present, fit = database, None
    for round_ in range(1, _MOST + 1):
        fit = replace(function(_equation(flights, names, present, database)), iterations=round_)
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
) -> LinearEquation:
    """The equation about the present values; bounds and priors are those of `database`."""
    values = np.array([present.parameters[name] for name in names])
    compared, columns = _with_columns(flights, names, present)
    axes = [axis for axis in AXES if any(axis in each for each in columns)]
    size = {axis: _left(compared, axis) for axis in axes}
    records, moved = [], np.zeros(len(names), dtype=np.bool_)
    for each, slopes in zip(compared, columns, strict=True):
        for axis, matrix in slopes.items():
            for count, run in enumerate(usable_runs(each.usable[axis], each.time)):
                x = (matrix[run] - matrix[run].mean(axis=0)) / size[axis]
                moved |= np.ptp(matrix[run], axis=0) > _STILL * np.abs(matrix[run]).max(axis=0)
                left = each.residual(axis)[run]
                response = (left - left.mean()) / size[axis] + x @ values
                name = f"{each.flight}#{count + 1} {axis}"
                records.append(EquationRecord(name, each.time[run], x, response))
    still = [name for name, each in zip(names, moved, strict=True) if not each]
    if still:
        raise InputError(
            f"in these flights {', '.join(still)} changes nothing, or only a constant",
            "estimate",
            "fly what they act on, or leave them out: a constant is taken for a sensor's bias",
        )
    items = tuple(unknown(name, database) for name in names)
    return LinearEquation("coefficients", Parameters(items), tuple(records))


def _with_columns(
    flights: Sequence[IdentificationFlight], names: Sequence[str], present: AeroDatabase
) -> tuple[list[Comparison], list[dict[str, Array]]]:
    """The comparisons of the flights with a database, and per flight axis -> slopes (n, k) of what
    is predicted there by the parameters, on the axes that they reach."""

    def beside(values: Mapping[str, float]) -> list[Comparison]:
        other = with_parameters(present, values)
        return in_threads(
            lambda each: compare(each.flight, each.coefficients, other, each.vehicle.reference),
            flights,
        )

    now = beside({})
    columns: list[dict[str, Array]] = [{} for _ in flights]
    for k, name in enumerate(names):
        ends = ends_about(present, name)
        below, above = (beside({name: end}) for end in ends)
        for slopes, first, last in zip(columns, below, above, strict=True):
            for axis in AXES:
                if axis not in first.usable or not first.usable[axis].any():
                    continue
                slope = (last.predicted[axis] - first.predicted[axis]) / (ends[1] - ends[0])
                if np.any(slope[first.usable[axis]] != 0.0):
                    matrix = slopes.setdefault(axis, np.zeros((len(slope), len(names))))
                    matrix[:, k] = np.where(first.usable[axis], slope, 0.0)
    return now, columns


def _left(compared: Sequence[Comparison], axis: str) -> float:
    """The error about the mean of each flight that is left on an axis, rms over all."""
    parts = [each.residual(axis)[each.usable[axis]] for each in compared if axis in each.usable]
    return rms(np.concatenate([part - part.mean() for part in parts if len(part)])) or 1.0
