"""The report page of an update or a closed loop: result, errors, findings and open questions."""

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
    stall_figure,
)
from aerodb.support import Array
from aerodb.tables import WIND_AXES, AeroDatabase

#: Verdict -> its meaning, for the reader of a report.
MEANS: Final[Mapping[str, str]] = {
    "confirmed": "no other hypothesis explains it as well, and no single sensor error removes it",
    "suspected": "the best explanation, but too few independent flights for the stated error rate",
    "alias_group": "several explanations fit these flights equally well",
    "ambiguous_sensor": "a sensor error cannot be excluded, so the database is left unchanged",
    "sensor": "a sensor error; to be corrected in flight-path reconstruction",
    "unnamed": "reproducible, but no template of the library fits",
    "not_detected": "not found; sizes above the bound are excluded",
    "not_excited": "the flights do not excite it",
    "not_separable": "it cannot be separated from other effects in these flights",
    "not_testable": "too few flights show it",
}
_WITH_VOTES: Final = 2
#: Number of axes drawn where nothing was added: those farthest above their noise floor.
_FARTHEST: Final = 3


@dataclass(frozen=True)
class UpdateStory:
    """Contents of the report page of an update or a closed loop.

    Attributes
    ----------
    document : from `update_document` or `loop_document`.
    labels : flight id -> display name.
    baseline, candidate : labels of the versions; candidate None: nothing was added.
    databases : of the baseline and the candidate.
    before, after : flight id -> comparison on the validation flights, else on all. `after` is empty
        where nothing was added, both are where no flight can be compared.
    channels : flight id -> channel -> (n,), non-dimensional rates included.
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
    """Render the report of an update or a closed loop as one HTML page."""
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
            "bar: noise floor of the sensors, which no database can beat."
            f"{' Dots: single flights, before above the line, after below.' if single else ''}",
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
        stall_picture=_stall_picture(story),
    )


def _stall_picture(story: UpdateStory) -> Picture | None:
    """Lift in the stall of each flight, predicted by the others; None without such stalls."""
    stalls = [entry for entry in story.document.get("stalls", ()) if "measured" in entry["series"]]
    if not stalls:
        return None
    return picture(
        stall_figure(stalls, story.labels),
        "Lift in the stall over angle of attack and over time: flight, baseline, and prediction by"
        " the other flights.",
        f"Dashed: {story.baseline}. Predicted by the others: the stall and the attached flow that"
        " they agree with; the flight itself had no share in them. All below the frequency that the"
        " title states.",
    )


def _told(finding: Mapping[str, Any], story: UpdateStory) -> dict[str, Any]:
    """A finding with its figure, in display units."""
    factor, unit = for_people(finding["unit"])
    shown = None
    if len(finding["votes"]) >= _WITH_VOTES:
        shown = picture(
            forest_figure(finding, story.labels),
            f"Estimates of {finding['parameter']} from {len(finding['votes'])} flights with 95 %"
            " intervals, and the combined estimate.",
            "Dots: the estimate of each flight (its vote) with its 95 % interval. Diamond and band:"
            " combined estimate with its 95 % interval, random and systematic errors included.",
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
    """Rows of what was not found, with bounds in display units."""
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
    """Slices through both databases, residuals over each variable, and time histories.

    Empty where no flight can be compared.
    """
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
            "Line: median. Band: 80 % of the samples. Grey: noise floor. A residual that still"
            " depends on a variable is not explained yet.",
        ),
        "histories": picture(
            update_figure(
                axes, story.before, story.after, story.labels, errors=not by_parts(story.document)
            ),
            f"Coefficients {', '.join(axes)} over time: flight and {both}.",
            "The flights one after another. Right: distribution of the residuals.",
        ),
    }
    if story.candidate is not None:
        shown["slices"] = picture(
            diff_figure(before, after, (story.baseline, story.candidate), "", _flown(story)),
            f"Slices through {both} on the axes that change.",
            "Band: two standard errors of the increments. Title: the largest change ± two standard"
            " errors, and where. Shaded: envelope of the identification flights. Grey bars along"
            " the lower edge: distribution of this report's flights.",
        )
    return shown


def _flown(story: UpdateStory) -> dict[str, Array]:
    names = {name for held in story.channels.values() for name in held}
    return {
        name: np.concatenate([held[name] for held in story.channels.values() if name in held])
        for name in names
    }


def _axes(story: UpdateStory) -> list[str]:
    """Axes to draw: with increments, else with findings, else farthest above noise floor.

    Axes without usable samples in these flights are left out.
    """
    shown = {
        axis
        for comparison in story.before.values()
        for axis, good in comparison.usable.items()
        if good.any()
    }
    touched = {entry["axis"] for entry in story.document["increments"]}
    added = {
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
    chosen = next((axes & shown for axes in (touched, added, far) if axes & shown), set())
    return [axis for axis in (*AXES, *WIND_AXES) if axis in chosen]
