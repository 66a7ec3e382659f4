"""Figures of one flight: channels, coefficients compared with a database, segments, envelope."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.coefficients import Comparison
from aerodb.conditioning import STATES, Segment
from aerodb.flight import Flight
from aerodb.nomenclature import axis_description, in_order, is_surface
from aerodb.report.decimation import decimated, extremes, flagged_stretches
from aerodb.report.labels import channel_scale
from aerodb.report.numbers import display_unit
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    FLAGGED,
    FLIGHT,
    MEASURED,
    PAGE_WIDTH,
    SMALLEST,
    panel_grid,
    plain_panel,
)
from aerodb.tables import AeroDatabase, breakpoints_over

#: Channels drawn, in this order; control surfaces follow.
SHOWN: Final = (
    *("V", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi"),
    *("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu", "altitude", "mach", "qbar"),
)
_MOST_SURFACES: Final = 9
#: Points of a line in a narrow panel, as `decimated` thins it.
_NARROW: Final = 360
#: Points of a residual.
_MIDDLE: Final = 400
#: Points of a measured or predicted coefficient.
_WIDE: Final = 600
#: Most samples of a cloud of points.
_CLOUD: Final = 1500

#: Pairs of channels whose planes show the flight envelope.
PLANES: Final = (("alpha", "beta"), ("mach", "alpha"), ("V", "altitude"))


def shown_channels(flight: Flight) -> list[str]:
    """Return the names of a flight's channels that a report draws: those of `SHOWN` and at most
    `_MOST_SURFACES` surfaces."""
    surfaces = [
        name for name in flight.channels if is_surface(name) or name == "delta_landing_gear"
    ]
    return [name for name in SHOWN if name in flight] + sorted(surfaces)[:_MOST_SURFACES]


def channel_figure(names: Sequence[str], measured: Flight, flight: Flight) -> Figure:
    """Draw each channel (n,) as measured (grey) and reconstructed (black) over time [s], in display
    units (`channel_scale`); unused parts are shaded."""
    columns = min(2, max(1, len(names)))
    rows = max(1, -(-len(names) // columns))
    figure, panels = panel_grid(
        (PAGE_WIDTH, 0.6 + 1.07 * rows),
        rows,
        columns,
        left=0.6,
        right=0.1,
        between=(0.65, 0.32),
        sharex=True,
    )
    for panel, name in zip(panels.ravel(), names, strict=False):
        _channel(panel, name, measured, flight)
    for panel in panels.ravel()[len(names) :]:
        panel.set_axis_off()
    panels[0][0].set_xlim(*_whole(flight))
    for k in range(columns):
        last = panels[(len(names) - 1 - k) // columns if len(names) > k else 0][k]
        last.set_xlabel("time [s]")
        last.tick_params(labelbottom=True)
    return figure


def _channel(panel: Any, name: str, measured: Flight, flight: Flight) -> None:
    factor, label = channel_scale(name)
    moved = factor * (flight[name] - measured[name]) if name in measured else np.zeros(1)
    if np.nanmax(np.abs(moved), initial=0.0) > 0.0:
        panel.plot(
            *decimated(measured.time, factor * measured[name], _NARROW), color=MEASURED, lw=1.8
        )
        size = f"{np.sqrt(np.nanmean(moved**2)):.2g} {display_unit(name)[1] or ''}".rstrip()
        panel.set_title(
            f"corrected by {size} rms", loc="right", fontsize=SMALLEST, color="0.35", pad=2
        )
    panel.plot(*decimated(flight.time, factor * flight[name], _NARROW), color=FLIGHT, lw=0.8)
    for start, end in flagged_stretches(flight.time, ~flight.usable([name]), most=60):
        panel.axvspan(start, end + flight.step, color=FLAGGED, lw=0, zorder=0)
    plain_panel(panel)
    panel.set_title(label, loc="left", fontsize=8.5, pad=2)


def coefficient_figure(comparison: Comparison, flight: Flight) -> Figure:
    """Draw a row per axis: coefficient [-] over time [s], residual with noise band, coefficient
    over angle [deg].

    The angle is alpha on longitudinal and beta on lateral axes. Arrays are those of the comparison,
    (n,) per axis.
    """
    axes = in_order(comparison.usable)
    rows = max(1, len(axes))
    figure, panels = panel_grid(
        (PAGE_WIDTH, 0.6 + 1.43 * rows),
        rows,
        3,
        left=0.8,
        right=0.1,
        top=0.4,
        between=(0.8, 0.5),
        width_ratios=(1.5, 1.2, 1),
    )
    for (left, middle, right), axis in zip(panels, axes, strict=False):
        _coefficient(left, axis, comparison)
        _left(middle, axis, comparison)
        _against(right, axis, comparison, flight)
    for row in panels:
        for panel in row[:2]:
            panel.set_xlim(*_whole(flight))
    for panel in panels[-1][:2]:
        panel.set_xlabel("time [s]")
    if axes:
        handles, texts = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="upper right", fontsize=SMALLEST, ncols=2, frameon=False)
        panels[0][1].set_title("flight − database", fontsize=SMALLEST, loc="right", color="0.35")
    return figure


def _left(panel: Any, axis: str, comparison: Comparison) -> None:
    """Draw the residual over time between twice the standard errors of its noise."""
    residual = np.where(comparison.usable[axis], comparison.residual(axis), np.nan)
    chosen = extremes(residual, _MIDDLE)
    sigma = np.where(comparison.usable[axis], comparison.sigma[axis], np.nan)[chosen]
    time, wide = comparison.time[chosen], sigma > 0.05 * np.nanmax(np.abs(residual), initial=0.0)
    panel.plot(time, residual[chosen], color=DATABASE, lw=0.7)
    for side in (-2.0, 2.0):
        # over the residual, which would hide a band; too narrow to be told from zero it is left out
        panel.plot(time, np.where(wide, side * sigma, np.nan), color=FLIGHT, lw=0.5, zorder=3)
    panel.axhline(0.0, color="0.4", lw=0.6)
    plain_panel(panel)
    panel.set_ylabel(f"Δ{axis} [-]")


def _coefficient(panel: Any, axis: str, comparison: Comparison) -> None:
    good = comparison.usable[axis]
    measured = np.where(good, comparison.measured[axis], np.nan)
    predicted = np.where(good, comparison.predicted[axis], np.nan)
    chosen = extremes(measured, _WIDE)
    time, sigma = comparison.time[chosen], comparison.sigma[axis][chosen]
    low, high = measured[chosen] - 2 * sigma, measured[chosen] + 2 * sigma
    panel.fill_between(time, low, high, color="0.8", lw=0, zorder=1)
    panel.plot(time, measured[chosen], color=FLIGHT, lw=0.8, label="flight")
    panel.plot(
        *decimated(comparison.time, predicted, _WIDE),
        color=DATABASE,
        lw=1.0,
        ls=DATABASE_LINE,
        label="database",
    )
    plain_panel(panel)
    panel.set_ylabel(f"{axis} [-]")
    panel.set_title(axis_description(axis), fontsize=SMALLEST, loc="left", color="0.35")


def _against(panel: Any, axis: str, comparison: Comparison, flight: Flight) -> None:
    variable = "alpha" if axis in ("CX", "CZ", "Cm") else "beta"
    plain_panel(panel)
    if variable not in flight:
        panel.set_axis_off()
        return
    chosen = _thinned(comparison.usable[axis])
    factor, label = channel_scale(variable)
    at = factor * flight[variable][chosen]
    look: dict[str, Any] = {"ls": "", "marker": "o", "mew": 0.0, "rasterized": True}
    panel.plot(at, comparison.predicted[axis][chosen], color=DATABASE, ms=3.4, alpha=0.5, **look)
    panel.plot(at, comparison.measured[axis][chosen], color=FLIGHT, ms=1.3, **look)
    panel.locator_params(axis="x", nbins=4)
    panel.set_xlabel(label)


def segment_figure(segments: Sequence[Segment], flight: Flight) -> Figure:
    """Draw the segments over time [s], a row per kind (`Segment.kind`): manoeuvres black, states
    grey."""
    kinds = list(
        dict.fromkeys(
            segment.kind for segment in sorted(segments, key=lambda each: each.kind in STATES)
        )
    )
    figure = Figure(figsize=(PAGE_WIDTH, 0.6 + 0.22 * max(1, len(kinds))), layout="constrained")
    panel = figure.subplots()
    for row, kind in enumerate(kinds):
        spans = [(each.start, each.end - each.start) for each in segments if each.kind == kind]
        panel.broken_barh(
            spans,
            (row - 0.36, 0.72),
            color="0.75" if kind in STATES else FLIGHT,
            ec="white",
            lw=0.8,
        )
    panel.set_yticks(range(len(kinds)), [kind.replace("_", " ") for kind in kinds])
    panel.set_ylim(max(0, len(kinds) - 1) + 0.6, -0.6)
    panel.set_xlim(*_whole(flight))
    plain_panel(panel)
    panel.set_xlabel("time [s]")
    return figure


def _whole(flight: Flight) -> tuple[float, float]:
    """First and last time of a flight [s]: the time axis of all its figures."""
    start, end = float(flight.time[0]), float(flight.time[-1])
    return start, end if end > start else start + 1.0


def envelope_figure(flight: Flight, database: AeroDatabase | None) -> Figure:
    """Draw the usable samples (n,) in planes of two channels, in display units (`channel_scale`).

    Dashed lines are the edges of the database's tables, where they are near.
    """
    planes = [(x, y) for x, y in PLANES if x in flight and y in flight]
    figure, panels = panel_grid(
        (PAGE_WIDTH, 2.4), 1, max(1, len(planes)), right=0.1, top=0.12, between=(0.7, 0.4)
    )
    for panel, (x, y) in zip(panels[0], planes, strict=False):
        _plane(panel, x, y, flight, database)
    if not planes:
        panels[0][0].set_axis_off()
        panels[0][0].text(0.5, 0.5, "the log holds no air data", ha="center")
    return figure


def _plane(panel: Any, x: str, y: str, flight: Flight, database: AeroDatabase | None) -> None:
    (x_factor, x_label), (y_factor, y_label) = channel_scale(x), channel_scale(y)
    chosen = _thinned(flight.usable([x, y]))
    panel.plot(
        x_factor * flight[x][chosen],
        y_factor * flight[y][chosen],
        ".",
        color=FLIGHT,
        ms=2.5,
        alpha=0.4,
        rasterized=True,
    )
    for name, factor, low, high, draw, limits in (
        (x, x_factor, *panel.get_xlim(), panel.axvline, panel.set_xlim),
        (y, y_factor, *panel.get_ylim(), panel.axhline, panel.set_ylim),
    ):
        # an edge of the tables shows where it is near; the flown range stays most of the panel
        near = 0.35 * (high - low)
        edges = [factor * edge for edge in table_range(name, database) or ()]
        edges = [edge for edge in edges if low - near <= edge <= high + near]
        for edge in edges:
            draw(edge, color=DATABASE, lw=1.2, ls=DATABASE_LINE)
        limits(
            min([low, *(edge - 0.1 * near for edge in edges)]),
            max([high, *(edge + 0.1 * near for edge in edges)]),
        )
    plain_panel(panel)
    panel.locator_params(axis="x", nbins=4)
    panel.locator_params(axis="y", nbins=5)
    panel.set_xlabel(x_label)
    panel.set_ylabel(y_label)


def table_range(name: str, database: AeroDatabase | None) -> tuple[float, float] | None:
    """Return the lowest and highest breakpoint of a channel in the database's tables (SI units;
    `breakpoints_over`).

    None where no table depends on the channel.
    """
    points = [] if database is None else list(breakpoints_over(name, database))
    return (min(float(p[0]) for p in points), max(float(p[-1]) for p in points)) if points else None


def ranges(
    flight: Flight, names: Sequence[str], database: AeroDatabase | None
) -> list[dict[str, Any]]:
    """Return rows of ranges per channel in display units (`channel_scale`): label, low, median,
    high and table range.

    The range of the tables is None where no table depends on the channel.
    """
    rows = []
    for name in (name for name in names if name in flight):
        values = flight[name][flight.usable([name])]
        if not len(values):
            continue
        factor, label = channel_scale(name)
        tables = table_range(name, database)
        low, middle, high = (float(factor * np.quantile(values, at)) for at in (0.0, 0.5, 1.0))
        reach = None if tables is None else tuple(factor * end for end in tables)
        rows.append({"label": label, "low": low, "median": middle, "high": high, "tables": reach})
    return rows


def _thinned(usable: Any) -> Any:
    """Indices of at most `_CLOUD` usable samples, evenly spread."""
    index = np.flatnonzero(usable)
    return index[:: max(1, -(-len(index) // _CLOUD))]
