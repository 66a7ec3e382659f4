"""The flown envelope of an increment: an interval per variable."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.arguments import breakpoints_over
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import BASE_VARIABLES, Interval


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
