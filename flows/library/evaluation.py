"""A database evaluated at points, with standard errors and where the points lie."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.flows.library.views import (
    Data,
    Result,
    Summary,
    Values,
    axis_coordinate,
    number,
    over_axes,
)
from aerodb.nomenclature import channel
from aerodb.report import beyond_words
from aerodb.support import Array, counted, half_interval
from aerodb.tables import AeroDatabase, Evaluation, Place, evaluate_database, unstated_inputs
from aerodb.tasks.references import value_of
from aerodb.tasks.view import TAKEN, outside_envelope
from aerodb.units import convert


@dataclass(frozen=True, eq=False, repr=False)
class EvaluatedPoints(Result):
    """Coefficients of a database at n points.

    inputs : channel -> (n,), SI. assumed : inputs that were not given and count as zero. taken :
    those that count as another value, such as a height above ground outside ground effect.
    evaluation : axis -> value, standard error and place, each (n,).
    """

    database: AeroDatabase
    inputs: Mapping[str, Array]
    assumed: tuple[str, ...]
    evaluation: Evaluation
    taken: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, axis: str) -> Array:
        """Return the values (n,) on an axis of the database, such as CX."""
        if axis not in self.evaluation.value:
            raise UnknownNameError(
                f"no axis '{axis}'", self.database.name, nearest(axis, self.evaluation.value)
            )
        return self.evaluation.value[axis]

    def places(self, axis: str) -> NDArray[Any]:
        """Return (n,) ``inside data``, ``inside tables`` or ``outside``."""
        return np.array([Place(int(code)).label for code in self.evaluation.place[axis]], object)

    def headlines(self) -> list[str]:
        """Return the values of each axis (dimensionless), from least to greatest, and where the
        points lie."""
        said = self.summary()
        spans = [(low, "" if low == high else f" to {high}") for _, low, high, *_ in said.rows]
        return [
            said.title,
            *(
                f"  {axis}  {low}{high}, {place}"
                for (axis, *_, place), (low, high) in zip(said.rows, spans, strict=True)
            ),
        ]

    def summary(self) -> Summary:
        """Return the range of each axis (dimensionless) over the points (n,)."""
        rows = []
        for axis in self.database.axes:
            value, error = self[axis], self.evaluation.standard_error[axis]
            known = error[np.isfinite(error)]
            rows.append(
                (
                    axis,
                    number(float(value.min()), 6),
                    number(float(value.max()), 6),
                    number(half_interval(float(known.max())) if known.size else None, 2),
                    ", ".join(dict.fromkeys(self.places(axis))),
                )
            )
        outside = sorted(self.evaluation.prediction.outside_tables)
        said = [f"{name} is not given and counts as zero" for name in self.assumed]
        said += [
            f"{name} is not given and counts as {number(value)} {channel(name).unit}, {TAKEN[name]}"
            for name, value in self.taken.items()
        ]
        said += [f"edge values of table {name} are held" for name in outside]
        zero = np.zeros(len(self["CX"]))
        channels = {
            **dict.fromkeys(self.assumed, zero),
            **{name: zero + value for name, value in self.taken.items()},
            **self.inputs,
        }
        if beyond := outside_envelope(self.database, channels):
            said += beyond_words(self.database.increments, beyond)
        return Summary(
            f"{self.database.name} at {counted(len(zero), 'point')}",
            (),
            ("axis", "least [-]", "greatest [-]", "+- at most [-]", "place"),
            rows,
            said,
        )

    def data(self) -> Data:
        """Return value and standard error (dimensionless) and place over axis and point."""
        found, axes = self.evaluation, self.database.axes
        varied = [name for name, values in self.inputs.items() if np.ptp(values) > 0.0]
        index = varied[0] if len(varied) == 1 else "point"
        coordinates = {
            name: Values((index,), values, _unit(name)) for name, values in self.inputs.items()
        }
        if index == "point":
            count = len(self["CX"])
            coordinates["point"] = Values((index,), np.arange(count))
        parts = {
            "coefficient": found.value,
            "standard_error": found.standard_error,
            "place": {axis: self.places(axis) for axis in axes},
        }
        return Data(
            index,
            {"axis": axis_coordinate(axes), **coordinates},
            over_axes(axes, index, parts),
            {"database": self.database.name},
        )


def evaluate(
    database: AeroDatabase, units: Mapping[str, str] | None = None, **inputs: Any
) -> EvaluatedPoints:
    """Evaluate a database at points, with standard errors and where the points lie.

    Parameters
    ----------
    units : input -> unit of its numbers; SI where there is none.
    inputs : of the database: numbers, arrays of one shape, or texts with a unit (``V="20 m/s"``).
        Those not given count as zero, a height above ground as one outside ground effect; they are
        listed in the result.

    Raises InputError for a value that cannot be used, and UnknownNameError for a name that is not
    an input of the database.

    >>> import aerodb
    >>> from aerodb.exchange import read_native
    >>> made = read_native('''
    ... name = "example"
    ... [reference]
    ... area = 1.0
    ... chord = 0.25
    ... span = 4.0
    ... moment_reference = [0.0, 0.0, 0.0]
    ... [derivatives.CZ]
    ... "1" = -0.25
    ... alpha = -4.0
    ... ''')
    >>> points = aerodb.evaluate(made, alpha=[0.0, 0.125])
    >>> points["CZ"]
    array([-0.25, -0.75])
    >>> aerodb.evaluate(made, alpha=[0.0, 180.0], units={"alpha": "deg"})["CZ"].round(2)
    array([ -0.25, -12.82])
    """
    given = {}
    for name, value in inputs.items():
        if name not in database.inputs:
            raise UnknownNameError(
                f"'{name}' is not an input of {database.name}",
                "evaluate",
                nearest(name, database.inputs),
            )
        given[name] = _number_of(name, value, (units or {}).get(name))
    for name in units or {}:
        if name not in given:
            raise UnknownNameError(f"a unit of '{name}', which is not given", "evaluate", "")
    try:
        arrays = np.broadcast_arrays(*(np.atleast_1d(each) for each in given.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {np.shape(each)}" for name, each in given.items())
        raise InputError(
            f"inputs of different shapes: {shapes}", "evaluate", "give arrays of one shape"
        ) from error
    channels = {name: each.ravel() for name, each in zip(given, arrays, strict=True)}
    zero = np.zeros(len(next(iter(channels.values()), np.zeros(1))))
    unstated = unstated_inputs(database, channels)
    evaluation = evaluate_database(
        database, {**{name: zero + value for name, value in unstated.items()}, **channels}
    )
    shown = TAKEN if database.has_loads else ("height_above_ground",)
    other = {
        name: float(np.mean(value))
        for name, value in unstated.items()
        if name in shown and np.any(value)
    }
    assumed = tuple(name for name in unstated if name not in other)
    return EvaluatedPoints(database, channels, assumed, evaluation, other)


def _number_of(name: str, value: Any, unit: str | None) -> Array:
    if isinstance(value, str):
        return np.asarray(value_of(name, value))
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not a number or an array of numbers", "evaluate") from error
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{name} is not finite", "evaluate", "leave such points out")
    return numbers if unit is None else np.asarray(convert(numbers, unit, _unit(name)))


def _unit(name: str) -> str:
    try:
        return channel(name).unit
    except UnknownNameError:
        return "1"  # a free input of an imported file
