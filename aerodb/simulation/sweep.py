"""Sweeps: one variable varied while the rest of the flight stays in trim."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from aerodb.errors import InputError, nearest
from aerodb.simulation.engine import FlightModel
from aerodb.simulation.layout import SURROUNDINGS
from aerodb.simulation.linear_model import linear_model
from aerodb.simulation.modes import Mode, modes
from aerodb.simulation.trim import Condition, NoTrimError, Trim, trim

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
