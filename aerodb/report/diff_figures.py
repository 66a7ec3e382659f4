"""The figure of a diff: slices through two databases with error band and flight envelope."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from aerodb.nomenclature import AXES
from aerodb.report.numbers import number
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    channel_scale,
    display_unit,
    in_figure,
    panel_grid,
    plain_panel,
)
from aerodb.support import Array
from aerodb.tables import (
    WIND_AXES,
    AeroDatabase,
    Increment,
    neutral_point,
    new_increments,
    scattered_over,
    table_grids,
)

#: Most slices drawn on a page; `diff` lists every node.
MAX_PANELS: Final = 12
#: Panels of one figure of `diff_figures`: they fill a page.
_ON_A_PAGE: Final = 6
#: Panels side by side.
_COLUMNS: Final = 2
_POINTS: Final = 241
_CELLS_BEYOND: Final = 3.0
#: A smaller change of a coefficient is rounding.
_SAME: Final = 1e-12

#: Axis, variable, its values (n,), and there the coefficient before, after, and the standard error
#: of the change.
_Panel = tuple[str, str, Array, tuple[Array, Array, Array]]

#: Channels that are shares, from 0 to 1.
_SHARES: Final = ("flow_attachment",)
_NEVER_NEGATIVE: Final = (
    *_SHARES,
    "V",
    "mach",
    "qbar",
    "rho",
    "temperature",
    "static_pressure",
    "mass",
    "height_above_ground",
)


def diff_figure(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    title: str,
    flown: Mapping[str, Array] | None = None,
) -> Figure:
    """Draw the coefficients [-] of two databases before and after, all other inputs neutral.

    There is one panel per axis that changes and variable over which it changes; if nothing changes,
    one empty panel says so. The band is two standard errors of the increments in one database only;
    the shaded range is their envelope. The panel title gives the largest change, its two standard
    errors and its place, since the change may be thinner than a line.

    Parameters
    ----------
    names : labels of the two versions.
    title : title of the figure, or empty.
    flown : channel -> samples of the flights, drawn as a distribution along the lower edge.
    """
    increments = (*new_increments(after, before), *new_increments(before, after))
    panels = list(_panels(before, after, increments))
    figure = _figure(panels, increments, names, title, flown)
    if not panels:
        _say(figure, _without_slices(before, after, names, increments))
    return figure


def diff_figures(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    flown: Mapping[str, Array] | None = None,
) -> list[Figure]:
    """As `diff_figure` (channels (n,) in SI units), on as many figures as fit a page each."""
    increments = (*new_increments(after, before), *new_increments(before, after))
    panels = list(_panels(before, after, increments))
    if not panels:
        return [diff_figure(before, after, names, "", flown)]
    return [
        _figure(panels[k : k + _ON_A_PAGE], increments, names, "", flown)
        for k in range(0, len(panels), _ON_A_PAGE)
    ]


def _without_slices(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    increments: Sequence[Increment],
) -> str:
    """Return what is said where no slice differs: the constants that do, or that nothing does."""
    point = {**neutral_point(before, increments), **neutral_point(after, increments)}
    channels = {name: np.array([value]) for name, value in point.items()}
    old, new = (database.predict(channels).coefficients for database in (before, after))
    changed = [
        f"{axis}: {number(float(old[axis][0]), 4)} in {names[0]}, {number(float(new[axis][0]), 4)}"
        f" in {names[1]}"
        for axis in AXES
        if abs(float(new[axis][0] - old[axis][0])) > _SAME
    ]
    return "\n".join(changed) or f"{names[0]} and {names[1]} give the same coefficients"


def _say(figure: Figure, text: str) -> None:
    figure.axes[0].text(0.0, 0.5, text, va="center")


def _figure(
    panels: Sequence[_Panel],
    increments: Sequence[Increment],
    names: tuple[str, str],
    title: str,
    flown: Mapping[str, Array] | None,
) -> Figure:
    rows = max(1, -(-len(panels) // _COLUMNS))
    figure, grid = panel_grid(
        (PAGE_WIDTH, 0.9 + 2.7 * rows),
        rows,
        _COLUMNS,
        left=0.85,
        right=0.1,
        top=0.75 if title else 0.3,
        between=(0.8, 0.75),
    )
    if title:
        figure.suptitle(title)
    spaces = grid.ravel()
    for space in spaces[len(panels) :]:
        space.set_axis_off()
    for space, (axis, variable, at, values) in zip(spaces, panels, strict=False):
        _slice(
            space, axis, variable, at, values, names, [i for i in increments if _acts_on(i, axis)]
        )
        if flown is not None and variable in flown:
            _coverage(space, variable, flown[variable], (at[0], at[-1]))
    if panels:
        spaces[0].legend(fontsize=SMALLEST, frameon=False)
    return figure


def _panels(
    before: AeroDatabase, after: AeroDatabase, increments: Sequence[Increment]
) -> Iterator[_Panel]:
    """Panels to draw: per axis that changes, the variables over which it changes most.

    Each axis has an equal share of the panels.
    """
    point = {**neutral_point(before, increments), **neutral_point(after, increments)}
    ranges = _ranges(before, after, increments)
    by_axis: dict[str, list[_Panel]] = {}
    for axis in AXES:
        for variable, reach in ranges.items():
            for _ in range(2):  # over all that is known, then closer where something changes
                at = np.linspace(*reach, _POINTS)
                channels = {
                    **{name: np.full(_POINTS, value) for name, value in point.items()},
                    variable: at,
                }
                old, new = (
                    database.predict(channels).coefficients[axis] for database in (before, after)
                )
                reach = _closer(at, new - old)
            change = new - old
            # A variable that only carries a constant change along says nothing that alpha does not.
            varies = variable == "alpha" or np.ptp(change) > 0.02 * np.max(
                np.abs(change), initial=0.0
            )
            if np.any(np.abs(change) > _SAME) and varies:
                values = old, new, _error(increments, axis, after, channels)
                by_axis.setdefault(axis, []).append((axis, variable, at, values))
    share = max(1, MAX_PANELS // max(1, len(by_axis)))
    for panels in by_axis.values():
        largest = sorted(panels, key=lambda panel: -float(np.ptp(panel[3][1] - panel[3][0])))[
            :share
        ]
        yield from (panel for panel in panels if any(panel is kept for kept in largest))


def _ranges(
    before: AeroDatabase, after: AeroDatabase, increments: Sequence[Increment]
) -> dict[str, tuple[float, float]]:
    """Variables to slice over, alpha first, with ranges that hold envelopes and all breakpoints."""
    marks: dict[str, list[float]] = {"alpha": []}
    for increment in increments:
        for name, interval in increment.envelope.items():
            # where tables have no cells, a cell is as wide as the envelope: nobody reads alpha at
            # 50 deg
            beyond = min(
                _CELLS_BEYOND * interval.cell,
                max(interval.high - interval.low, interval.cell / _CELLS_BEYOND),
            )
            lowest = 0.0 if name in _NEVER_NEGATIVE else -np.inf
            highest = 1.0 if name in _SHARES else np.inf
            marks.setdefault(name, []).extend(
                (max(lowest, interval.low - beyond), min(highest, interval.high + beyond))
            )
    known = {*before.inputs, *after.inputs, *marks}
    for database in (before, after):
        for grid in table_grids(database).values():
            for name, values in zip(grid.channels, grid.values, strict=True):
                marks.setdefault(name, []).extend((float(values[0]), float(values[-1])))
        for name in database.inputs:
            for values in scattered_over(name, database):
                marks.setdefault(name, []).extend((float(values[0]), float(values[-1])))
    return {
        name: (min(v), max(v))
        for name, v in marks.items()
        if name in known and v and max(v) > min(v)
    }


def _closer(at: Array, change: Array) -> tuple[float, float]:
    """Range of `at` (n,) in which there is a change, plus a quarter of it on both sides.

    The whole range where there is no change.
    """
    there = at[np.abs(change) > 1e-9 * np.max(np.abs(change), initial=1e-3)]
    if not len(there):
        return float(at[0]), float(at[-1])
    room = 0.25 * float(there[-1] - there[0]) + float(at[1] - at[0])
    return max(float(at[0]), float(there[0]) - room), min(float(at[-1]), float(there[-1]) + room)


def _acts_on(increment: Increment, axis: str) -> bool:
    return increment.axis == axis or (increment.axis in WIND_AXES and axis in AXES[:3])


def _error(
    increments: Sequence[Increment],
    axis: str,
    database: AeroDatabase,
    channels: Mapping[str, Array],
) -> Array:
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
    scale, label = channel_scale(variable)
    old, new, error = values
    for increment in increments:
        if variable in increment.envelope:
            interval = increment.envelope[variable]
            panel.axvspan(scale * interval.low, scale * interval.high, color="0.92", zorder=0)
    panel.plot(scale * at, old, color=DATABASE, lw=1.3, ls=DATABASE_LINE, label=in_figure(names[0]))
    panel.plot(scale * at, new, color=UPDATED, lw=1.2, label=in_figure(names[1]))
    panel.fill_between(
        scale * at, new - 2.0 * error, new + 2.0 * error, color=UPDATED, alpha=0.25, lw=0
    )
    plain_panel(panel)
    most = int(np.argmax(np.abs(new - old)))
    change = (
        f"{new[most] - old[most]:+.2g} ± {2.0 * error[most]:.1g} at {scale * at[most]:.3g}".replace(
            "-", "−"
        )
    )
    panel.set_title(
        f"largest change: {change} {display_unit(variable)[1] or ''}".rstrip(),
        loc="right",
        fontsize=SMALLEST,
        color="0.35",
        pad=2,
    )
    panel.xaxis.set_major_locator(MaxNLocator(5))
    panel.set_xlabel(label)
    panel.set_ylabel(f"{axis} [-]")


def _coverage(panel: Any, variable: str, samples: Array, reach: tuple[float, float]) -> None:
    """Draw the distribution of the flights along the lower edge of a slice."""
    scale, _ = channel_scale(variable)
    counts, edges = np.histogram(samples[np.isfinite(samples)], bins=40, range=reach)
    if counts.max(initial=0):
        height = 0.14 * counts / counts.max()
        place = panel.get_xaxis_transform()
        panel.bar(
            scale * edges[:-1],
            height,
            scale * np.diff(edges),
            align="edge",
            color="0.65",
            lw=0,
            zorder=0,
            transform=place,
        )
