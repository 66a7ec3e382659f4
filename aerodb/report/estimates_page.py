"""Page of estimates by several methods: the table, fitted responses, and whiteness of residuals."""

from collections import Counter
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.nomenclature import CHANNELS, channel, is_surface
from aerodb.report.glossary import listed
from aerodb.report.head import Head
from aerodb.report.labels import channel_scale
from aerodb.report.numbers import for_people, number
from aerodb.report.page import render
from aerodb.report.style import (
    FLIGHT,
    PAGE_WIDTH,
    SMALLEST,
    UPDATED,
    Picture,
    panel_grid,
    plain_panel,
)
from aerodb.report.terms import correlation_rows, derivative_unit
from aerodb.support import Array, counted

#: How the parameter of a state's process noise begins.
_PROCESS_NOISE: Final = "process_noise_"
#: Most records of a method that are drawn.
_MOST: Final = 4
#: Lags of an autocorrelation that are drawn.
_LAGS: Final = 60
#: Responses side by side.
_COLUMNS: Final = 3

#: Figure of a mode -> words and unit.
_MODE_FIGURES: Final = {
    "omega": ("natural frequency", "rad/s"),
    "zeta": ("damping ratio", ""),
    "period": ("period", "s"),
    "time_constant": ("time constant", "s"),
    "time_to_half": ("time to half", "s"),
    "time_to_double": ("time to double", "s"),
}

#: Method -> record -> response -> time [s], fitted and residual, (n,) each.
Response = tuple[Array, Array, Array]
Responses = Mapping[str, Mapping[str, Mapping[str, Response]]]


def estimates_report(
    document: Mapping[str, Any], responses: Responses, head: Head | None = None
) -> str:
    """Return the HTML page of the document of `estimate_by_methods`.

    responses : fitted responses and residuals of each method. head : where the result comes from.
    Numbers are shown in the units of the document, angles of histories in [deg].
    """
    believe = document["believe"]
    several = len(document["methods"]) > 1
    preferred = document.get("preferred")  # documents of earlier releases lack it
    verdict = (
        "No method gives an answer to believe."
        + (f" The least doubtful is {preferred}." if preferred else "")
        if believe is None
        else f"Believe here: {believe}."
        if several
        else f"Estimates by {believe}."
    )
    return render(
        "estimates.html",
        title=_title(document),
        several=several,
        document=document,
        head=head,
        verdict=verdict,
        stayed=_stayed(document),
        mode_figures=_MODE_FIGURES,
        correlations={
            entry["method"]: [
                correlation_rows(each["names"], each["correlation"])
                for each in entry.get("correlations", ())
            ]
            for entry in document["methods"]
        },
        units={
            each["name"]: _unit(each["name"], each["unit"])
            for entry in document["methods"]
            for each in entry.get("estimates", ())
        },
        drawn={
            entry["method"]: [
                _picture(entry["method"], record, outputs)
                for record, outputs in [*responses.get(entry["method"], {}).items()][:_MOST]
            ]
            for entry in document["methods"]
        },
    )


def _title(document: Mapping[str, Any]) -> str:
    """Return what was estimated from what."""
    records = [each["record"] for each in document.get("records", ())]
    if records:
        return f"Estimates of a linear model from {listed(records)}"
    count = len(document.get("flights", ()))
    if not count:
        return "Estimates"
    return f"Estimates from {counted(count, 'flight')}"


def _unit(parameter: str, unit: str) -> tuple[float, str]:
    """Factor and label of the display unit of a parameter; the root of the intensity of a state's
    process noise is per root of a second."""
    state = parameter.removeprefix(_PROCESS_NOISE)
    if state != parameter and (state in CHANNELS or is_surface(state)):
        factor, label = for_people(channel(state).unit)
        return factor, f"{label}/√s"
    derivative = derivative_unit(parameter) if unit == "1" else None
    return for_people(unit) if derivative is None else (1.0, derivative)


def _stayed(document: Mapping[str, Any]) -> str:
    """Return what the methods leave open: those without an estimate, parameters on which they
    disagree, and parameters that are not simply estimated."""
    silent = [entry["method"] for entry in document["methods"] if "reason" in entry]
    apart = [row for row in document["parameters"] if row["agree"] is False]
    other = [
        (method, each["standing"])
        for row in document["parameters"]
        for method, each in row["estimates"].items()
        if each["standing"] != "estimated"
    ]
    clauses = [f"no estimate by {listed(silent)}"] if silent else []
    if apart:
        worst = max(apart, key=lambda row: row["spread"] or 0.0)
        clauses.append(
            f"methods disagree on {len(apart)} of {len(document['parameters'])} parameters, most on"
            f" {worst['parameter']} ({number(worst['spread'], 2)} standard errors)"
        )
    clauses += [
        f"{method}: {counted(count, 'parameter')} {standing}"
        for (method, standing), count in Counter(other).items()
    ]
    return f"Left: {'; '.join(clauses)}." if clauses else "Nothing is left."


def _picture(method: str, record: str, outputs: Mapping[str, Response]) -> Picture:
    caption = (
        f"Record {record[:16]}. Above: measured and fitted. Below: autocorrelation of the residual;"
        " white residuals stay within the dashed lines 95 % of the time."
    )
    return Picture(partial(_figure, outputs), f"{method}: fitted responses of a record.", caption)


def _figure(outputs: Mapping[str, Response]) -> Figure:
    """Responses of a record, three side by side: measured and fitted, and below the autocorrelation
    of the residual."""
    columns = min(_COLUMNS, max(1, len(outputs)))
    blocks = max(1, -(-len(outputs) // columns))
    figure, panels = panel_grid(
        (PAGE_WIDTH, 0.5 + 3.6 * blocks), 2 * blocks, columns, left=0.7, right=0.1
    )
    for panel in panels.ravel():
        panel.set_visible(False)
    for place, (name, (time, fitted, residual)) in enumerate(outputs.items()):
        block, k = divmod(place, columns)
        factor, label = channel_scale(name)
        above, below = panels[2 * block, k], panels[2 * block + 1, k]
        above.plot(time, factor * (fitted + residual), color=FLIGHT, lw=1.4, label="measured")
        above.plot(time, factor * fitted, color=UPDATED, lw=1.0, label="fitted")
        above.set_ylabel(label)
        above.set_xlabel("time [s]")
        correlation, bound = _autocorrelation(residual)
        step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
        below.plot(step * np.arange(len(correlation)), correlation, color=UPDATED, lw=1.2)
        for sign in (-1.0, 1.0):
            below.axhline(sign * bound, color="0.5", ls="--", lw=0.8)
        below.set_ylim(-1.05, 1.05)
        below.set_xlabel("lag [s]")
        if k == 0:
            below.set_ylabel("autocorrelation")
        for panel in (above, below):
            panel.set_visible(True)
            plain_panel(panel)
    if outputs:
        panels[0, 0].legend(fontsize=SMALLEST, frameon=False)
    return figure


def _autocorrelation(residual: Array) -> tuple[Array, float]:
    """Autocorrelation (l,) of a residual (n,), and the bound of that of white noise."""
    good = residual[np.isfinite(residual)]
    n = len(good)
    power = float(good @ good)
    if n < 3 or power <= 0.0:
        return np.ones(1), 1.0
    lags = min(_LAGS, n - 1)
    values = [float(good[: n - k] @ good[k:]) / power for k in range(lags)]
    return np.array(values), 1.96 / float(np.sqrt(n))
