"""The flown envelope of an increment: an interval per variable, and what is beyond it where the
database has nothing else."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.arguments import breakpoints_over
from aerodb.tables.analysis.check_cases import make_check_cases
from aerodb.tables.analysis.multilinear import NotMultilinearError, breaks
from aerodb.tables.database import AeroDatabase
from aerodb.tables.definitions import STATE_CHANNEL
from aerodb.tables.increment import BASE_VARIABLES, Increment, Interval
from aerodb.tables.reference import BODY_AXES_OF

#: Table cells over which slopes continue: as far as an increment on a baseline is held and faded.
_CONTINUED: Final = 2.0
#: Most of it in a flow angle [rad]: 5 deg, the usual step of wind-tunnel tables, between nodes of
#: which the flow counts as linear.
_TUNNEL_STEP: Final = 0.0873


def flown_envelope(
    names: Iterable[str],
    flown: Sequence[tuple[Mapping[str, Array], np.ndarray]],
    database: AeroDatabase,
) -> dict[str, Interval]:
    """The flown interval of each variable in `names`, and of alpha, beta and mach where the
    database uses them.

    flown : per flight its channels (each (n,) or a number), and which samples are used (n,).
    """
    variables = {*names, *(name for name in BASE_VARIABLES if name in database.inputs)}
    envelope = {}
    for name in sorted(variables):
        values = np.concatenate(
            [np.broadcast_to(channels[name], good.shape)[good] for channels, good in flown]
        )
        low, high = float(values.min()), float(values.max())
        envelope[name] = Interval(low, high, table_cell(name, low, high, database))
    return envelope


def table_cell(name: str, low: float, high: float, database: AeroDatabase) -> float:
    """Width of a table cell of a variable: the median spacing of the database's breakpoints, else
    the range `low` to `high`.

    `low`, `high` and the result are in the unit of the variable.
    """
    spacing = np.concatenate(
        [np.empty(0), *(np.diff(points) for points in breakpoints_over(name, database))]
    )
    if spacing.size:
        return float(np.median(spacing))
    return high - low if high > low else max(abs(high), 1e-3)


def continued(increment: Increment, database: AeroDatabase) -> Increment:
    """Return an increment that is added to `database` so that it continues beyond its envelope, if
    the database has nothing on its axis; else as it is.

    A database has nothing where its coefficient is the same everywhere: to fade there is to lose
    the force. A variable has a margin of two cells (its unit), a flow angle of at most 5 deg, if
    every regressor is linear in it from the envelope's edge to there; otherwise, and for states,
    regressors are held at the edge.
    Source: docs/method/updates.md, section "Envelope".
    """
    if not _has_nothing(database, increment.axis):
        return increment
    used = frozenset[str]().union(*(regressor.names for regressor in increment.regressors))
    margins = {name: _margin(name, increment) for name in increment.envelope if name in used}
    return replace(increment, margins=margins)


def _has_nothing(database: AeroDatabase, axis: str) -> bool:
    """Whether the coefficients on an axis are the same at all points of the check cases."""
    cases = make_check_cases(database)
    return all(
        len({case.coefficients[body] for case in cases}) == 1
        for body in BODY_AXES_OF.get(axis, (axis,))
    )


def _margin(name: str, increment: Increment) -> float:
    """The margin of a variable that `continued` gives; 0 where a regressor is not linear in it."""
    interval = increment.envelope[name]
    margin = 0.0 if name == STATE_CHANNEL else _CONTINUED * interval.cell
    if name in ("alpha", "beta"):
        margin = min(margin, _TUNNEL_STEP)
    reach = {
        each: (i.low - _CONTINUED * i.cell, i.high + _CONTINUED * i.cell)
        for each, i in increment.envelope.items()
    }
    for regressor in increment.regressors:
        if name not in regressor.names:
            continue
        try:
            bends = breaks(regressor, reach)[name]
        except (NotMultilinearError, KeyError):  # KeyError: a variable without envelope
            return 0.0
        if any(not interval.low <= bend <= interval.high for bend in bends):
            return 0.0
    return margin
