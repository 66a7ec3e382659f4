"""The picture of a diff: slices through two databases, before and after, with band, and where the flights have been."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.nomenclature import AXES, channel
from aerodb.report.figures import DATABASE, UPDATED
from aerodb.tables.database import AeroDatabase
from aerodb.tables.functions import Array
from aerodb.tables.increment import Increment
from aerodb.tables.nodes import neutral_point, table_grids
from aerodb.tables.reference import WIND_AXES
from aerodb.tables.slopes import new_increments

#: More slices than this fill no page that anybody reads; `diff` lists every node.
MAX_PANELS: Final = 12
_POINTS: Final = 241
_CELLS_BEYOND: Final = 3.0


def diff_figure(before: AeroDatabase, after: AeroDatabase, names: tuple[str, str], title: str) -> Figure:
    """A panel per axis that changes and variable over which it does: coefficient before and after, all else neutral.

    The band is two standard errors of what stands in one database only; the shaded range is where its flights have been.
    names : what the two versions are called. One empty panel, which says so, where nothing changes.
    """
    increments = (*new_increments(after, before), *new_increments(before, after))
    panels = list(_panels(before, after, increments))
    columns = min(3, max(1, len(panels)))
    rows = max(1, -(-len(panels) // columns))
    figure = Figure(figsize=(1.0 + 4.2 * columns, 1.0 + 3.0 * rows), layout="constrained")
    figure.suptitle(title)
    spaces = figure.subplots(rows, columns, squeeze=False).ravel()
    for space in spaces[len(panels) :]:
        space.set_axis_off()
    for space, (axis, variable, at, values) in zip(spaces, panels, strict=False):
        _slice(space, axis, variable, at, values, names, [i for i in increments if _acts_on(i, axis)])
    if panels:
        spaces[0].legend(fontsize=8, frameon=False)
    else:
        spaces[0].text(0.5, 0.5, f"{names[0]} and {names[1]} give the same coefficients", ha="center")
    return figure


def _panels(
    before: AeroDatabase, after: AeroDatabase, increments: Sequence[Increment]
) -> Iterator[tuple[str, str, Array, tuple[Array, Array, Array]]]:
    """Axis, variable, its values, and there the coefficient before, after, and the standard error of the change."""
    point = {**neutral_point(before, increments), **neutral_point(after, increments)}
    shown = 0
    ranges = _ranges(before, after, increments)
    for axis in AXES:
        for variable, (low, high) in ranges.items():
            at = np.linspace(low, high, _POINTS)
            channels = {**{name: np.full(_POINTS, value) for name, value in point.items()}, variable: at}
            old, new = (database.predict(channels).coefficients[axis] for database in (before, after))
            change = new - old
            # A variable that only carries a constant change along says nothing that alpha does not.
            varies = variable == "alpha" or np.ptp(change) > 0.02 * np.max(np.abs(change), initial=0.0)
            if np.any(np.abs(change) > 1e-12) and varies and shown < MAX_PANELS:
                shown += 1
                yield axis, variable, at, (old, new, _error(increments, axis, after, channels))


def _ranges(before: AeroDatabase, after: AeroDatabase, increments: Sequence[Increment]) -> dict[str, tuple[float, float]]:
    """Variables to slice over, alpha first, and their ranges: envelopes with what lies beyond, and all breakpoints."""
    marks: dict[str, list[float]] = {"alpha": []}
    for increment in increments:
        for name, interval in increment.envelope.items():
            beyond = _CELLS_BEYOND * interval.cell
            marks.setdefault(name, []).extend((interval.low - beyond, interval.high + beyond))
    known = {*before.inputs, *after.inputs, *marks}
    for database in (before, after):
        for grid in table_grids(database).values():
            for name, values in zip(grid.channels, grid.values, strict=True):
                marks.setdefault(name, []).extend((float(values[0]), float(values[-1])))
    return {name: (min(v), max(v)) for name, v in marks.items() if name in known and v and max(v) > min(v)}


def _acts_on(increment: Increment, axis: str) -> bool:
    return increment.axis == axis or (increment.axis in WIND_AXES and axis in AXES[:3])


def _error(increments: Sequence[Increment], axis: str, database: AeroDatabase, channels: Mapping[str, Array]) -> Array:
    variance = np.zeros(_POINTS)
    for increment in increments:
        if _acts_on(increment, axis):
            own = database.resolved(sorted(increment.names), channels)
            variance = variance + increment.evaluate(own).standard_error ** 2
    return np.sqrt(variance)


def _slice(
    panel: Any,
    axis: str,
    variable: str,
    at: Array,
    values: tuple[Array, Array, Array],
    names: tuple[str, str],
    increments: Sequence[Increment],
) -> None:
    unit = channel(variable).unit
    scale, unit = (180.0 / np.pi, "deg") if unit == "rad" else (1.0, unit)
    old, new, error = values
    for increment in increments:
        if variable in increment.envelope:
            interval = increment.envelope[variable]
            panel.axvspan(scale * interval.low, scale * interval.high, color="0.92", zorder=0)
    panel.plot(scale * at, old, color=DATABASE, lw=1.2, label=names[0])
    panel.plot(scale * at, new, color=UPDATED, lw=1.2, label=names[1])
    panel.fill_between(scale * at, new - 2.0 * error, new + 2.0 * error, color=UPDATED, alpha=0.25, lw=0)
    panel.set_xlabel(f"{variable} [{unit}]")
    panel.set_ylabel(f"{axis} [-]")
