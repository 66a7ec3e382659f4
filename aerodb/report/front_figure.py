"""The figure of a version's first page: the curve that changes most, and the error per axis."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from aerodb.report.diff_figures import draw_slice
from aerodb.report.numbers import number
from aerodb.report.reach import beyond_words
from aerodb.report.style import DATABASE, PAGE_WIDTH, SMALLEST, UPDATED, panel_grid, plain_panel
from aerodb.tables import HAT_RATES, AeroDatabase, Increment, Slice, acts_on, new_increments, slices

_HEIGHT: Final = 2.9


def front_figure(
    before: AeroDatabase,
    after: AeroDatabase,
    names: tuple[str, str],
    rows: Sequence[Mapping[str, Any]],
) -> Figure:
    """Draw the slice that changes most [-] with the band of its data, and the error of each axis
    before and after in per cent of what it varied in flight.

    names : labels of the two versions. rows : of `error_rows`.
    """
    figure, panels = panel_grid(
        (PAGE_WIDTH, _HEIGHT), 1, 2, left=0.85, right=0.1, top=0.4, between=(0.8, 0.0)
    )
    left, right = panels[0]
    most = _most_changed(before, after)
    if most is not None:
        draw_slice(left, most, names, _acting(before, after, most))
        left.legend(fontsize=SMALLEST, frameon=False)
    else:
        left.set_axis_off()
        left.text(0.5, 0.5, "no curve changes", ha="center")
    _errors(right, [row for row in rows if row["of_flown"] and row["before"] and row["after"]])
    return figure


def front_ends(before: AeroDatabase, after: AeroDatabase) -> list[str]:
    """Return where the data of the curve in `front_figure` end, as `beyond_words` does."""
    most = _most_changed(before, after)
    return [] if most is None else beyond_words(_acting(before, after, most), (most.variable,))


def _most_changed(before: AeroDatabase, after: AeroDatabase) -> Slice | None:
    cuts = slices(before, after)
    told = [cut for cut in cuts if cut.variable not in HAT_RATES] or cuts
    return max(told, key=lambda cut: cut.largest, default=None)


def _acting(before: AeroDatabase, after: AeroDatabase, cut: Slice) -> list[Increment]:
    increments = (*new_increments(after, before), *new_increments(before, after))
    return [each for each in increments if acts_on(each, cut.axis)]


def _errors(panel: Any, rows: Sequence[Mapping[str, Any]]) -> None:
    for k, row in enumerate(rows):
        after = 100.0 * row["of_flown"]
        before = after * row["before"] / row["after"]
        panel.plot([before, after], [k, k], color="0.7", lw=2.0, zorder=1)
        first = {"label": "before"} if k == 0 else {}
        panel.plot(before, k, "o", color=DATABASE, ms=8, mfc="none", mew=1.5, **first)
        first = {"label": "after"} if k == 0 else {}
        panel.plot(after, k, "s", color=UPDATED, ms=5.5, **first)
    plain_panel(panel)
    panel.set_yticks(range(len(rows)), [row["label"] for row in rows])
    panel.set_ylim(len(rows) - 0.4, -0.6)
    panel.set_xlabel("error, part of what was flown [%]")
    if rows:
        panel.set_xscale("log")
        panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 1)))
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.legend(
            fontsize=SMALLEST, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.99)
        )
