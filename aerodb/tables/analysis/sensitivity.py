"""Slopes of the model's coefficients with respect to one input along a flight.

A slope is taken over the range in which a sensor may be wrong, not at a point: a table's slope
jumps at every breakpoint, and the effect of a biased sensor on the prediction is the mean slope
over its error.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.linear_terms import depends_on
from aerodb.tables.database import AeroDatabase
from aerodb.tables.definitions import LIFT_INCREMENTS
from aerodb.tables.expression import Expression, Number, number
from aerodb.tables.increment import Increment
from aerodb.tables.loads import LOAD_AXES
from aerodb.tables.reference import HAT_RATES

#: Half the range over which a slope is taken, in the variable's unit: a quarter of a degree, of a
#: degree per second, ...
_STEPS: Mapping[str, float] = {
    "alpha": 0.0044,
    "beta": 0.0044,
    "p": 0.0044,
    "q": 0.0044,
    "r": 0.0044,
}
_SURFACE_STEP = 0.0044
_RELATIVE_STEP = 1e-4
_PARAMETER_STEP = 0.01  # of its value
_LIFT_STEP = 1e-3  # of C_lift: what depends on it is a polynomial of second order


def slopes_by(
    database: AeroDatabase, variable: str, channels: Mapping[str, Array]
) -> dict[str, Array]:
    """Body axis -> dC/d`variable` (n,) along `channels`, by central differences; empty where the
    model does not depend on it.

    Rates act through hat rates and literal factors alike; V acts through hat rates. States whose
    rate depends on the variable follow it: a slope is of steady states, as the error of a sensor
    is.

    Raises InputError naming channels that are missing.
    """
    part = _dependent(database, variable)
    if part is None or variable not in channels:
        return {}
    follow = _following(database, variable)
    base = {
        name: values
        for name, values in channels.items()
        if not (_made_of(name, variable) or name in follow)
    }
    x = channels[variable]
    half = step_of(variable, x)
    above = part.predict({**base, variable: x + half}).coefficients
    below = part.predict({**base, variable: x - half}).coefficients
    return {
        axis: (above[axis] - below[axis]) / (2.0 * half)
        for axis in above
        if np.any(above[axis] != below[axis])
    }


def slopes_by_parameter(
    database: AeroDatabase, parameter: str, channels: Mapping[str, Array]
) -> dict[str, Array]:
    """Body axis -> dC/d`parameter` (n,) along `channels`, per unit of the parameter, by central
    differences; empty where no term depends on it.

    Raises InputError naming channels that are missing.
    """
    sides = _sides(database, parameter)
    if sides is None:
        return {}
    ends = ends_about(database, parameter)
    below, above = (side.predict(channels).coefficients for side in sides)
    return {
        axis: (above[axis] - below[axis]) / (ends[1] - ends[0])
        for axis in above
        if np.any(above[axis] != below[axis])
    }


def with_own_states(
    database: AeroDatabase, time: Array, channels: Mapping[str, Array]
) -> Mapping[str, Array]:
    """Return channels (n,) [SI] of a flight at `time` (n,) [s], in which the states with a rate are
    those of this database, whatever parameters they were made with before."""
    if not database.rates:
        return channels
    given = {name: values for name, values in channels.items() if name not in database.rates}
    return {**given, **database.states_along(time, given)}


def slopes_along(
    database: AeroDatabase, parameter: str, time: Array, channels: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the answer of `slopes_by_parameter` along a flight at `time` (n,) [s], what states
    with a rate make of the parameter included: each end is integrated anew.

    Raises InputError naming channels that are missing.
    """
    laws = database.rates.values()
    if not any(parameter in depends_on(law.rate, database) for law in laws):
        return slopes_by_parameter(database, parameter, channels)
    ends = ends_about(database, parameter)
    sides = [with_parameters(database, {parameter: end}) for end in ends]
    below, above = (
        side.predict(with_own_states(side, time, channels)).coefficients for side in sides
    )
    return {
        axis: (above[axis] - below[axis]) / (ends[1] - ends[0])
        for axis in above
        if np.any(above[axis] != below[axis])
    }


@lru_cache(maxsize=64)  # a page asks along dozens of lines for the same parameters
def _sides(database: AeroDatabase, parameter: str) -> tuple[AeroDatabase, AeroDatabase] | None:
    """What of a database depends on a parameter, at both `ends_about` it; None if nothing does."""
    part = replace(
        database,
        terms=tuple(t for t in database.terms if parameter in depends_on(t.expression, database)),
        increments=database.increments if database.depends_on_lift_increments else (),
    )
    if not part.terms:
        return None
    below, above = (
        with_parameters(part, {parameter: end}) for end in ends_about(database, parameter)
    )
    return below, above


def ends_about(database: AeroDatabase, parameter: str) -> tuple[float, float]:
    """Return the values of a parameter below and above its own, inside its bounds and in its unit,
    between which a slope by it is taken."""
    value = database.parameters[parameter]
    half = _PARAMETER_STEP * max(abs(value), 0.01)
    return (
        parameter_inside(database, parameter, value - half),
        parameter_inside(database, parameter, value + half),
    )


def parameter_inside(database: AeroDatabase, parameter: str, value: float) -> float:
    """Return the value that is nearest to `value` inside the parameter's bounds, in its unit."""
    known = database.variables[parameter].parameter
    return value if known is None else float(np.clip(value, *known.bounds))


def with_parameters(database: AeroDatabase, values: Mapping[str, float]) -> AeroDatabase:
    """Return the database with other values of some of its parameters, each in its unit; what is
    known of them stays. Raises InputError for a value outside its bounds."""
    changed = {
        name: replace(database.variables[name], expression=number(float(value)))
        for name, value in values.items()
    }
    return replace(database, variables={**database.variables, **changed})


def slopes_by_lift(database: AeroDatabase, channels: Mapping[str, Array]) -> dict[str, Array]:
    """Body axis -> change of the coefficient (n,) per increment on C_lift: the lift itself on the
    body axes, and what depends on the total lift; empty where nothing does.

    Raises InputError naming channels that are missing.
    """
    part = _dependent(database, LIFT_INCREMENTS)
    if not database.depends_on_lift_increments or part is None:
        return {}
    above, below = (
        replace(part, increments=(*part.increments, _constant_lift(size)))
        .predict(channels)
        .coefficients
        for size in (_LIFT_STEP, -_LIFT_STEP)
    )
    return {axis: (above[axis] - below[axis]) / (2.0 * _LIFT_STEP) for axis in above}


def _constant_lift(size: float) -> Increment:
    return Increment("C_lift", (Number(1.0),), np.array([size]), np.zeros((1, 1)))


def step_of(variable: str, values: Array) -> float:
    """Half the range over which the slope by `variable` is taken.

    The unit is that of the variable.
    """
    if variable in _STEPS:
        return _STEPS[variable]
    if variable.startswith("delta_"):
        return _SURFACE_STEP
    return _RELATIVE_STEP * max(float(np.max(np.abs(values), initial=0.0)), 1e-6)


def uses(database: AeroDatabase, expression: Expression) -> frozenset[str]:
    """Return the channels on which the value of `expression` depends, through variables and hat
    rates too (rate [rad/s] and V [m/s], `HAT_RATES`)."""
    definitions = {name: variable.expression for name, variable in database.variables.items()}
    inputs = database.compiled(
        [expression], definitions, {**database.tables, **database.scattered}
    ).inputs
    names = frozenset(inputs)
    if LIFT_INCREMENTS in names:
        names = names.union(*(each.names for each in database.increments if each.axis == "C_lift"))
    return names.union(*({HAT_RATES[name][0], "V"} for name in names if name in HAT_RATES))


@lru_cache(maxsize=128)
def _dependent(database: AeroDatabase, variable: str) -> AeroDatabase | None:
    """The terms and increments whose value changes with `variable`; all of them where the wind axes
    themselves turn with it."""
    if database.on_wind_axes and variable in ("alpha", "beta"):
        return database
    changed = {variable, *_following(database, variable)}
    terms = tuple(
        term
        for term in database.terms
        if changed & uses(database, term.expression)
        or (variable == "qbar" and term.axis in LOAD_AXES)
    )
    increments = tuple(
        item
        for item in database.increments
        if changed & item.names
        or any(_made_of(name, variable) for name in item.names)
        or (item.axis == "C_lift" and database.depends_on_lift_increments)
    )
    return replace(database, terms=terms, increments=increments) if terms or increments else None


def _following(database: AeroDatabase, variable: str) -> frozenset[str]:
    """Names of the states whose rate depends on `variable`."""
    return frozenset(
        name for name, law in database.rates.items() if variable in uses(database, law.rate)
    )


def _made_of(hat: str, variable: str) -> bool:
    """Return whether `hat` is a rate without dimension that `variable` changes."""
    return hat in HAT_RATES and variable in (HAT_RATES[hat][0], "V")
