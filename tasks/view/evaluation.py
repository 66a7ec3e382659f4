"""Evaluate a version at a point or along a line: values, standard errors, and coverage."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Evaluation, Place, evaluate_database, unstated_inputs
from aerodb.tasks.references import point_of
from aerodb.tasks.workspace_access import database_from

#: Input that is taken to be something -> what that is, in words.
TAKEN: Final = {
    "height_above_ground": "outside ground effect",
    "V": "as loads need an airspeed: state your own",
    "rho": "which goes with what is stated, or is that of sea level",
    "qbar": "which goes with airspeed and density",
}
#: Largest number of points of a line through a database.
MOST_LINE_POINTS: Final = 2001


def evaluate_at(catalogue: Catalogue, version: VersionRow, at: str) -> dict[str, Any]:
    """Evaluate a version at the point ``NAME=VALUE,...`` (with units or in SI). Missing inputs are
    zero, a height above ground is outside ground effect (`unstated_inputs`).

    Returns a document: version, at, taken_as_zero, taken_as (input -> value), coefficients,
    standard_errors (None if not known), places, outside_tables, outside_of (names of the tables;
    edge values are held), outside_envelope (variables that lie outside the envelope of an
    increment) and extrapolated (axis -> the coefficient with the slopes of increments
    extrapolated there; None inside). Raises InputError for a name that is not an input and for a
    value that is not a number.
    """
    from aerodb.increments import with_extrapolated_slopes  # slow to import

    database = database_of(catalogue, version)
    point = _point(database, at)
    channels = {name: np.array([value]) for name, value in point.channels.items()}
    evaluation = evaluate_database(database, channels)
    outside = outside_envelope(database, channels)
    free = with_extrapolated_slopes(database).predict(channels).coefficients if outside else None
    return {
        "version": version.id,
        "at": point.given,
        "taken_as_zero": point.zero,
        "taken_as": point.taken,
        "coefficients": {axis: float(value[0]) for axis, value in evaluation.value.items()},
        "standard_errors": {
            axis: _known(float(error[0])) for axis, error in evaluation.standard_error.items()
        },
        "places": {axis: Place(int(code[0])).label for axis, code in evaluation.place.items()},
        "outside_tables": bool(evaluation.prediction.outside[0]),
        "outside_of": sorted(evaluation.prediction.outside_tables),
        "outside_envelope": outside,
        "extrapolated": free and {axis: float(value[0]) for axis, value in free.items()},
    }


def outside_envelope(database: AeroDatabase, channels: Mapping[str, Array]) -> list[str]:
    """Return the variables that lie outside the envelope of an increment that acts, sorted.

    channels : inputs (n,), SI.
    """
    acting = [increment for increment in database.increments if increment.acts_as_layer]
    names = frozenset[str]().union(*(increment.names for increment in acting))
    values = database.resolved(names, channels)
    return sorted(
        {
            name
            for increment in acting
            for name, interval in increment.envelope.items()
            if not np.all(interval.contains(values[name]))
        }
    )


def sweep(
    catalogue: Catalogue,
    version: VersionRow,
    over: str,
    reach: tuple[float, float],
    points: int,
    at: str,
) -> dict[str, Any]:
    """Evaluate a version along one of its inputs.

    over : the input. reach : from and to [SI]. at : the values of the other inputs, as in
    `evaluate_at`.

    Returns a document: version, over, at, taken_as_zero, taken_as, values (points,) [SI], axes
    (axis -> value, standard_error and place, each (points,); None if not known), faded_below and
    faded_above [SI]: the values beyond which no increment is left, or None. Raises InputError if
    `over` is not an input, or if the range or the number of points is invalid.
    """
    database = database_of(catalogue, version)
    if over not in database.inputs:
        raise InputError(
            f"'{over}' is not an input of {version.label}", "over", nearest(over, database.inputs)
        )
    if not 2 <= points <= MOST_LINE_POINTS:
        raise InputError(f"{points} points", "points", f"from 2 to {MOST_LINE_POINTS}")
    low, high = reach
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(
            f"from {low:g} to {high:g} is not an interval",
            "from, to",
            "give two numbers, the lower one first",
        )
    point = _point(database, at)
    line = np.linspace(low, high, points)
    evaluation = evaluate_database(
        database,
        {**{name: np.full(points, value) for name, value in point.channels.items()}, over: line},
    )
    axes = {
        axis: {
            "value": [_known(value) for value in evaluation.value[axis].tolist()],
            "standard_error": [_known(value) for value in evaluation.standard_error[axis].tolist()],
            "place": [Place(int(code)).label for code in evaluation.place[axis]],
        }
        for axis in database.axes
    }
    fixed = {name: value for name, value in point.given.items() if name != over}
    return {
        "version": version.id,
        "over": over,
        "at": fixed,
        "taken_as_zero": [name for name in point.zero if name != over],
        "taken_as": {name: value for name, value in point.taken.items() if name != over},
        "values": line.tolist(),
        "axes": axes,
        **_faded(line, evaluation),
    }


def _faded(line: Array, evaluation: Evaluation) -> dict[str, float | None]:
    """The values of a line (n,) below and above which no increment is left."""
    left = np.flatnonzero(np.any([*evaluation.weight.values(), np.zeros(len(line))], axis=0))
    first, last = (left[0], left[-1]) if len(left) else (0, len(line) - 1)
    return {
        "faded_below": float(line[first - 1]) if first > 0 else None,
        "faded_above": float(line[last + 1]) if last + 1 < len(line) else None,
    }


def database_of(catalogue: Catalogue, version: VersionRow) -> AeroDatabase:
    """Return the database of a version, in SI units; UnknownNameError for an unknown one. See
    `database_from`."""
    return database_from(catalogue.version_documents(version.id).content)


@dataclass(frozen=True)
class _Point:
    """A point of a database: its inputs as given, those left out that are zero, those that are
    taken to be another value, and the channels to evaluate."""

    given: dict[str, float]
    zero: list[str]
    taken: dict[str, float]
    channels: Mapping[str, float]


def _point(database: AeroDatabase, at: str) -> _Point:
    """Return the point that a text gives."""
    point = point_of(at, database.inputs)
    unstated = unstated_inputs(database, point)
    shown = TAKEN if database.has_loads else ("height_above_ground",)
    taken = {name: unstated[name] for name in unstated if name in shown}
    zero = [name for name in unstated if name not in taken]
    return _Point(point, zero, taken, {**unstated, **point})


def _known(value: float) -> float | None:
    """Return a number, or None for NaN: JSON has no NaN."""
    return value if math.isfinite(value) else None
