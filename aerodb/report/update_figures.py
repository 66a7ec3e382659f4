"""Figures of an update or a closed loop: errors, per-flight estimates and residuals."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from aerodb.coefficients import Comparison
from aerodb.report.labels import channel_scale, in_figure, parameter_scale
from aerodb.report.numbers import number
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    FLIGHT,
    PAGE_HEIGHT,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    panel_grid,
    plain_panel,
)
from aerodb.support import Array, half_interval
from aerodb.tracing import SamplingUnit

#: Most bins of a variable.
_BINS: Final = 24
#: Fewest bins that are drawn.
_FEWEST_BINS: Final = 3
#: Fewest samples per bin: the number of bins is limited to it.
_FEWEST_IN_BIN: Final = 15
#: Most samples used for the quantiles; larger sets are thinned. 400 in a bin tell its 80 % band to
#: a twentieth of the spread.
_SAMPLES: Final = 10_000
#: Narrowest bin, as a share of the range between the 1 % and 99 % quantiles: in a narrower one, a
#: spike is chance.
_NARROWEST: Final = 1 / 30
#: Height [in] of a line of the smallest type.
_LINE: Final = 0.14
_BAND: Final = (0.1, 0.5, 0.9)
#: Variables that stand side by side, of an axis.
_COLUMNS: Final = 3

#: A variable that varies less than this counts as constant (SI: 0.3 deg, or non-dimensional).
_MOVES: Final = 5e-3


def error_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw per axis the error before and after, and the noise floor, what the right one would leave
    (docs/reference/conventions.md, section Noise floor and error measures).

    rows : axis, before, after, floor (rms, without dimension), and each, the errors before and
    after of single flights; an error that is None or zero is left out.
    """
    figure = Figure(figsize=(PAGE_WIDTH, 0.9 + 0.36 * max(1, len(rows))), layout="constrained")
    panel = figure.subplots()
    looks: tuple[tuple[str, dict[str, Any]], ...] = (
        ("floor", {"marker": "|", "color": FLIGHT, "ms": 13, "mew": 1.5, "label": "noise floor"}),
        (
            "before",
            {
                "marker": "o",
                "color": DATABASE,
                "ms": 8,
                "mfc": "none",
                "mew": 1.5,
                "zorder": 3,
                "label": "database",
            },
        ),
        ("after", {"marker": "s", "color": UPDATED, "ms": 5.5, "label": "updated database"}),
    )
    single: dict[str, Any] = {
        "ls": "",
        "marker": ".",
        "ms": 6.5,
        "mew": 0,
        "zorder": 1.5,
        "alpha": 0.8,
    }
    for k, row in enumerate(rows):
        for before, after in row.get("each", ()):
            panel.plot(
                [value for value in (before,) if value],
                [k - 0.3] * bool(before),
                color=DATABASE,
                **single,
            )
            panel.plot(
                [value for value in (after,) if value],
                [k + 0.3] * bool(after),
                color=UPDATED,
                **single,
            )
        if row["before"] and row["after"]:
            panel.plot([row["before"], row["after"]], [k, k], color="0.7", lw=2.0, zorder=1)
    for key, look in looks:
        shown = [(row[key], k) for k, row in enumerate(rows) if row[key]]
        if shown:
            panel.plot(*zip(*shown, strict=True), ls="", **look)
            panel.set_xscale("log")
    panel.set_yticks(range(len(rows)), [row.get("label", row["axis"]) for row in rows])
    panel.set_ylim(len(rows) - 0.4, -0.6)
    plain_panel(panel)
    panel.xaxis.set_minor_locator(LogLocator(subs=range(2, 10)))
    # powers as raised letters: Matplotlib's own are smaller than the smallest type
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.tick_params(axis="y", labelsize=9)
    units = (
        "[-]"
        if all(row.get("label", row["axis"]) == row["axis"] for row in rows)
        else "in the unit of each"
    )
    panel.set_xlabel(f"rms of flight - model {units}")
    if rows:
        panel.legend(
            fontsize=SMALLEST, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.99)
        )
    return figure


def forest_figure(finding: Mapping[str, Any], labels: Mapping[str, str]) -> Figure:
    """Draw the forest plot of a finding: per-flight and combined estimates with 95 % intervals.

    finding : an entry of ``findings`` (docs/reference/contract.md). labels : flight id -> display
    name. Values are drawn in display units (`for_people`).
    """
    votes = finding["votes"]
    pitch = min(0.2, (PAGE_HEIGHT - 1.05) / (len(votes) + 1))
    figure = Figure(figsize=(PAGE_WIDTH, 1.05 + pitch * (len(votes) + 1)), layout="constrained")
    panel = figure.subplots()
    factor, label = parameter_scale(finding["parameter"], finding["unit"])
    for k, vote in enumerate(votes):
        half = factor * half_interval(vote["se"])
        panel.errorbar(
            factor * vote["value"], k, xerr=half, fmt="o", color=FLIGHT, ms=4, lw=1.0, capsize=2
        )
    low, high = (factor * end for end in finding["ci95"])
    value, place = factor * finding["value"], len(votes) + 0.15
    panel.fill([low, value, high, value], [place, place - 0.32, place, place + 0.32], color=UPDATED)
    panel.axvspan(low, high, color=UPDATED, alpha=0.12, lw=0, zorder=0)
    panel.axvline(0.0, color="0.4", lw=0.8)
    names = [voter(vote["flight"], labels) for vote in votes]
    every = math.ceil(_LINE / pitch)
    panel.set_yticks([*range(0, len(votes), every), place], [*names[::every], "combined"])
    panel.set_ylim(len(votes) + 0.8, -0.7)
    plain_panel(panel)
    panel.grid(False, axis="y")
    panel.set_xlabel(label)
    return figure


def voter(name: str, labels: Mapping[str, str]) -> str:
    """Return the label of an estimate: the display name of the flight, and the interval [s] of a
    part of one (`SamplingUnit`).

    A part of a flight is named ``<flight>@0-5.65491``.

    >>> voter("abc@0-5.65491", {"abc": "first.mat"})
    'first.mat 0-5.65 s'
    """
    unit = SamplingUnit.parse(name)
    flight, window = unit.flight, unit.window
    whole = in_figure(
        next(
            (label for id, label in labels.items() if id == flight or id.startswith(flight)),
            flight[:12],
        )
    )
    return whole if window is None else f"{whole} {window[0]:.3g}-{window[1]:.3g} s"


def moving_variables(
    channels: Mapping[str, Mapping[str, Array]], names: Sequence[str]
) -> list[str]:
    """Select the `names` that vary in these flights (id -> channels (n,), SI units)."""
    moving = []
    for name in names:
        values = [held[name][np.isfinite(held[name])] for held in channels.values() if name in held]
        pooled = np.concatenate(values) if values else np.empty(0)
        if len(pooled) and np.ptp(np.quantile(pooled, [0.05, 0.95])) > _moves(name):
            moving.append(name)
    return moving


def _moves(name: str) -> float:
    # rates without dimension are a hundred times smaller than angles
    return 0.02 * _MOVES if name.endswith("_hat") else _MOVES


def residual_figure(
    axes: Sequence[str],
    variables: Sequence[str],
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    channels: Mapping[str, Mapping[str, Array]],
    floors: Mapping[str, float],
) -> Figure:
    """Draw the residual over the variables on which it depends most, before and after: median and
    80 % band.

    before, after : flight id -> comparison, `after` empty where nothing was updated; channels :
    flight id -> name -> (n,); floors : axis -> rms of the noise, drawn as a grey band. A row per
    axis, with at most `_COLUMNS` of the variables. Six rows fill a page.
    """
    rows = {axis: _ranked(axis, variables, (before, after), channels)[:_COLUMNS] for axis in axes}
    columns = max(2, *(len(row) for row in rows.values()), 0)
    figure, panels = panel_grid(
        (PAGE_WIDTH, 0.3 + 1.48 * max(1, len(axes))),
        max(1, len(axes)),
        columns,
        left=0.85,
        right=0.15,
        between=(0.15, 0.5),
        sharey="row",
    )
    for row, (axis, names) in zip(panels, rows.items(), strict=False):
        for panel, name in zip(row, names, strict=False):
            floor = floors.get(axis, 0.0)
            panel.axhspan(-floor, floor, color="0.85", lw=0, zorder=0, label="noise floor")
            _left_over(panel, axis, name, (before, after), channels)
            panel.set_xlabel(channel_scale(name)[1], size=SMALLEST, labelpad=1)
        for panel in row[max(1, len(names)) :]:
            panel.set_visible(False)
        row[0].set_ylabel(f"{axis} [-]")
    if rows:
        handles, texts = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="upper right", fontsize=SMALLEST, ncols=3, frameon=False)
    return figure


def _ranked(
    axis: str,
    variables: Sequence[str],
    sides: tuple[Mapping[str, Comparison], Mapping[str, Comparison]],
    channels: Mapping[str, Mapping[str, Array]],
) -> list[str]:
    """Sort the variables by the largest mean square that the residual's bin means have over them,
    before or after, the largest first; variables with too few samples are left out."""
    shares = dict[str, float]()
    for name in variables:
        for side in sides:
            x, y = _samples(axis, name, side, channels)
            place = _places(x)
            if place is not None:
                count = np.maximum(1, np.bincount(place))
                mean = np.bincount(place, y - y.mean()) / count
                share = float(count @ mean**2) / len(y)
                shares[name] = max(shares.get(name, 0.0), share)
    return sorted(shares, key=lambda name: -shares[name])


def _left_over(
    panel: Any,
    axis: str,
    name: str,
    sides: tuple[Mapping[str, Comparison], Mapping[str, Comparison]],
    channels: Mapping[str, Mapping[str, Array]],
) -> None:
    factor, _ = channel_scale(name)
    looks: tuple[tuple[str, Any, str], ...] = (
        (DATABASE, DATABASE_LINE, "database"),
        (UPDATED, "-", "updated database"),
    )
    for side, (colour, line, text) in zip(sides, looks, strict=True):
        if not side:
            continue
        at, low, middle, high = _binned(*_samples(axis, name, side, channels))
        panel.fill_between(factor * at, low, high, color=colour, alpha=0.16, lw=0)
        panel.plot(factor * at, middle, color=colour, ls=line, lw=1.3, label=text)
    panel.axhline(0.0, color="0.4", lw=0.6)
    plain_panel(panel)
    panel.xaxis.set_major_locator(MaxNLocator(3))


def _samples(
    axis: str,
    name: str,
    side: Mapping[str, Comparison],
    channels: Mapping[str, Mapping[str, Array]],
) -> tuple[Array, Array]:
    """The variable and the residual (n,) of all flights, at most `_SAMPLES`."""
    pairs = [
        (
            channels[flight][name][comparison.usable[axis]],
            comparison.residual(axis)[comparison.usable[axis]],
        )
        for flight, comparison in side.items()
        if axis in comparison.usable and name in channels.get(flight, {})
    ]
    x, y = (np.concatenate([pair[k] for pair in pairs]) if pairs else np.empty(0) for k in (0, 1))
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    known = known[:: max(1, len(known) // _SAMPLES)]
    return x[known], y[known]


def _places(x: Array) -> NDArray[np.intp] | None:
    """The bin (n,) of each value, or None for too few of them.

    Bins of equally many samples: narrow where the flights have been, wide where they passed.
    """
    count = min(_BINS, len(x) // _FEWEST_IN_BIN)
    return None if count < _FEWEST_BINS else np.digitize(x, _edges(x, count)[1:-1])


def _binned(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Median of the variable per bin, and the residual's 10 %, 50 % and 90 % quantiles there.

    All four are empty for too few samples.
    """
    place = _places(x)
    if place is None:
        none = np.empty(0)
        return none, none, none, none
    bins = [(x[place == k], y[place == k]) for k in np.unique(place)]
    summary = np.array([[np.median(at), *np.quantile(left, _BAND)] for at, left in bins])
    return summary[:, 0], summary[:, 1], summary[:, 2], summary[:, 3]


def _edges(x: Array, count: int) -> Array:
    """Edges of at most `count` equally filled bins of `x` (n,), none narrower than `_NARROWEST`."""
    wanted = np.quantile(x, np.linspace(0.0, 1.0, count + 1))
    low, high = np.quantile(x, [0.01, 0.99])
    edges = [float(wanted[0])]
    for edge in wanted[1:-1]:
        if edge - edges[-1] >= _NARROWEST * (high - low) and wanted[-1] - edge > 0.0:
            edges.append(float(edge))
    return np.array([*edges, float(wanted[-1])])


def stall_figure(stalls: Sequence[Mapping[str, Any]], labels: Mapping[str, str]) -> Figure:
    """Draw the lift coefficient [-] in each flight's stall over alpha [deg] and over time [s].

    stalls : of the document (docs/reference/contract.md, section JSON). labels : flight (id) -> its
    name.
    """
    rows = len(stalls)
    figure, panels = panel_grid((PAGE_WIDTH, 0.75 + 2.7 * rows), rows, 2, between=(0.7, 0.75))
    looks: tuple[tuple[str, dict[str, Any]], ...] = (
        ("measured", {"color": FLIGHT, "lw": 2.0, "label": "flight"}),
        ("before", {"color": DATABASE, "lw": 1.2, "ls": "--", "label": "database"}),
        ("held", {"color": UPDATED, "lw": 1.4, "label": "predicted by the others"}),
    )
    for (over_alpha, over_time), entry in zip(panels, stalls, strict=True):
        series = entry["series"]
        for name, look in looks:
            over_alpha.plot(np.degrees(series["alpha"]), series[name], **look)
            over_time.plot(series["time"], series[name], **look)
        error = f"error {entry['before']['C_lift']:.2g} to {entry['held']['C_lift']:.2g}"
        title = in_figure(labels.get(entry["flight"], entry["flight"][:12]))
        over_alpha.set_title(
            f"{title}: {error} (below {entry['band']:.2g} Hz)", fontsize=9, loc="left"
        )
        over_alpha.set_xlabel("alpha [deg]")
        over_alpha.set_ylabel("C_lift")
        over_time.set_xlabel("time [s]")
        for panel in (over_alpha, over_time):
            plain_panel(panel)
        over_time.legend(fontsize=SMALLEST, frameon=False)
    return figure
