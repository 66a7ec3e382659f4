"""The figure of a diff: slices through two databases with error band and flight envelope."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from aerodb.nomenclature import in_order
from aerodb.report.labels import channel_scale, in_figure
from aerodb.report.numbers import display_unit, number
from aerodb.report.reach import Reach, reach_of
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    panel_grid,
    plain_panel,
)
from aerodb.support import Array, half_interval
from aerodb.tables import (
    AeroDatabase,
    Increment,
    Slice,
    acts_on,
    neutral_point,
    new_increments,
    slices,
)

#: Panels of one figure of `diff_figures`: two figures, or one and text, fill a page.
_ON_A_PAGE: Final = 4
#: Height [in] of a row of panels, with its labels.
_ROW: Final = 2.2
#: Panels side by side.
_COLUMNS: Final = 2
#: Least width [in] of a panel, with its labels.
_LEAST: Final = 3.3
#: Room [in] above the title.
_ABOVE_TITLE: Final = 0.15
#: A smaller change of a coefficient is rounding.
_SAME: Final = 1e-12


def diff_figure(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    title: str,
    flown: Mapping[str, Array] | None = None,
    width: float = PAGE_WIDTH,
) -> Figure:
    """Draw the coefficients [-] of two databases before and after, all other inputs neutral.

    There is one panel per axis that changes and variable over which it changes; if nothing changes,
    one empty panel says so. The band is the 95 % interval of the increments in one database only;
    the shaded range is their envelope, dotted lines are where the data end. Above a panel stand the
    flown range, where the change has faded (`Reach`), and the largest change with its two standard
    errors and its place, since the change may be thinner than a line.

    Parameters
    ----------
    names : labels of the two versions.
    title : title of the figure, or empty.
    flown : channel -> samples of the flights, drawn as a distribution along the lower edge.
    width : of the figure [in]; panels stand below one another where two do not fit.
    """
    increments = (*new_increments(after, before), *new_increments(before, after))
    panels = slices(before, after)
    figure = _figure(panels, increments, names, title, flown, width)
    if not panels:
        _say(figure, _without_slices(before, after, names, increments))
    return figure


def diff_figures(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    flown: Mapping[str, Array] | None = None,
) -> list[Callable[[], Figure]]:
    """As `diff_figure` (channels (n,) in SI units), on as many figures as needed, each drawn by a
    call; on the first is the curve of each axis that changes most."""
    increments = (*new_increments(after, before), *new_increments(before, after))
    panels = _largest_first(slices(before, after))
    if not panels:
        return [partial(diff_figure, before, after, names, "", flown)]
    return [
        partial(_figure, panels[k : k + _ON_A_PAGE], increments, names, "", flown)
        for k in range(0, len(panels), _ON_A_PAGE)
    ]


def _largest_first(cuts: Sequence[Slice]) -> list[Slice]:
    """Slices as given where they fit one figure; else the one of each axis that changes most comes
    first."""
    if len(cuts) <= _ON_A_PAGE:
        return list(cuts)
    most: dict[str, Slice] = {}
    for cut in cuts:
        if cut.axis not in most or cut.largest > most[cut.axis].largest:
            most[cut.axis] = cut
    return [*most.values(), *(cut for cut in cuts if cut is not most[cut.axis])]


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
    pairs = {
        axis: tuple(float(each[axis][0]) if axis in each else 0.0 for each in (old, new))
        for axis in in_order({*old, *new})
    }
    changed = [
        f"{axis}: {number(first, 4)} in {names[0]}, {number(second, 4)} in {names[1]}"
        for axis, (first, second) in pairs.items()
        if abs(second - first) > _SAME
    ]
    return "\n".join(changed) or f"{names[0]} and {names[1]} give the same coefficients"


def _say(figure: Figure, text: str) -> None:
    figure.axes[0].text(0.0, 0.5, text, va="center")


def _figure(
    panels: Sequence[Slice],
    increments: Sequence[Increment],
    names: tuple[str, str],
    title: str,
    flown: Mapping[str, Array] | None,
    width: float = PAGE_WIDTH,
) -> Figure:
    columns = min(max(1, int(width / _LEAST)), _COLUMNS, max(1, len(panels)))
    rows = max(1, -(-len(panels) // columns))
    figure, grid = panel_grid(
        (width, 0.4 + _ROW * rows),
        rows,
        columns,
        left=0.85,
        right=0.1,
        top=0.85 if title else 0.4,
        between=(0.8, 0.85),
    )
    if title:
        figure.suptitle(title, y=1.0 - _ABOVE_TITLE / figure.get_figheight())
    spaces = grid.ravel()
    for space in spaces[len(panels) :]:
        space.set_axis_off()
    for space, cut in zip(spaces, panels, strict=False):
        draw_slice(space, cut, names, [i for i in increments if acts_on(i, cut.axis)])
        if flown is not None and cut.variable in flown:
            _coverage(space, cut.variable, flown[cut.variable], (cut.at[0], cut.at[-1]))
    if panels:
        spaces[0].legend(fontsize=SMALLEST, frameon=False)
    return figure


def draw_slice(
    panel: Axes, cut: Slice, names: tuple[str, str], increments: Sequence[Increment]
) -> None:
    """Draw a slice [-] through two versions, with the envelopes of the increments that act on its
    axis, in display units (`channel_scale`).

    names : labels of the two versions.
    """
    variable, at = cut.variable, cut.at
    scale, label = channel_scale(variable)
    old, new, error = cut.before, cut.after, cut.error
    for increment in increments:
        if variable in increment.envelope:
            interval = increment.envelope[variable]
            panel.axvspan(scale * interval.low, scale * interval.high, color="0.92", zorder=0)
    panel.plot(scale * at, old, color=DATABASE, lw=1.3, ls=DATABASE_LINE, label=in_figure(names[0]))
    panel.plot(scale * at, new, color=UPDATED, lw=1.2, label=in_figure(names[1]))
    panel.fill_between(
        scale * at,
        new - half_interval(error),
        new + half_interval(error),
        color=UPDATED,
        alpha=0.25,
        lw=0,
    )
    reach = reach_of(increments, variable)
    if not increments and cut.inside.any() and not cut.inside.all():  # flights of parameters
        low, high = (scale * float(end(at[cut.inside])) for end in (np.min, np.max))
        panel.axvspan(low, high, color="0.92", zorder=0)
        reach = Reach(variable, low, high, None, display_unit(variable)[1] or "")
    if reach is not None:
        draw_ends(panel, reach)
    plain_panel(panel)
    most = int(np.argmax(np.abs(new - old)))
    size = f"{new[most] - old[most]:+.2g} ± {half_interval(error[most]):.1g}"
    change = f"{size} at {scale * at[most]:.3g}".replace("-", "−")
    panel.set_title(
        f"largest change: {change} {display_unit(variable)[1] or ''}".rstrip(),
        loc="right",
        fontsize=SMALLEST,
        color="0.35",
        pad=2,
    )
    panel.xaxis.set_major_locator(MaxNLocator(5))
    panel.set_xlabel(label)
    panel.set_ylabel(f"{cut.axis} [-]")


def draw_ends(panel: Axes, reach: Reach) -> None:
    """Draw where the data end, in display units, and say above the panel where the change has
    faded."""
    for end in (reach.low, reach.high):
        panel.axvline(end, color="0.35", lw=0.8, ls=":", zorder=1)
    panel.annotate(
        reach.brief,
        (1.0, 1.0),
        (0.0, 13.0),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        fontsize=SMALLEST,
        color="0.35",
    )


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
