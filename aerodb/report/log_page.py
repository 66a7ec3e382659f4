"""The page of logs without a vehicle: plots of their signals, ground track, what can be learnt from
them, parameters and messages.

A short script on the page says the values under the cursor; it reads the samples that the page
brings with it, and the page works without it.
"""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from importlib import resources
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.errors import InputError, UnknownNameError
from aerodb.logs import Signal
from aerodb.nomenclature import channel
from aerodb.report.labels import in_figure, visible
from aerodb.report.numbers import for_people
from aerodb.report.page import render
from aerodb.report.style import (
    DATABASE,
    FLIGHT,
    MEASURED,
    SMALLEST,
    UPDATED,
    Picture,
    panel_grid,
    plain_panel,
)
from aerodb.support import Array
from aerodb.units import UnitSystem

#: Colours of lines, in order: Okabe & Ito's that are dark enough on white.
_COLOURS: Final = (FLIGHT, UPDATED, DATABASE, "#009E73", "#CC79A7", "#56B4E9", MEASURED)
#: Dashes of the signals of a panel, where the colour says the log.
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)))
#: Most logs on a page: each has a colour of its own.
MOST_LOGS: Final = len(_COLOURS)
#: Width and height [in] of a panel; two stand side by side on a wide screen.
_SIZE: Final = (4.9, 1.9)
_LEFT: Final = 0.7
_RIGHT: Final = 0.12
#: Right margin [in] where a second axis stands there.
_SECOND: Final = 0.65
#: Significant digits of a value under the cursor; a logged single has seven.
_DIGITS: Final = 7


@dataclass(frozen=True)
class LogStory:
    """What the page says of one log.

    panels : its signals, by panel; times count from its first sample. track : time [s], north and
    east [m] (3, n). lines : label and text of what can be learnt from it. said : parameters and
    messages, as ``/api/flights/F/log`` gives them. start : [s] of the first sample on its clock.
    timed : false for a table whose time nothing names; its samples are counted instead.
    """

    name: str
    verdict: str
    because: Sequence[str]
    lines: Sequence[tuple[str, str]]
    panels: Sequence[Sequence[Signal]]
    track: Array | None
    said: Mapping[str, Any]
    start: float
    start_utc: datetime | None
    timed: bool = True


def log_report(stories: Sequence[LogStory], units: UnitSystem | None = None) -> str:
    """Render logs as one HTML page: a panel for each of their common panels, in the units of a
    system, angles in degrees (`UnitSystem`); it fetches nothing.

    Raises InputError for more than `MOST_LOGS` logs, and for a panel of more than two units.
    """
    if len(stories) > MOST_LOGS:
        raise InputError(f"{len(stories)} logs", "log show", f"give at most {MOST_LOGS} at once")
    panels = [
        _Panel.of([(story.name, story.panels[k]) for story in stories], units)
        for k in range(len(stories[0].panels))
    ]
    right = _SECOND if any(len(panel.units) > 1 for panel in panels) else _RIGHT
    ends = [each.time[[0, -1]] for p in panels for each in p.lines if len(each.time)]
    limits = (float(np.min(ends)), float(np.max(ends))) if ends else (0.0, 1.0)
    if limits[1] <= limits[0]:
        limits = (limits[0], limits[0] + 1.0)
    track = _track(stories, units)
    code, timed = script(), all(story.timed for story in stories)
    return render(
        "log.html",
        title=", ".join(story.name for story in stories),
        stories=stories,
        panels=[(panel, panel.drawn(limits, right, timed)) for panel in panels],
        track=track,
        data={
            "limits": limits,
            "unit": "s" if timed else "samples",
            "left": _LEFT / _SIZE[0],
            "right": 1.0 - right / _SIZE[0],
            "panels": [panel.data for panel in panels],
        },
        code=code,
        policy=script_source(),
    )


@cache
def script() -> str:
    """The script of the page."""
    return (resources.files("aerodb.report") / "templates" / "log.js").read_text("utf-8")


@cache
def script_source() -> str:
    """The source of a content security policy (CSP, level 2) that allows this script alone."""
    digest = hashlib.sha256(script().encode()).digest()
    return f"script-src 'sha256-{base64.b64encode(digest).decode()}'"


@dataclass(frozen=True)
class _Line:
    """A line of a panel in its display unit."""

    label: str
    unit: str
    time: Array
    values: Array
    colour: str
    dash: Any


@dataclass(frozen=True)
class _Panel:
    """The same signals of several logs; `units` : one or two, the second on the right."""

    title: str
    units: tuple[str, ...]
    lines: tuple[_Line, ...]

    @classmethod
    def of(
        cls, logs: Sequence[tuple[str, Sequence[Signal]]], system: UnitSystem | None
    ) -> "_Panel":
        lines, units = [], dict[str, None]()
        several = len(logs) > 1
        every = [signal for _, signals in logs for signal in signals]
        topics = {each.name.partition(":")[0] for each in every}
        of = f"{topics.pop()}:" if len(topics) == 1 and len(logs[0][1]) > 1 else ""
        for k, (log, signals) in enumerate(logs):
            for j, signal in enumerate(signals):
                factor, unit = for_people(signal.unit, system) if signal.unit else (1.0, "")
                units[unit] = None
                short = signal.name.removeprefix(of)
                label = f"{log}: {short}" if several and len(signals) > 1 else short
                label = log if several and len(signals) == 1 else label
                colour = _COLOURS[(k if several else j) % len(_COLOURS)]
                dash = _DASHES[(j if several else 0) % len(_DASHES)]
                values = factor * signal.values
                lines.append(_Line(label, unit, signal.time, values, colour, dash))
        names = dict.fromkeys(_titled(signal, of) for signal in every)
        if len(units) > 2:
            raise InputError(
                f"a panel of {len(units)} units: {', '.join(units)}",
                ", ".join(names),
                "put signals of two units at most into one panel",
            )
        title = f"{of} {', '.join(names)}" if of else ", ".join(names)
        return cls(title, tuple(units), tuple(lines))

    @property
    def keys(self) -> list[tuple[str, str, str]]:
        """Label, colour and line style of each line, where there are several."""
        if len(self.lines) < 2:
            return []
        styles = ("solid", "dashed", "dotted", "double")
        return [(x.label, x.colour, styles[_DASHES.index(x.dash)]) for x in self.lines]

    @property
    def data(self) -> list[dict[str, Any]]:
        """Samples of the lines, for the cursor."""
        return [
            {
                "label": visible(line.label),
                "unit": line.unit,
                "time": [round(t, 4) for t in line.time.tolist()],
                "values": [_digits(value) for value in line.values.tolist()],
            }
            for line in self.lines
        ]

    def drawn(self, limits: tuple[float, float], right: float, timed: bool) -> Picture:
        """The panel as a picture, its axis of time [s], or of samples, between the same places on
        each."""
        figure, panels = panel_grid(_SIZE, 1, 1, left=_LEFT, right=right, top=0.12, bottom=0.42)
        first = panels[0][0]
        second = first.twinx() if len(self.units) > 1 else None
        for line in self.lines:
            panel = second if second is not None and line.unit != self.units[0] else first
            look: dict[str, Any] = {"color": line.colour, "ls": line.dash, "lw": 0.9}
            panel.plot(line.time, line.values, **look)
        plain_panel(first)
        first.set_xlim(*limits)
        first.set_xlabel("time [s]" if timed else "sample [-]")
        first.set_ylabel(_axis_label(self, self.units[0]), fontsize=9)
        if second is not None:
            second.set_ylabel(_axis_label(self, self.units[1]), fontsize=9)
            second.spines[["top", "left"]].set_visible(False)
            second.tick_params(labelsize=SMALLEST, length=3)
        return Picture(lambda: figure, f"{self.title} over time.")


def _axis_label(panel: _Panel, unit: str) -> str:
    names = dict.fromkeys(line.label for line in panel.lines if line.unit == unit)
    name = next(iter(names)) if len(names) == 1 else ""
    return in_figure(f"{name} [{unit or 'unit not logged'}]".strip(), 34)


def _titled(signal: Signal, of: str) -> str:
    """Return the name of a signal, without the topic `of` all, with its meaning if it is a
    channel."""
    try:
        return f"{signal.name}: {channel(signal.name).description}"
    except UnknownNameError:
        return signal.name.removeprefix(of)


def _digits(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None


def _track(stories: Sequence[LogStory], units: UnitSystem | None) -> Picture | None:
    """The ground tracks, north over east, a dot where each begins."""
    if all(story.track is None for story in stories):
        return None
    figure = Figure(figsize=(_SIZE[0], 4.2), layout="constrained")
    panel = figure.subplots()
    factor, unit = for_people("m", units)
    for story, colour in zip(stories, _COLOURS, strict=False):
        if story.track is None:
            continue
        north, east = factor * story.track[1:]
        panel.plot(east, north, color=colour, lw=0.9, label=in_figure(story.name))
        panel.plot(east[:1], north[:1], "o", color=colour, ms=5)
    plain_panel(panel)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"east [{unit}]")
    panel.set_ylabel(f"north [{unit}]")
    if len(stories) > 1:
        panel.legend(fontsize=SMALLEST, frameon=False)
    return Picture(lambda: figure, "Path over the ground, north over east.", "Dot: first sample.")
