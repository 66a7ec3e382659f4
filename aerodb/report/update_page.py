"""The report page of an update or a closed loop: result, errors, findings and open questions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.increments import NEAR_FLOOR
from aerodb.nomenclature import AXES, axis_description
from aerodb.remarks import LEAVES_ENVELOPE, REFUSED
from aerodb.report.decision import decision
from aerodb.report.diff_figures import diff_figures
from aerodb.report.document import excursion_text
from aerodb.report.error_table import (
    by_parts,
    changed_axes,
    error_rows,
    excluded_sizes,
    on_which,
    shown_axes,
    written_on,
)
from aerodb.report.figures import update_figure
from aerodb.report.findings import MEANS, meaning, named_flights, sentence_of, told
from aerodb.report.flight_errors import disagreements, flight_errors, wrong_sensors
from aerodb.report.former_documents import remarks_of
from aerodb.report.glossary import advice_words, listed, with_true_signs
from aerodb.report.head import Head
from aerodb.report.held_or_free import held_or_free_words
from aerodb.report.page import pieces
from aerodb.report.reach import beyond_data
from aerodb.report.style import Picture
from aerodb.report.terms import estimates_added, estimates_of
from aerodb.report.update_figures import (
    error_figure,
    moving_variables,
    residual_figure,
    stall_figure,
)
from aerodb.support import Array
from aerodb.tables import AeroDatabase

_Entry = TypeVar("_Entry")

_DOTS: Final = {
    True: " Dots: single flights, before above the line, after below.",
    False: " Dots: single flights, with the database.",
}
_IN_SAMPLE: Final = (
    "; after: of the flights that the version was identified from, which is optimistic"
)
#: Axes in one figure of a page.
_AXES_ON_A_PAGE: Final = 6
#: Histories in one figure of a page.
_HISTORIES_ON_A_PAGE: Final = 4
#: Flights to make next that a paper lists.
_ADVICE_ON_PAPER: Final = 3
#: Stalls in one figure of a page.
_STALLS_ON_A_PAGE: Final = 3
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
    head : where the result comes from. given : options that a closed loop was asked with.
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
    given: Sequence[str] = ()


def update_report(story: UpdateStory) -> Iterator[str]:
    """Return the report of an update or a closed loop as one HTML page in pieces (`pieces`), in
    display units (`for_people`: degrees for radians)."""
    document, loop = story.document, "library" in story.document
    estimates = [] if loop else estimates_of(document)
    if loop and story.candidate is not None and story.databases is not None:
        estimates = estimates_added(document, *story.databases)
    return pieces(
        "update.html",
        title=(
            f"{'Closed loop' if loop else 'Update'} of {document['vehicle']}:"
            f" {story.candidate or 'nothing added'}"
        ),
        decision=decision({**document, "label": story.candidate}, rest="below", given=story.given),
        head=story.head,
        story=story,
        document=document,
        closed_loop=loop,
        on_which=on_which(document),
        free_words=held_or_free_words(document["held_or_free"])
        if "held_or_free" in document
        else (),
        findings=[
            {
                **told(finding, story.labels),
                "added": finding["hypothesis"] in document.get("added", ()),
                "meaning": meaning(finding, document),
            }
            for finding in document["findings"]
        ],
        meanings={
            verdict: MEANS[verdict]
            for verdict in dict.fromkeys(each["verdict"] for each in document["findings"])
            if verdict in MEANS
        },
        on_paper=_ADVICE_ON_PAPER,
        estimates=estimates,
        undecided=_bounds(document, decided=False),
        excluded=_bounds(document, decided=True),
        changed=disagreements(document, list(document["axes"]), story.before),
        pictures=_pictures(story),
        ends=beyond_data(*story.databases) if story.databases and story.candidate else [],
        stall_pictures=_stall_pictures(story),
        **_errors(story),
        **_sentences(story),
    )


def _errors(story: UpdateStory) -> dict[str, Any]:
    """The errors per axis and per flight, and their figure."""
    document, shown = story.document, shown_axes(story.document)
    rows = [
        {**row, "flights": flight_errors(row["axis"], story.before, story.after)}
        for row in error_rows(document)
    ]
    rows.sort(key=lambda row: row["axis"] not in shown)  # the same forces once more come last
    single = len(story.before) > 1 and not by_parts(document)
    held_out = bool(document["flights"]["held_out"])
    # without held-out flights, the errors of single flights after are those of identification
    ends = 2 if held_out else 1
    drawn = [
        {
            **row,
            "each": [_two(each[:ends]) for each in row["flights"].values()] if single else [],
            "after": row["after"] if story.candidate else None,
        }
        for row in rows
        if row["axis"] in shown
    ]
    return {
        "errors": rows,
        "shown": shown,
        "single": list(story.before) if single else [],
        "optimistic": "" if held_out else _IN_SAMPLE,
        "error_picture": Picture(
            partial(error_figure, drawn),
            "Error per axis before and after the update, and the noise floor; the table below holds"
            " the same numbers.",
            f"Error {on_which(document)}. Circle: {story.baseline}; "
            f"{f'square: {story.candidate}; ' if story.candidate else ''}"
            "bar: noise floor, what the right database would leave."
            f"{_DOTS[held_out and story.candidate is not None] if single else ''}",
        ),
    }


def _two(errors: Sequence[float | None]) -> tuple[float | None, float | None]:
    """Errors before and after of one flight; None where there is none."""
    return errors[0], errors[1] if len(errors) > 1 else None


def _sentences(story: UpdateStory) -> dict[str, Any]:
    """Remarks, advice, what differs between flights, and where flights leave the envelope."""
    document, labels = story.document, story.labels
    beyond = document.get("beyond", ())
    remarks = [
        (kind, sentence_of(remark, labels))
        for kind, remark in remarks_of(document)
        if not (beyond and kind == LEAVES_ENVELOPE)
    ]
    return {
        "warnings": [remark for kind, remark in remarks if kind == REFUSED],
        "remarks": [remark for kind, remark in remarks if kind != REFUSED],
        "advice": [
            named_flights(advice_words(advice), labels) for advice in document["next_flight"]
        ],
        "between": [
            sentence_of(entry["because"], labels) for entry in document.get("between_flights", ())
        ],
        "beyond": [
            {
                **entry,
                "where": with_true_signs(
                    "; ".join(
                        excursion_text(each["variable"], each["flight"], each["envelope"])
                        for each in entry["excursions"]
                    )
                ),
            }
            for entry in beyond
        ],
    }


def _stall_pictures(story: UpdateStory) -> list[Picture]:
    """Lift in the stall of each flight, predicted by the others; empty without such stalls."""
    stalls = [entry for entry in story.document.get("stalls", ()) if "measured" in entry["series"]]
    return [
        Picture(
            partial(stall_figure, part, story.labels),
            "Lift in the stall over angle of attack and over time: flight, baseline, and prediction"
            " by the other flights.",
            f"Dashed: {story.baseline}. Predicted by the others: the stall and the attached flow"
            " that they agree with; the flight itself had no share in them. All below the frequency"
            " that the title states.",
        )
        for part in _parts(stalls, _STALLS_ON_A_PAGE)
    ]


def _bounds(document: Mapping[str, Any], decided: bool) -> list[dict[str, Any]]:
    """Rows of what was not found, with what the flights exclude, in display units.

    decided : whether of those that these flights decide, or of the others.
    """
    return [
        {**entry, **excluded_sizes(entry)}
        for entry in document["not_found"]
        if (entry["verdict"] == "not_detected") == decided
    ]


def _pictures(story: UpdateStory) -> dict[str, list[Picture]]:
    """Slices through both databases, residuals over what they depend on most, and histories.

    Empty where no flight can be compared.
    """
    axes = _axes(story)
    if not axes or story.databases is None:
        return {}
    before, after = story.databases
    absent = _not_drawn(story, axes)
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
            Picture(
                partial(
                    residual_figure,
                    part,
                    variables,
                    story.before,
                    story.after,
                    story.channels,
                    floors,
                ),
                f"Flight minus model on {', '.join(part)} against the variables on which it depends"
                f" most, with {both}.",
                f"Flight − model over the variables on which it depends most, of {len(variables)}"
                " that move. Line: median. Band: 80 % of the samples. Grey: noise floor. A"
                f" residual that still depends on a variable is not explained yet.{absent}",
            )
            for part in _parts(axes, _AXES_ON_A_PAGE)
        ],
        "histories": [
            Picture(
                partial(
                    update_figure,
                    part,
                    story.before,
                    story.after,
                    story.labels,
                    errors=bool(story.document["flights"]["held_out"]),
                ),
                f"Coefficients {', '.join(part)} over time: flight and {both}.",
                "The flights one after another. Right: distribution of the residuals. "
                + " ".join(f"{axis}: {axis_description(axis)}." for axis in part)
                + absent,
            )
            for part in _parts(axes, _HISTORIES_ON_A_PAGE)
        ],
    }
    if story.candidate is not None:
        shown["slices"] = [
            Picture(
                draw,
                f"Slices through {both} on the axes that change.",
                "Band: 95 % interval of the increments. Above: the largest change ± half of its"
                " 95 % interval, and where. Shaded: flown by the identification flights. Grey"
                " bars along the lower edge: distribution of this report's flights.",
            )
            for draw in diff_figures(
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


def _not_drawn(story: UpdateStory, axes: Sequence[str]) -> str:
    """Which of the axes in which the document is told are not drawn, and why."""
    told = [axis for axis in shown_axes(story.document) if axis not in axes]
    usable = _usable(story)
    near = [axis for axis in told if axis in usable]
    without = [axis for axis in told if axis not in usable]
    words = f" Not drawn: {listed(near)}, unchanged and near the noise floor." if near else ""
    if wrong_sensors(story.document):
        words += " What the sensors do that were found to be wrong is drawn, and not in the errors."
    return words + (f" Not drawn: {listed(without)}, without usable samples." if without else "")


def _usable(story: UpdateStory) -> set[str]:
    """Axes with usable samples in these flights."""
    return {
        axis
        for comparison in story.before.values()
        for axis, good in comparison.usable.items()
        if good.any()
    }


def _axes(story: UpdateStory) -> list[str]:
    """Axes to draw, of those in which the document is told: with increments, else with findings,
    and all that stay above their noise floor; where there are none, those farthest above it.

    Axes without usable samples in these flights are left out.
    """
    usable = _usable(story)
    told = [axis for axis in shown_axes(story.document) if axis in usable]
    rows = [row for row in error_rows(story.document) if row["axis"] in told and row["times_floor"]]
    rows.sort(key=lambda row: -row["times_floor"])
    touched = changed_axes(story.document)
    found = {
        axis
        for finding in story.document["findings"]
        if len(finding["axis"]) < len(AXES)
        for axis in written_on(finding)
    }
    chosen = next((axes for axes in (touched, found) if axes & {*told}), set())
    chosen |= {row["axis"] for row in rows if row["times_floor"] > NEAR_FLOOR}
    chosen = chosen or {row["axis"] for row in rows[:_FARTHEST]}
    return [axis for axis in told if axis in chosen]
