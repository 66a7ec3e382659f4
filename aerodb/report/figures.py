"""Time histories of an update: coefficients of flight and databases, and their residuals."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerodb.coefficients import Comparison
from aerodb.report.decimation import extremes
from aerodb.report.labels import in_figure
from aerodb.report.numbers import number
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    FLIGHT,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    panel_grid,
    plain_panel,
)
from aerodb.signals import rms
from aerodb.support import Array

#: Most points per curve: more than a print can show. Extremes are kept.
MAX_POINTS: Final = 1600

#: Letters of flight names that fit above the histories.
_LETTERS: Final = 52
#: Fewest letters of a flight name that say something.
_FEWEST_LETTERS: Final = 4


def update_figure(
    axes: Sequence[str],
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    labels: Mapping[str, str],
    errors: bool = True,
) -> Figure:
    """Draw per axis the coefficient [-] over time [s] and the distribution of the residual [-].

    Parameters
    ----------
    axes : a row each; four fill a page.
    before, after : flight id -> comparison; `after` is empty where nothing was updated. The flights
        are drawn one after another, as in 003, Fig. 5.
    labels : flight id -> display name.
    errors : whether to print the rms of the residuals.
    """
    figure, panels = panel_grid(
        (PAGE_WIDTH, 1.0 + 2.0 * len(axes)),
        len(axes),
        2,
        left=0.85,
        right=0.1,
        top=0.55,
        between=(0.25, 0.42),
        width_ratios=(2, 1),
    )
    for row, axis in enumerate(axes):
        _time_history(panels[row][0], axis, before, after, labels, first=row == 0)
        _residuals(panels[row][1], axis, before, after, errors)
    handles, texts = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="upper right", fontsize=SMALLEST, ncols=3, frameon=False)
    panels[-1][0].set_xlabel("time, flights one after another [s]")
    panels[-1][1].set_xlabel("residual: flight - database [-]")
    return figure


def pooled_residual(axis: str, side: Mapping[str, Comparison]) -> Array:
    """Residual flight - model on `axis` at all usable samples of all flights, (n,).

    side : flight id -> comparison.
    """
    return np.concatenate(
        [c.residual(axis)[c.usable[axis]] for c in side.values() if axis in c.usable]
        or [np.empty(0)]
    )


def _time_history(
    panel: Axes,
    axis: str,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    labels: Mapping[str, str],
    *,
    first: bool,
) -> None:
    start, whole = (
        0.0,
        sum(float(old.time[-1] - old.time[0]) for old in before.values() if axis in old.usable),
    )
    for flight, old in before.items():
        if axis not in old.usable:
            continue
        drawn: list[tuple[Array, str, Any, str]] = [
            (old.measured[axis], FLIGHT, "-", "flight"),
            (old.predicted[axis], DATABASE, DATABASE_LINE, "database"),
        ]
        if flight in after:
            drawn.append((after[flight].predicted[axis], UPDATED, "-", "updated database"))
        for values, colour, look, name in drawn:
            good = extremes(
                np.where(old.usable[axis], values, np.nan), MAX_POINTS // max(1, len(before))
            )
            shown = np.where(old.usable[axis][good], values[good], np.nan)
            time = start + old.time[good] - old.time[0]
            panel.plot(
                time, shown, color=colour, ls=look, lw=0.8, label=name if start == 0.0 else None
            )
        if first:
            room = int(_LETTERS * (old.time[-1] - old.time[0]) / whole)
            panel.annotate(
                _fitting(labels.get(flight, flight[:12]), room),
                (start, 1.0),
                xycoords=("data", "axes fraction"),
                fontsize=SMALLEST,
                va="bottom",
            )
        start += float(old.time[-1] - old.time[0])
        panel.axvline(start, color="0.7", lw=0.6)
    plain_panel(panel)
    panel.set_ylabel(f"{axis} [-]")


def _fitting(label: str, room: int) -> str:
    """A flight's name in `room` letters: without its date, and cut, where it does not fit."""
    if room < _FEWEST_LETTERS:
        return ""
    return in_figure(label if len(label) <= room else label.partition(" (")[0], room)


def _residuals(
    panel: Axes,
    axis: str,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    errors: bool,
) -> None:
    sides = [
        (pooled_residual(axis, side), colour)
        for side, colour in ((before, DATABASE), (after, UPDATED))
        if any(axis in comparison.usable for comparison in side.values())
    ]
    if not sides or not len(sides[0][0]):
        return
    edges = np.histogram_bin_edges(np.concatenate([values for values, _ in sides]), bins=80)
    for values, colour in sides:
        panel.hist(
            values,
            bins=edges.tolist(),
            histtype="stepfilled",
            color=colour,
            alpha=0.6,
            lw=0,
            label=f"{number(rms(values), 2)} rms" if errors else None,
        )
    plain_panel(panel)
    panel.set_yticks([])
    panel.locator_params(axis="x", nbins=4)
    panel.set_ylim(0.0, 1.4 * panel.get_ylim()[1])  # room for the legend
    if errors:
        panel.legend(fontsize=SMALLEST, frameon=False, loc="upper left", borderaxespad=0.0)
