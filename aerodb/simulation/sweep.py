"""Sweeps: one variable varied while the flight is trimmed anew, or while the rest is held as
trimmed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.nomenclature import AXES
from aerodb.simulation.condition import Condition
from aerodb.simulation.engine import FlightModel, simulate
from aerodb.simulation.layout import SURROUNDINGS
from aerodb.simulation.linear_model import linear_model
from aerodb.simulation.modes import Mode, modes
from aerodb.simulation.parameter_covariance import parameter_covariance
from aerodb.simulation.trim import NoTrimError, Trim, differences, trim, varied
from aerodb.support import Array

_CONDITION = frozenset(field.name for field in fields(Condition)) - {"pull_up"}


@dataclass(frozen=True, eq=False)
class SweepPoint:
    """A point of a sweep: its trim and modes, or why there is no trim."""

    value: float
    trim: Trim | None
    modes: tuple[Mode, ...]
    reason: str = ""


def sweep(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    variable: str,
    values: Sequence[float],
    **options: Any,
) -> tuple[SweepPoint, ...]:
    """Trim at each value of one variable, and return the points with their modes.

    Parameters
    ----------
    model, condition, inputs : as of `trim`.
    variable : of the condition (V, altitude, climb, bank, beta, turn_rate, load_factor), a mass
        property or another of the surroundings, or an input of the database, which then is no
        control.
    values : [SI].
    options : further ones of `trim`.

    Raises InputError for an unknown variable.
    """
    known = {*_CONDITION, *SURROUNDINGS, *model.inputs}
    if variable not in known:
        raise InputError(
            f"no variable '{variable}' to sweep", model.database.name, nearest(variable, known)
        )
    points = []
    begin: Trim | None = None
    for value in map(float, values):
        changed: dict[str, Any] = {variable: value}
        at = replace(condition, **changed) if variable in _CONDITION else condition
        given = inputs if variable in _CONDITION else {**inputs, **changed}
        try:
            begin = trim(model, at, given, begin=begin, **options)
        except NoTrimError as error:
            points.append(SweepPoint(value, None, (), error.what))
            continue
        points.append(SweepPoint(value, begin, modes(linear_model(begin))))
    return tuple(points)


@dataclass(frozen=True, eq=False)
class HeldSweep:
    """Coefficients along one variable.

    Parameters
    ----------
    values : (n,) of the variable [SI].
    coefficients, standard_errors : CX CY CZ Cl Cm Cn about the database's moment reference -> (n,).
    left : tables that are left somewhere along the way.
    """

    values: Array
    coefficients: Mapping[str, Array]
    standard_errors: Mapping[str, Array]
    left: tuple[str, ...]


def held_sweep(found: Trim, variable: str, values: Sequence[float]) -> HeldSweep:
    """Return the coefficients along one variable, all others as in a trim: the sweep utility of
    "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
    Engineering Simulation", section VII.

    variable : V, altitude, alpha, beta, p, q, r, phi, theta, or an input [SI]. Raises InputError
    for another.
    """
    model = found.problem.model
    known = {*found.start, *model.inputs}
    if variable not in known:
        raise InputError(
            f"no variable '{variable}' to sweep", model.database.name, nearest(variable, known)
        )
    line = np.asarray(values, dtype=np.float64)
    steps, parameters = varied(model)
    sets = 1 + 2 * len(steps)
    lanes = np.tile(line, sets)
    every: dict[str, Any] = {
        name: np.repeat(np.concatenate([[model.parameters[name]], values]), len(line))
        for name, values in parameters.items()
    }
    start: dict[str, Any] = dict(found.start)
    series: dict[str, Any] = dict(found.series)
    if variable in start:
        start[variable] = lanes
    else:
        series[variable] = lanes[None, :]
    run = simulate(model, np.zeros(1), start, series, parameters=every)
    covariance = parameter_covariance(model)
    coefficients, errors = {}, {}
    for axis in AXES:
        rows = run.channels[axis][-1].reshape(sets, len(line))
        slopes = differences(rows[1:].T, steps)
        coefficients[axis] = rows[0]
        errors[axis] = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    return HeldSweep(line, coefficients, errors, tuple(sorted(run.left)))
