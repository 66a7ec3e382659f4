"""Parameters of a database as unknowns of an equation that all axes share.

A parameter acts on several axes through several expressions, and not always linearly. So the
equation is linear about the present values and is solved again until they stay (Gauss-Newton); each
axis of each stretch of flight is a record of it, in units of the error that is left there.

The bounds of a parameter are something known beforehand: between them, all values are as likely. A
flight that leaves a standard error as wide tells nothing of the parameter, which then has no value.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.coefficients import thinned_comparison
from aerodb.errors import InputError
from aerodb.estimation import (
    AxisError,
    EquationRecord,
    Fit,
    LinearEquation,
    Parameter,
    Parameters,
    Standing,
)
from aerodb.identification.equations import SHORTEST, usable_runs
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.increments import (
    ParameterSamples,
    air_covariance,
    between_bounds,
    check_parameters_of,
    moved_by_noise_alone,
    parameter_samples,
    start_of_search,
    tells_nothing,
)
from aerodb.nomenclature import AXES
from aerodb.signals import rms
from aerodb.support import Array
from aerodb.tables import AeroDatabase, parameter_inside, sigma_of, with_parameters

#: The search ends when no value moves by more than this part of its standard error,
_SETTLED: Final = 0.05
#: or after so many solutions.
_MOST: Final = 8
#: Correlation with another estimate that is named as what takes a parameter's place.
_TAKES_PLACE: Final = 0.5

_ONLY_NOISE: Final[tuple[Standing, str]] = (
    "not excited",
    "most of what moves it is noise of the logged deflections; fly what it acts on or leave it out",
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
    own_constants: bool = True,
) -> Fit:
    """Return the fit of some parameters of a database by a method of equation error.

    Each stretch counts about its mean on each axis that the parameters reach: the rest is what
    biased sensors may leave; not so without `own_constants`. Long flights are thinned to the rate
    that their band needs (`thinned_comparison`). Raises InputError for an unknown
    parameter, and where no stretch is long enough.
    """
    fit = _told(function, flights, names, database, own_constants)
    return replace(fit, reservations=beside_theory(fit, database))


def beside_theory(fit: Fit, database: AeroDatabase) -> tuple[str, ...]:
    """Return a sentence for each estimate of a fit whose interval of 95 % does not hold what theory
    has for its parameter of the database, in its unit."""
    found = []
    for each in fit.estimates:
        variable = database.variables.get(each.name)
        known = None if variable is None else variable.parameter
        if known is None or known.theory is None or not each.standard_error > 0.0:
            continue
        low, high = fit.interval(each.name)
        if not low <= known.theory <= high:
            found.append(
                f"{each.name} is {low:.3g} to {high:.3g} (95 %), and theory has {known.theory:.3g}:"
                " a good fit does not prove the name"
            )
    return tuple(found)


def _told(
    function: Callable[[LinearEquation], Fit],
    flights: Sequence[IdentificationFlight],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool,
) -> Fit:
    """The fit, in which what the flights tell less of than the bounds has no value."""
    check_parameters_of(names, database)
    whole = flights  # noise of deflections is told by their full rate
    flights = [replace(f, comparison=thinned_comparison(f.comparison)) for f in flights]
    fit = _settled(function, flights, names, database, own_constants, {})
    untold, noisy = _untold(fit, database), _noisy(fit, whole, database, own_constants)
    untold |= {name: error for name, error in noisy.items() if name not in untold}
    if not untold:
        return fit
    known = {name: (database.parameters[name], between_bounds(database, name)) for name in untold}
    again = _settled(function, flights, names, database, own_constants, known)
    equation, _ = _equation(flights, names, database, database, own_constants)
    reasons = _reasons(fit, untold, equation, database) | dict.fromkeys(noisy, _ONLY_NOISE)
    return replace(
        again,
        estimates=tuple(
            replace(
                each, value=np.nan, standard_error=np.nan, standing=reasons[each.name][0],
                reason=reasons[each.name][1], cramer_rao=np.nan,
            )
            if each.name in reasons
            else each
            for each in again.estimates
        ),
    )  # fmt: skip


def _untold(fit: Fit, database: AeroDatabase) -> dict[str, float]:
    """Parameter of the database -> its standard error, of which a fit tells less than its bounds
    do."""
    return {
        each.name: each.standard_error
        for each in fit.estimates
        if each.name in database.parameters
        and each.standing in ("estimated", "at bound")
        and tells_nothing(database, each.name, each.standard_error)
    }


def _noisy(
    fit: Fit,
    flights: Sequence[IdentificationFlight],
    database: AeroDatabase,
    own_constants: bool,
) -> dict[str, float]:
    """Parameter of the database -> its standard error, where an estimate is at a bound or no larger
    than its interval, and the flights move the parameter by noise of deflections alone."""
    errors = {
        each.name: each.standard_error
        for each in fit.estimates
        if each.name in database.parameters
        and (
            each.standing == "at bound"
            or (each.standing == "estimated" and 2.0 * each.standard_error > abs(each.value))
        )
    }
    comparisons = [flight.comparison for flight in flights]
    return {
        n: errors[n] for n in moved_by_noise_alone(comparisons, [*errors], database, own_constants)
    }


def _reasons(
    fit: Fit, untold: Mapping[str, float], equation: LinearEquation, database: AeroDatabase
) -> dict[str, tuple[Standing, str]]:
    """Parameter -> its standing and why: whether its own columns are too small, or others take
    its place."""
    x = equation.stacked()[0]
    size = np.maximum(np.sqrt(np.square(x).sum(axis=0)), 1e-300)
    inverse = np.diag(np.linalg.pinv(x.T @ x / np.outer(size, size), hermitian=True))
    shares = 1.0 / np.sqrt(np.maximum(inverse, 1.0))
    alone = dict(zip(equation.parameters.names, shares, strict=True))
    found: dict[str, tuple[Standing, str]] = {}
    for name, error in untold.items():
        item, row = equation.parameters[name], fit.correlation[fit.names.index(name)]
        width = (
            f"its standard error would be {error:.2g}, and its bounds are"
            f" {item.upper - item.lower:.4g} apart"
        )
        others = [
            other
            for other, value in zip(fit.names, row, strict=True)
            if other != name and abs(value) > _TAKES_PLACE
        ]
        if tells_nothing(database, name, error * float(alone[name])) or not others:
            found[name] = (
                "not excited",
                f"what it acts on hardly moves: {width}; fly what it acts on, or leave it out",
            )
        else:
            found[name] = (
                "not identifiable",
                f"not separately observable from {', '.join(others)}: {width}; fix one of them, or"
                " fly a manoeuvre that separates them",
            )
    return found


@dataclass(frozen=True, eq=False)
class _Scale:
    """Axis of a record, what it was divided by, what was measured (n,), and of which samples it is
    which run."""

    axis: str
    size: float
    flown: Array
    samples: ParameterSamples
    run: slice


def _settled(
    function: Callable[[LinearEquation], Fit],
    flights: Sequence[IdentificationFlight],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool,
    known: Mapping[str, tuple[float, float]],
) -> Fit:
    """The fit whose values stay. known : parameter -> value and standard deviation, beforehand."""
    present, fit = (
        start_of_search(
            [flight.comparison for flight in flights], names, database, own_constants, known, _runs
        ),
        None,
    )
    for round_ in range(1, _MOST + 1):
        equation, scales = _equation(flights, names, present, database, own_constants, known)
        fit = replace(function(equation), iterations=round_)
        fit = replace(fit, **_told_of_axes(fit, equation, scales, present))
        estimates = {e.name: e for e in fit.estimates if e.name in names and np.isfinite(e.value)}
        moved = [
            abs(e.value - present.parameters[name]) / (e.standard_error or np.inf)
            for name, e in estimates.items()
        ]
        present = with_parameters(present, within_bounds(fit, database))
        if max(moved, default=0.0) <= _SETTLED:
            break
    else:
        assert fit is not None
        late = f"The values still move after {_MOST} solutions: start nearer."
        fit = replace(fit, converged=False, notes=(*fit.notes, late))
    return _with_air(fit, scales, names, present)


def _with_air(
    fit: Fit, scales: Sequence[_Scale], names: Sequence[str], present: AeroDatabase
) -> Fit:
    """The fit, whose covariance holds what air does that no sensor measures."""
    doubt = air_covariance([(each.samples, each.run) for each in scales], present)
    if not doubt.any():
        return fit
    places = [names.index(name) for name in fit.names if name in names]
    rows = [k for k, name in enumerate(fit.names) if name in names]
    covariance = fit.covariance.copy()
    covariance[np.ix_(rows, rows)] += doubt[np.ix_(places, places)]
    errors = dict(zip(fit.names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    estimates = tuple(
        replace(each, standard_error=errors[each.name])
        if each.name in errors and np.isfinite(each.standard_error)
        else each
        for each in fit.estimates
    )
    told = "Standard errors include air that no sensor measures: the flow is that over the ground."
    return replace(fit, covariance=covariance, estimates=estimates, assumes=(*fit.assumes, told))


def _told_of_axes(
    fit: Fit, equation: LinearEquation, scales: Sequence[_Scale], present: AeroDatabase
) -> dict[str, Any]:
    """What the fit leaves on each axis, and correlations of the columns of its parameters: fields
    of a `Fit`. Columns are those of all forces, which have one unit, or of moments alone."""
    names = equation.parameters.names
    values = np.array([fit[name].value for name in names])
    values = np.where(
        np.isfinite(values), values, [present.parameters.get(name, 0.0) for name in names]
    )
    left, flown = (dict[str, list[Array]]() for _ in range(2))
    for record, scale in zip(equation.records, scales, strict=True):
        error = scale.size * (record.response - record.regressors @ values)
        left.setdefault(scale.axis, []).append(error)
        flown.setdefault(scale.axis, []).append(scale.flown)
    reference = present.reference
    loads = np.full(len(AXES), np.nan)
    if reference.pressure is not None:
        lengths = np.array([1.0, 1.0, 1.0, reference.span, reference.chord, reference.span])
        loads = reference.pressure * reference.area * lengths
    axes = {}
    for axis, load in zip(AXES, loads, strict=True):
        if axis in left:
            error = rms(np.concatenate(left[axis]))
            axes[axis] = AxisError(error, float(np.std(np.concatenate(flown[axis]))), error * load)
    of_forces = [
        scale.size * record.regressors
        for record, scale in zip(equation.records, scales, strict=True)
        if scale.axis in AXES[:3] or not left.keys() & set(AXES[:3])
    ]
    columns = np.concatenate(of_forces)[:, [names.index(name) for name in fit.names]]
    with np.errstate(divide="ignore", invalid="ignore"):
        return {"axes": axes, "regressors": np.atleast_2d(np.corrcoef(columns.T))}


def _runs(samples: ParameterSamples) -> Sequence[slice]:
    """Stretches of samples that are records of the equation."""
    return usable_runs(samples.good, samples.comparison.time)


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
    known: Mapping[str, tuple[float, float]] = {},
) -> tuple[LinearEquation, list[_Scale]]:
    """The equation about the present values, and the scale of each record; bounds and priors are
    those of `database`, and what is `known` beside them (value, standard deviation)."""
    values = np.array([present.parameters[name] for name in names])
    records, scales = [], []
    comparisons = [flight.comparison for flight in flights]
    for each in parameter_samples(comparisons, names, present, own_constants):
        time, flight = each.comparison.time, each.comparison.flight
        for count, run in enumerate(_runs(each)):
            x, left = each.over(run)
            name = f"{flight}#{count + 1} {each.axis}"
            records.append(EquationRecord(name, time[run], x, left + x @ values))
            flown = each.comparison.measured[each.axis][run]
            flown = flown - each.centred * flown.mean()
            scales.append(_Scale(each.axis, each.size, flown, each, run))
    if not records:
        raise InputError(
            f"no flight gives {SHORTEST:g} s of usable samples in a row on an axis that the"
            " parameters reach",
            "estimate",
            "see what is flagged: aerodb flight show FLIGHT -v",
        )
    items = [unknown(name, database) for name in names]
    items = [
        replace(each, prior=known[each.name][0], prior_error=known[each.name][1])
        if each.name in known
        else each
        for each in items
    ]
    return LinearEquation("coefficients", Parameters(tuple(items)), tuple(records)), scales
