"""The report page of an update or a closed loop: result, errors, findings and open questions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.nomenclature import AXES, axis_description
from aerodb.report.diff_figures import diff_figures
from aerodb.report.figures import update_figure
from aerodb.report.flight_errors import disagreements, flight_errors
from aerodb.report.glossary import effect_words, in_words
from aerodb.report.head import Head
from aerodb.report.headlines import (
    by_parts,
    error_rows,
    excluded_sizes,
    headline,
    on_which,
    shown_axes,
    what_stayed,
)
from aerodb.report.numbers import for_people
from aerodb.report.page import capital, render
from aerodb.report.style import Picture, picture
from aerodb.report.terms import correlation_rows, estimates_of, term_name, term_unit
from aerodb.report.update_figures import (
    error_figure,
    forest_figure,
    moving_variables,
    residual_figure,
    stall_figure,
)
from aerodb.support import Array
from aerodb.tables import WIND_AXES, AeroDatabase, new_increments

_Entry = TypeVar("_Entry")

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
#: What one figure of a page holds.
_VARIABLES_ON_A_PAGE, _AXES_ON_A_PAGE, _HISTORIES_ON_A_PAGE, _STALLS_ON_A_PAGE = 4, 6, 4, 3
#: 95 % of a normal distribution lie within this many standard errors.
_TWO_SIDED: Final = 1.96
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
    head : where the result comes from.
    """

    document: Mapping[str, Any]
    labels: Mapping[str, str]
    baseline: str
    candidate: str | None
    databases: tuple[AeroDatabase, AeroDatabase] | None
    before: Mapping[str, Comparison]
    after: Mapping[str, Comparison]
    channels: Mapping[str, Mapping[str, Array]]
    head: Head | None = None


def update_report(story: UpdateStory) -> str:
    """Render the report of an update or a closed loop as one HTML page."""
    document, shown = story.document, shown_axes(story.document)
    errors = [
        {**row, "flights": flight_errors(row["axis"], story.before, story.after)}
        for row in error_rows(document)
    ]
    errors.sort(key=lambda row: row["axis"] not in shown)  # the same forces once more come last
    single = len(story.before) > 1 and not by_parts(document)
    drawn = [
        {**row, "each": list(row["flights"].values()) if single else []}
        for row in errors
        if row["axis"] in shown
    ]
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
        stayed=what_stayed(document),
        head=story.head,
        story=story,
        document=document,
        closed_loop=loop,
        on_which=on_which(document),
        errors=errors,
        shown=shown,
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
        estimates=_added(story) if loop else estimates_of(document),
        undecided=_bounds(
            entry for entry in document["not_found"] if entry["verdict"] != "not_detected"
        ),
        excluded=_bounds(
            entry for entry in document["not_found"] if entry["verdict"] == "not_detected"
        ),
        means=MEANS,
        changed=disagreements(document, list(document["axes"]), story.before),
        pictures=_pictures(story),
        stall_pictures=_stall_pictures(story),
    )


def _stall_pictures(story: UpdateStory) -> list[Picture]:
    """Lift in the stall of each flight, predicted by the others; empty without such stalls."""
    stalls = [entry for entry in story.document.get("stalls", ()) if "measured" in entry["series"]]
    return [
        picture(
            stall_figure(part, story.labels),
            "Lift in the stall over angle of attack and over time: flight, baseline, and prediction"
            " by the other flights.",
            f"Dashed: {story.baseline}. Predicted by the others: the stall and the attached flow"
            " that they agree with; the flight itself had no share in them. All below the frequency"
            " that the title states.",
        )
        for part in _parts(stalls, _STALLS_ON_A_PAGE)
    ]


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
        "says": _says(finding),
        "shown_error": None if ci95 is None else factor * (ci95[1] - ci95[0]) / (2.0 * _TWO_SIDED),
        "mean": _mean_test(finding, factor),
        "added": finding["hypothesis"] in story.document.get("added", ()),
        "rivals": list(finding["explanation_set"][1:]),
        "fallen": dict(finding.get("fallen", {})),
        "refound": finding.get("refound", (0, 0)),
        "held_out_share": finding.get("held_out_share"),
        "picture": shown,
    }


def _says(finding: Mapping[str, Any]) -> str:
    """What a finding says, without the numbers that stand beside it."""
    start, mark, rest = finding["because"].partition(f": {finding['parameter']} = ")
    end = rest.partition("; ")[2] if mark else ""
    return capital(in_words(f"{start}; {end}" if end else start))


def _mean_test(finding: Mapping[str, Any], factor: float) -> dict[str, Any] | None:
    """The test of the mean over the flights, in display units, and why the interval of the estimate
    contains zero although that of the mean does not; None for older documents."""
    test = finding.get("test")
    if test is None:
        return None
    low, high = test["ci95"]
    first, last = finding["ci95"]
    wider = not low <= 0.0 <= high and first <= 0.0 <= last
    why = "its shape misses" if finding.get("shape") else "sensors and noise may add"
    return {
        "value": factor * test["mean"],
        "ci95": [factor * low, factor * high],
        "p": test["p"],
        "wider": f"what {why} anywhere in the envelope" if wider else "",
    }


def _added(story: UpdateStory) -> list[dict[str, Any]]:
    """What entered the database in a closed loop: the estimates as they stand in the candidate,
    with their correlations, one entry per increment."""
    if story.candidate is None or story.databases is None:
        return []
    known = {
        finding["value"]: finding
        for finding in story.document["findings"]
        if finding["hypothesis"] in story.document["added"]
    }
    entries = []
    for increment in new_increments(*story.databases):
        error = np.sqrt(np.diag(increment.covariance))
        rows = []
        for text, value, sigma in zip(
            map(str, increment.regressors),
            increment.estimates.tolist(),
            error.tolist(),
            strict=True,
        ):
            finding = known.get(value)
            rows.append(
                {
                    "name": effect_words(finding) if finding else term_name(text),
                    "unit": for_people(finding["unit"])[1] if finding else term_unit(text),
                    "value": value,
                    "standard_error": sigma,
                    "ci95": [value + side * _TWO_SIDED * sigma for side in (-1.0, 1.0)],
                }
            )
        scale = np.where(error > 0.0, error, 1.0)
        entries.append(
            {
                "axis": increment.axis,
                "rows": rows,
                "correlations": correlation_rows(
                    [row["name"] for row in rows], increment.covariance / np.outer(scale, scale)
                ),
            }
        )
    return entries


def _bounds(entries: Any) -> list[dict[str, Any]]:
    """Rows of what was not found, with what the flights exclude, in display units."""
    return [{**entry, **excluded_sizes(entry)} for entry in entries]


def _pictures(story: UpdateStory) -> dict[str, list[Picture]]:
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
        "residuals": [
            picture(
                residual_figure(part, block, story.before, story.after, story.channels, floors),
                f"Flight minus model on {', '.join(part)} against {', '.join(block)}, with {both}.",
                "Line: median. Band: 80 % of the samples. Grey: noise floor. A residual that still"
                " depends on a variable is not explained yet.",
            )
            for block in _parts(variables, _VARIABLES_ON_A_PAGE) or [[]]
            for part in _parts(axes, _AXES_ON_A_PAGE)
        ],
        "histories": [
            picture(
                update_figure(
                    part,
                    story.before,
                    story.after,
                    story.labels,
                    errors=not by_parts(story.document),
                ),
                f"Coefficients {', '.join(part)} over time: flight and {both}.",
                "The flights one after another. Right: distribution of the residuals. "
                + " ".join(f"{axis}: {axis_description(axis)}." for axis in part),
            )
            for part in _parts(axes, _HISTORIES_ON_A_PAGE)
        ],
    }
    if story.candidate is not None:
        shown["slices"] = [
            picture(
                figure,
                f"Slices through {both} on the axes that change.",
                "Band: two standard errors of the increments. Above: the largest change ± two"
                " standard errors, and where. Shaded: envelope of the identification flights. Grey"
                " bars along the lower edge: distribution of this report's flights.",
            )
            for figure in diff_figures(
                before, after, (story.baseline, story.candidate), _flown(story)
            )
        ]
    return shown


def _parts(entries: Sequence[_Entry], most: int) -> list[Sequence[_Entry]]:
    """The entries in parts of at most `most`."""
    return [entries[k : k + most] for k in range(0, len(entries), most)]


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
