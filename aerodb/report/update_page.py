"""The report of an update or a closed loop: the finding in one sentence, what it is worth, why
that, and what stays open."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.nomenclature import AXES
from aerodb.report.diff_figures import diff_figure
from aerodb.report.figures import update_figure
from aerodb.report.flight_errors import disagreements, flight_errors
from aerodb.report.headlines import by_parts, effect_words, error_rows, headline, on_which
from aerodb.report.page import render
from aerodb.report.style import Picture, for_people, picture
from aerodb.report.update_figures import (
    error_figure,
    forest_figure,
    moving_variables,
    residual_figure,
)
from aerodb.support import Array
from aerodb.tables import WIND_AXES, AeroDatabase

#: What each verdict means, for the reader of a report.
MEANS: Final[Mapping[str, str]] = {
    "confirmed": "no rival explains it as well, and no single sensor error takes it away",
    "suspected": "the best explanation, but too few independent flights for the error rate",
    "alias_group": "several explanations fit these flights equally well",
    "ambiguous_sensor": "a sensor error cannot be excluded: the database is left alone",
    "sensor": "belongs to the sensors: back to the flight-path reconstruction",
    "unnamed": "reproducible, but no template of the library fits",
    "not_detected": "nothing found, down to the bound",
    "not_excited": "the flights do not move what would show it",
    "not_separable": "it cannot be told from other effects in these flights",
    "not_testable": "too few flights show it",
}
_WITH_VOTES: Final = 2
#: Where nothing was added, so many of the axes that are farthest from their noise floor are drawn.
_FARTHEST: Final = 3


@dataclass(frozen=True)
class UpdateStory:
    """What there is to tell of an update or a closed loop.

    document : of `report.document` or `report.loop_document`. labels : flight id -> what people
    call it. baseline, candidate : what the versions are called (candidate None: nothing was added)
    and their databases. before, after : flight id -> comparison on the flights that validate, else
    on all; `after` is empty where nothing was added, both where no flight can be compared. channels
    : flight id -> channel -> (n,), hat rates too.
    """

    document: Mapping[str, Any]
    labels: Mapping[str, str]
    baseline: str
    candidate: str | None
    databases: tuple[AeroDatabase, AeroDatabase] | None
    before: Mapping[str, Comparison]
    after: Mapping[str, Comparison]
    channels: Mapping[str, Mapping[str, Array]]


def update_report(story: UpdateStory) -> str:
    """The update as one HTML page."""
    document = story.document
    errors = [
        {**row, "flights": flight_errors(row["axis"], story.before, story.after)}
        for row in error_rows(document)
    ]
    single = len(story.before) > 1 and not by_parts(document)
    drawn = [{**row, "each": list(row["flights"].values()) if single else []} for row in errors]
    if story.candidate is None:
        drawn = [{**row, "after": None} for row in drawn]
    loop = "library" in document
    return render(
        "update.html",
        title=(
            f"{'Closed loop' if loop else 'Update'} of {document['vehicle']}:"
            f" {story.candidate or 'nothing added'}"
        ),
        headline=headline(document),
        story=story,
        document=document,
        closed_loop=loop,
        on_which=on_which(document),
        errors=errors,
        error_picture=picture(
            error_figure(drawn),
            "Error per axis before and after the update, and the noise floor; the table below holds"
            " the same numbers.",
            f"Error {on_which(document)}. Circle: {story.baseline}; "
            f"{f'square: {story.candidate}; ' if story.candidate else ''}"
            "bar: noise floor of the sensors, below which no database can come."
            f"{' Dots: single flights, above before, below after.' if single else ''}",
        ),
        single=list(story.before) if single else [],
        findings=[_told(finding, story) for finding in document["findings"]],
        undecided=_bounds(
            entry for entry in document["not_found"] if entry["verdict"] != "not_detected"
        ),
        excluded=_bounds(
            entry for entry in document["not_found"] if entry["verdict"] == "not_detected"
        ),
        means=MEANS,
        changed=disagreements(document, list(document["axes"]), story.before),
        pictures=_pictures(story),
    )


def _told(finding: Mapping[str, Any], story: UpdateStory) -> dict[str, Any]:
    """A finding with its picture, in units for people."""
    factor, unit = for_people(finding["unit"])
    shown = None
    if len(finding["votes"]) >= _WITH_VOTES:
        shown = picture(
            forest_figure(finding, story.labels),
            f"Votes of {len(finding['votes'])} flights on {finding['parameter']} with 95 %"
            " intervals, and all together.",
            "One flight, one vote: dots with 95 % intervals. Diamond and band: all together, random"
            " and systematic parts.",
        )
    ci95 = finding["ci95"]
    return {
        **finding,
        "shown_value": None if finding["value"] is None else factor * finding["value"],
        "shown_ci95": None if ci95 is None else [factor * end for end in ci95],
        "shown_unit": unit,
        "effect_words": effect_words(finding),
        "added": finding["hypothesis"] in story.document.get("added", ()),
        "rivals": list(finding["explanation_set"][1:]),
        "fallen": dict(finding.get("fallen", {})),
        "refound": finding.get("refound", (0, 0)),
        "held_out_share": finding.get("held_out_share"),
        "picture": shown,
    }


def _bounds(entries: Any) -> list[dict[str, Any]]:
    """What was not found, with its bounds in units for people."""
    rows = []
    for entry in entries:
        factor, unit = for_people(entry["unit"])
        bounds = {
            key: None if entry[key] is None else factor * entry[key]
            for key in ("upper_bound", "minimum_detectable")
        }
        rows.append({**entry, **bounds, "shown_unit": unit})
    return rows


def _pictures(story: UpdateStory) -> dict[str, Picture]:
    """Slices through both databases, what is left over each variable, and histories; none where no
    flight can be compared."""
    axes = _axes(story)
    if not axes or story.databases is None:
        return {}
    before, after = story.databases
    surfaces = sorted(
        {name for held in story.channels.values() for name in held if name.startswith("delta_")}
    )
    names = (
        "alpha",
        "beta",
        "p_hat",
        "q_hat",
        "r_hat",
        *(name for name in surfaces if name in after.flight_inputs),
    )
    variables = moving_variables(story.channels, names)
    floors = {axis: story.document["axes"][axis]["noise_floor"] for axis in axes}
    both = f"{story.baseline} and {story.candidate}" if story.candidate else story.baseline
    shown = {
        "residuals": picture(
            residual_figure(axes, variables, story.before, story.after, story.channels, floors),
            f"Flight minus model on {', '.join(axes)} against {', '.join(variables)}, with {both}.",
            "Line: median; band: 80 % of the samples; grey: noise floor. What still depends on a"
            " variable is not explained yet.",
        ),
        "histories": picture(
            update_figure(
                axes, story.before, story.after, story.labels, errors=not by_parts(story.document)
            ),
            f"Coefficients {', '.join(axes)} over time: flight and {both}.",
            "Flights one behind the other; right: how large the residuals are.",
        ),
    }
    if story.candidate is not None:
        shown["slices"] = picture(
            diff_figure(before, after, (story.baseline, story.candidate), "", _flown(story)),
            f"Slices through {both} on the axes that change.",
            "Band: two standard errors of what was added. Title: the largest change, two standard"
            " errors, where. Shaded: envelope of the flights that identified. Grey bars along the"
            " lower edge: where the flights of this report have been.",
        )
    return shown


def _flown(story: UpdateStory) -> dict[str, Array]:
    names = {name for held in story.channels.values() for name in held}
    return {
        name: np.concatenate([held[name] for held in story.channels.values() if name in held])
        for name in names
    }


def _axes(story: UpdateStory) -> list[str]:
    """Axes to draw that these flights can show: those with increments, else those with findings,
    else those farthest from their noise floor."""
    shown = {
        axis
        for comparison in story.before.values()
        for axis, good in comparison.usable.items()
        if good.any()
    }
    touched = {entry["axis"] for entry in story.document["increments"]}
    found = {
        axis
        for finding in story.document["findings"]
        if len(finding["axis"]) < len(AXES)
        for axis in finding["axis"]
    }
    rows = [
        row
        for row in error_rows(story.document)
        if row["axis"] in AXES and row["axis"] in shown and row["times_floor"]
    ]
    far = {row["axis"] for row in sorted(rows, key=lambda row: -row["times_floor"])[:_FARTHEST]}
    chosen = next((axes & shown for axes in (touched, found, far) if axes & shown), set())
    return [axis for axis in (*AXES, *WIND_AXES) if axis in chosen]
