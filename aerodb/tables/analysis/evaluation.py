"""Coefficients of a database at given points, with standard error and place on every body axis.

Inside the flown envelope the standard error is that of the flights; beyond it, that of the
baseline. The variance on an axis is the sum of

- for every increment, its own variance under the envelope rule: the covariance of the estimates,
  and the square of what has faded (`Increment.evaluate`);
- ``(1 - w)^2`` times the variance that the source declares for its tables and variables
  (`Uncertainty`), where w is the weight that the envelopes leave to the flights' evidence. Inside
  the data the flights have measured the total coefficient, so that the declared uncertainty of a
  single table no longer adds to theirs.

Sources, and increments of different updates, are taken as independent. An axis with neither
increments nor declared uncertainty has the standard error NaN, not 0: nobody has quantified it.
Where only part of a baseline is declared, the error is that part.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.nomenclature import FORCE_AXES
from aerodb.support import Array
from aerodb.tables.analysis.declared_uncertainty import declared_variance
from aerodb.tables.analysis.linear_terms import depends_on
from aerodb.tables.database import AeroDatabase, Prediction
from aerodb.tables.functions import Value
from aerodb.tables.reference import BODY_AXES_OF, WIND_AXES, wind_to_body


class Place(IntEnum):
    """Where a point lies for one axis. Arrays hold the code; `Place(code).label` is its text."""

    INSIDE_DATA = 0
    INSIDE_TABLES = 1
    OUTSIDE = 2

    @property
    def label(self) -> str:
        """``inside data``, ``inside tables`` or ``outside``."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Coefficients with standard error and place; mappings from axis (`AeroDatabase.axes`).

    Parameters
    ----------
    value : (n,).
    standard_error : (n,), NaN where it is not known.
    place : (n,), codes of `Place`. OUTSIDE where a table that this axis depends on is evaluated
        beyond its breakpoints, even if flights have been there; else INSIDE_DATA where the
        envelope of an increment on this axis contains the point; else INSIDE_TABLES.
    weight : (n,), dimensionless: the largest share that an increment on this axis has; 0 where
        all have faded. Axes with increments only.
    prediction : the same values, and which tables are evaluated beyond their breakpoints.
    """

    value: Mapping[str, Array]
    standard_error: Mapping[str, Array]
    place: Mapping[str, NDArray[np.int8]]
    weight: Mapping[str, Array]
    prediction: Prediction


def evaluate_database(database: AeroDatabase, channels: Mapping[str, Value]) -> Evaluation:
    """Evaluate the coefficients with standard error and place.

    Parameters
    ----------
    channels : those of `database.inputs`, each (n,) or a number, SI and rad.

    Raises InputError naming missing channels.
    """
    prediction = database.predict(channels)
    n = prediction.outside.size
    values = database.resolved(database.needs, channels)
    rotation = _rotation_to_body(values, n) if database.on_wind_axes else {}
    axes = database.axes
    own = {axis: np.zeros(n) for axis in (*axes, *WIND_AXES)}
    weight, inside = (
        {axis: np.zeros(n) for axis in axes},
        {axis: np.zeros(n, dtype=np.bool_) for axis in axes},
    )
    known = set[str]()
    for increment in database.increments:
        result, left = increment.evaluate(values), increment.weight(values)
        own[increment.axis] += result.standard_error**2
        for axis in BODY_AXES_OF.get(increment.axis, (increment.axis,)):
            known.add(axis)
            weight[axis] = np.maximum(weight[axis], left)
            inside[axis] |= result.inside
    changed = frozenset(known)
    declared, uncertain = declared_variance(database, values, rotation, n)
    known |= {axis for source in uncertain for axis in BODY_AXES_OF.get(source, (source,))}
    variance = _in_body_axes(own, rotation)
    for axis, share in declared.items():
        variance[axis] += (1.0 - weight[axis]) ** 2 * share
    beyond = _outside(database, prediction, n)
    place = {
        a: np.where(
            beyond[a], Place.OUTSIDE, np.where(inside[a], Place.INSIDE_DATA, Place.INSIDE_TABLES)
        )
        for a in axes
    }
    return Evaluation(
        {axis: prediction.coefficients[axis] for axis in axes},
        {axis: np.sqrt(variance[axis]) if axis in known else np.full(n, np.nan) for axis in axes},
        {axis: codes.astype(np.int8) for axis, codes in place.items()},
        {axis: weight[axis] for axis in axes if axis in changed},
        prediction,
    )


def _rotation_to_body(values: Mapping[str, Any], n: int) -> dict[str, dict[str, Array]]:
    """Rotation matrix from wind to body axes, ``rotation[wind axis][force axis]``, each (n,)."""
    rotation = {}
    for k, wind in enumerate(WIND_AXES):
        drag, side, lift = (float(k == other) for other in range(3))
        parts = wind_to_body(drag, side, lift, values["alpha"], values["beta"])
        rotation[wind] = {
            axis: np.broadcast_to(part, (n,)) for axis, part in zip(FORCE_AXES, parts, strict=True)
        }
    return rotation


def _in_body_axes(
    own: Mapping[str, Array], rotation: Mapping[str, Mapping[str, Array]]
) -> dict[str, Array]:
    """Variances on the body axes from independent contributions on body and wind axes, each
    (n,)."""
    total = {axis: np.array(own[axis]) for axis in own if axis not in WIND_AXES}
    for wind, parts in rotation.items():
        for axis, part in parts.items():
            total[axis] += part**2 * own[wind]
    return total


def _outside(
    database: AeroDatabase, prediction: Prediction, n: int
) -> dict[str, NDArray[np.bool_]]:
    """Per body axis (n,), where a table that it depends on is evaluated beyond its breakpoints."""
    beyond = {axis: np.zeros(n, dtype=np.bool_) for axis in database.axes}
    for term in database.coefficient_terms if prediction.outside_tables else ():
        for table in depends_on(term.expression, database) & prediction.outside_tables.keys():
            for axis in BODY_AXES_OF.get(term.axis, (term.axis,)):
                beyond[axis] |= prediction.outside_tables[table]
    return beyond
