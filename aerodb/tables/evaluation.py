"""What a database says at a point and how far to trust it: value, standard error and place, on
every body axis.

The standard error follows the flights where they have been, and the baseline beyond. On an axis it
adds in squares

- for every increment, its own error under the envelope rule: covariance of the estimates and what
  has faded;
- ``(1 - w)`` times what the source declares of its tables and variables (`Uncertainty`), where w is
  the weight that the
  envelopes leave of the flights' evidence: inside the data the flights have measured the total, and
  one table's declared doubt no longer adds to theirs.

Sources and increments of different updates are taken as independent. What nobody has quantified is
not known: an axis with neither increments nor declared uncertainty has NaN, not 0. Where only part
of a baseline is declared, the error is that part.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.nomenclature import AXES, FORCE_AXES
from aerodb.support import Array
from aerodb.tables.declared_uncertainty import declared_variance
from aerodb.tables.functions import Value
from aerodb.tables.linear_terms import depends_on
from aerodb.tables.reference import WIND_AXES, wind_to_body

if TYPE_CHECKING:
    from aerodb.tables.database import AeroDatabase, Prediction

#: Body axes on which a wind axis is felt at small angles: whose flights speak for whom.
_SPEAKS_FOR: Final = {"C_drag": ("CX", "CZ"), "C_side": ("CY",), "C_lift": ("CX", "CZ")}


class Place(IntEnum):
    """Where a point lies for one axis; `Place(code).label` is what people read."""

    INSIDE_DATA = 0
    INSIDE_TABLES = 1
    OUTSIDE = 2

    @property
    def label(self) -> str:
        """``inside data``, ``inside tables`` or ``outside``."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Per body axis CX CY CZ Cl Cm Cn, each (n,): value, standard error (NaN where not known) and
    place (a `Place`).

    place : OUTSIDE where a table behind this axis is asked beyond its breakpoints, whatever flights
    say; else INSIDE_DATA where the envelope of an increment on this axis contains the point; else
    INSIDE_TABLES.
    """

    value: Mapping[str, Array]
    standard_error: Mapping[str, Array]
    place: Mapping[str, NDArray[np.int8]]
    prediction: "Prediction"


def evaluate(database: "AeroDatabase", channels: Mapping[str, Value]) -> Evaluation:
    """Value, standard error and place of the six coefficients at `channels` (each (n,) or a number,
    SI and rad).

    Raises InputError that names missing channels.
    """
    prediction = database.predict(channels)
    n = prediction.outside.size
    values = database.resolved(database.needs, channels)
    rotation = _rotation_to_body(values, n) if database.on_wind_axes else {}
    own = {axis: np.zeros(n) for axis in (*AXES, *WIND_AXES)}
    weight, inside = (
        {axis: np.zeros(n) for axis in AXES},
        {axis: np.zeros(n, dtype=np.bool_) for axis in AXES},
    )
    known: set[str] = set()
    for increment in database.increments:
        result, left = increment.evaluate(values), increment.weight(values)
        own[increment.axis] += result.standard_error**2
        for axis in _SPEAKS_FOR.get(increment.axis, (increment.axis,)):
            known.add(axis)
            weight[axis] = np.maximum(weight[axis], left)
            inside[axis] |= result.inside
    declared, uncertain = declared_variance(database, values, rotation, n)
    known |= {axis for source in uncertain for axis in _SPEAKS_FOR.get(source, (source,))}
    variance = _in_body_axes(own, rotation)
    for axis, share in declared.items():
        variance[axis] += (1.0 - weight[axis]) ** 2 * share
    beyond = _outside(database, prediction, n)
    place = {
        a: np.where(
            beyond[a], Place.OUTSIDE, np.where(inside[a], Place.INSIDE_DATA, Place.INSIDE_TABLES)
        )
        for a in AXES
    }
    return Evaluation(
        {axis: prediction.coefficients[axis] for axis in AXES},
        {axis: np.sqrt(variance[axis]) if axis in known else np.full(n, np.nan) for axis in AXES},
        {axis: codes.astype(np.int8) for axis, codes in place.items()},
        prediction,
    )


def _rotation_to_body(values: Mapping[str, Any], n: int) -> dict[str, dict[str, Array]]:
    """``rotation[wind axis][force axis]``, each (n,): what one unit along a wind axis gives along
    the body axes."""
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
    """Variances of independent contributions on body and wind axes, (n,) each, as variances on the
    body axes."""
    total = {axis: np.array(own[axis]) for axis in AXES}
    for wind, parts in rotation.items():
        for axis, part in parts.items():
            total[axis] += part**2 * own[wind]
    return total


def _outside(
    database: "AeroDatabase", prediction: "Prediction", n: int
) -> dict[str, NDArray[np.bool_]]:
    """Per body axis, where a table on which it depends is asked beyond its breakpoints."""
    beyond = {axis: np.zeros(n, dtype=np.bool_) for axis in AXES}
    for term in database.terms if prediction.outside_tables else ():
        for table in depends_on(term.expression, database) & prediction.outside_tables.keys():
            for axis in _SPEAKS_FOR.get(term.axis, (term.axis,)):
                beyond[axis] |= prediction.outside_tables[table]
    return beyond
