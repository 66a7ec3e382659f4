"""Figures of an update. Colours (Okabe & Ito, colour-blind safe) mean the same everywhere: flight, database, updated."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerodb.comparison import Comparison
from aerodb.nomenclature import axis_description

FLIGHT: Final = "#000000"
DATABASE: Final = "#D55E00"
UPDATED: Final = "#0072B2"

#: More points than a print can show only make the file heavy; extremes are kept.
MAX_POINTS: Final = 4000


def update_figure(
    axes: Sequence[str],
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    labels: Mapping[str, str],
    title: str,
) -> Figure:
    """Per axis a row: coefficient over time (flight, database, updated database) and the residual before and after.

    before, after : flight id -> comparison; the flights are set one behind the other, as in 003, Fig. 5. labels : flight
    id -> what people call it.
    """
    figure = Figure(figsize=(11, 1.2 + 2.1 * len(axes)), layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(len(axes), 2, squeeze=False, width_ratios=(2, 1))
    for row, axis in enumerate(axes):
        _time_history(panels[row][0], axis, before, after, labels, first=row == 0)
        _residuals(panels[row][1], axis, before, after)
    panels[-1][0].set_xlabel("time, flights one behind the other [s]")
    panels[-1][1].set_xlabel("residual: flight - database [-]")
    return figure


def _time_history(
    panel: Axes,
    axis: str,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    labels: Mapping[str, str],
    *,
    first: bool,
) -> None:
    start = 0.0
    for flight, old in before.items():
        if axis not in old.usable:
            continue
        good = _thinned(old.usable[axis], old.measured[axis])
        time = start + old.time[good] - old.time[0]
        for values, colour, name in (
            (old.measured[axis], FLIGHT, "flight"),
            (old.predicted[axis], DATABASE, "database"),
            (after[flight].predicted[axis], UPDATED, "updated database"),
        ):
            panel.plot(time, values[good], color=colour, lw=0.8, label=name if start == 0.0 else None)
        if first:
            panel.annotate(
                labels.get(flight, flight[:12]), (start, 1.0), xycoords=("data", "axes fraction"), fontsize=8, va="bottom"
            )
        start += float(old.time[-1] - old.time[0])
        panel.axvline(start, color="0.7", lw=0.6)
    panel.set_ylabel(f"{axis} [-]")
    panel.text(0.995, 0.04, axis_description(axis), transform=panel.transAxes, fontsize=8, ha="right", color="0.4")
    if first:
        panel.legend(loc="upper right", fontsize=8, ncols=3, frameon=False, bbox_to_anchor=(1.0, 1.22))


def _residuals(panel: Axes, axis: str, before: Mapping[str, Comparison], after: Mapping[str, Comparison]) -> None:
    pooled = [
        np.concatenate([c.residual(axis)[c.usable[axis]] for c in side.values() if axis in c.usable] or [np.empty(0)])
        for side in (before, after)
    ]
    if not len(pooled[0]):
        return
    edges = np.histogram_bin_edges(np.concatenate(pooled), bins=80)
    for values, colour, name in zip(pooled, (DATABASE, UPDATED), ("before", "after"), strict=True):
        panel.hist(values, bins=edges.tolist(), color=colour, alpha=0.6, label=f"{name}: {np.sqrt(np.mean(values**2)):.2g} rms")
    panel.set_yticks([])
    panel.legend(fontsize=8, frameon=False)


def _thinned(usable: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Indices of usable samples, at most MAX_POINTS: in each stretch the lowest and the highest value."""
    index = np.flatnonzero(usable)
    if len(index) <= MAX_POINTS:
        return index
    chunks = np.array_split(index, MAX_POINTS // 2)
    kept = [(chunk[np.argmin(values[chunk])], chunk[np.argmax(values[chunk])]) for chunk in chunks]
    return np.unique(np.array(kept).ravel())
