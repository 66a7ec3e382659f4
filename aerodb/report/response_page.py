"""Page of simulated responses: a version flown beside the flight, manoeuvre by manoeuvre."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.report.gate_lines import count_within
from aerodb.report.glossary import listed
from aerodb.report.head import Head
from aerodb.report.labels import channel_scale
from aerodb.report.page import pieces
from aerodb.report.qualification import feedback_words, qualification_table
from aerodb.report.style import (
    DATABASE,
    DATABASE_LINE,
    FLIGHT,
    PAGE_HEIGHT,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    Picture,
    panel_grid,
    plain_panel,
)
from aerodb.support import Array

#: Responses drawn, in the order of the panels.
_DRAWN: Final = ("alpha", "q", "theta", "az", "V", "beta", "p", "r", "phi", "ay")
#: Most manoeuvres drawn on one page.
_MOST: Final = 40

#: How the band of a tolerance is drawn.
_BAND: Final[dict[str, Any]] = {"color": FLIGHT, "alpha": 0.2, "lw": 0}
#: Room of a panel above and below the flight, as a part of its range.
_ROOM: Final = 0.4

Responses = Mapping[str, tuple[Array, Array, Array]]


@dataclass(frozen=True)
class FlownStretch:
    """A stretch of a flight as flown and as simulated.

    flight : its name. document : of the stretch (`fly_version`). after, before : response -> time
    [s], simulated, flown, of the version and of its baseline; before may be empty.
    """

    flight: str
    document: Mapping[str, Any]
    after: Responses
    before: Responses


def response_report(
    version: str,
    baseline: str,
    summary: Mapping[str, Any] | None,
    stretches: Iterable[FlownStretch],
    head: Head | None = None,
    flown: int = 0,
) -> Iterator[str]:
    """Return the HTML page of a version's responses in pieces (`pieces`).

    version, baseline : labels; baseline empty without one. summary : of `summarise_responses`.
    stretches : each is asked for when its figure is drawn. head : where the result comes from.
    flown : how many stretches there are. Numbers are shown in display units (`channel_scale`).
    """
    return pieces(
        "responses.html",
        title=f"Responses of version {version}",
        version=version,
        baseline=baseline,
        summary=summary,
        head=head,
        within=count_within(summary, baseline) if summary else "",
        stayed=_stayed(summary) if summary else "",
        drawn=((each, _picture(each, version, baseline)) for each in islice(stretches, _MOST)),
        left_out=max(0, flown - _MOST),
        scales=response_scales(summary),
        feedback=feedback_words(summary) if summary else [],
        qualification=qualification_table(summary),
    )


def _stayed(summary: Mapping[str, Any]) -> str:
    """Checks outside tolerance, those most often outside first, and what was not flown."""
    failed = [entry["check"] for entry in summary["failed"]]
    often = sorted(dict.fromkeys(failed), key=lambda check: -failed.count(check))
    clauses = []
    if often:
        named = listed([f"{check} ({failed.count(check)})" for check in often])
        clauses.append(f"outside tolerance {named}")
    if summary["not_flown"]:
        clauses.append(f"{len(summary['not_flown'])} stretches not flown")
    if not summary["independent"]:
        clauses.append("the flights also identified the version")
    return f"Left: {'; '.join(clauses)}." if clauses else "Nothing is left."


def response_scales(summary: Mapping[str, Any] | None) -> dict[str, tuple[float, str]]:
    """Return factor and label of each response of a summary, for the tables of its page: from SI to
    display units, see `channel_scale`."""
    told = summary["responses"] if summary else ()
    return {r["channel"]: channel_scale(r["channel"]) for r in told}


def _picture(stretch: FlownStretch, version: str, baseline: str) -> Picture:
    document = stretch.document
    failed = [check["check"] for check in document["checks"] if not check["passed"]]
    said = [
        f"outside tolerance: {', '.join(failed)}" if failed else "",
        "feedback closed (least stabilising); largest correction "
        + f"{np.rad2deg(max(document['correction'].values())):.2g} deg"
        if document["correction"]
        else "",
        *document["notes"],
    ]
    return Picture(
        partial(response_figure, stretch, version, baseline),
        f"{stretch.flight}, {document['since']:.1f} to {document['until']:.1f} s: simulated and"
        " flown responses.",
        ". ".join(part for part in said if part),
    )


def response_figure(stretch: FlownStretch, version: str, baseline: str) -> Figure:
    """Draw the responses (n,) of a stretch over time [s] in display units (`channel_scale`):
    flight with the bands of its checks, version, baseline."""
    names = [name for name in _DRAWN if name in stretch.after]
    names += [name for name in stretch.after if name.startswith("delta_")]
    bands = tolerance_bands(stretch.document["checks"])
    columns = 3
    rows = max(1, -(-len(names) // columns))
    height = min(1.75, (PAGE_HEIGHT - 0.6) / rows)
    figure, panels = panel_grid(
        (PAGE_WIDTH, 0.6 + height * rows),
        rows,
        columns,
        left=0.7,
        right=0.1,
        top=0.4,  # for the legend, which would lie on a curve inside a panel
        between=(0.7, 0.4),
    )
    for panel, name in zip(panels.ravel(), names, strict=False):
        factor, label = channel_scale(name)
        time, simulated, flown = stretch.after[name]
        if np.isfinite(flown).any():
            panel.plot(time, factor * flown, color=FLIGHT, lw=1.6, label="flight")
        width = factor * bands.get(name, 0.0)
        if width:
            panel.fill_between(time, factor * flown - width, factor * flown + width, **_BAND)
        limits = _limits(factor * flown, width)
        if name in stretch.before:
            at, earlier, _ = stretch.before[name]
            panel.plot(at, factor * earlier, color=DATABASE, ls=DATABASE_LINE, lw=1.2,
                       label=baseline)  # fmt: skip
        panel.plot(time, factor * simulated, color=UPDATED, lw=1.2, label=version)
        plain_panel(panel)
        if limits:
            panel.set_ylim(*limits)
        panel.set_ylabel(label)
    for panel in panels.ravel()[len(names) :]:
        panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    if names:
        first = panels.ravel()[0]
        if bands:
            first.fill_between([], [], label="tolerance", **_BAND)
        handles, labels = first.get_legend_handles_labels()
        figure.legend(
            handles,
            labels,
            loc="upper center",
            ncols=len(labels),
            fontsize=SMALLEST,
            frameon=False,
        )
    return figure


def tolerance_bands(checks: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Return the half width (SI) of the tolerance about each flown response: the narrowest of the
    checks that judge its time history."""
    widths: dict[str, float] = {}
    for check in checks:
        for band in check.get("bands", ()):
            if not band["of"] and band["limit"] is not None:
                name = band["channel"]
                widths[name] = min(band["limit"], widths.get(name, band["limit"]))
    return widths


def _limits(flown: Array, width: float) -> tuple[float, float] | None:
    """Limits of a panel: the flight's range with some room, at least for the band of tolerance of
    half `width`, so that a simulation that diverges hides neither."""
    good = flown[np.isfinite(flown)]
    if not good.size or np.ptp(good) == 0:
        return None
    room = max(_ROOM * float(np.ptp(good)), 2.0 * width)
    return float(good.min() - room), float(good.max() + room)
