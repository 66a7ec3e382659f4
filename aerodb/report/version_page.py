"""The report page of a database version: contents, lineage and changes from its parent."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any, Final

from aerodb.nomenclature import AXES
from aerodb.report.database_figure import database_figure
from aerodb.report.diff_documents import curve_document, diff_document, edits_of
from aerodb.report.diff_figures import diff_figures
from aerodb.report.error_table import error_rows, shown_axes
from aerodb.report.front_figure import front_ends, front_figure
from aerodb.report.gate_lines import gate_rows, release_lines
from aerodb.report.glossary import listed, with_true_signs
from aerodb.report.head import Head
from aerodb.report.lineage_figure import Graph
from aerodb.report.mode_table import COMPARED
from aerodb.report.page import pieces
from aerodb.report.qualification import qualification_table
from aerodb.report.reach import beyond_data, beyond_words
from aerodb.report.response_page import response_scales
from aerodb.report.style import Picture
from aerodb.tables import AeroDatabase, diff

#: Edits that a paper lists, the largest of all.
_EDITS_ON_PAPER: Final = 6


@dataclass(frozen=True)
class NameMove:
    """A move of a name to the version: when, which name, by whom and why."""

    at: datetime
    name: str
    user: str
    reason: str


@dataclass(frozen=True, order=True)
class UsedFlight:
    """A flight that the version used: label, role, sha256 of its log, why retracted or empty.

    Flights are ordered by label, then role.
    """

    label: str
    role: str
    log_sha256: str
    retract_reason: str


@dataclass(frozen=True)
class VersionStory:
    """What there is to tell of a version.

    moves : of names to it. flights : its own, not those of its ancestors. report : the document it
    was made with; that of an imported one has no ``axes``. gate : of `judge_version`. trim : what
    changes in trim and modes, in words. head : where it comes from. responses : of
    `summarise_responses`, if the version was flown. modes : beside those of flights, of
    `mode_table`.
    """

    id: str
    label: str
    vehicle: str
    content_sha256: str
    names: Sequence[str]
    stale: Sequence[str]
    report: Mapping[str, Any]
    gate: Mapping[str, Any]
    trim: Sequence[str]
    moves: Sequence[NameMove]
    flights: Sequence[UsedFlight]
    database: AeroDatabase
    parent: tuple[str, AeroDatabase] | None
    graph: Graph
    head: Head
    responses: Mapping[str, Any] | None = None
    modes: Mapping[str, Any] | None = None


def version_report(story: VersionStory) -> Iterator[str]:
    """Return the report of a version as one HTML page in pieces (`pieces`), in display units
    (`channel_scale`): on the first page what is recommended and why, then what changes, then where
    it comes from."""
    changes: Mapping[str, Any] | None = None
    front, slices, curve, curves = None, [], None, None
    ends = beyond_words(story.database.increments)
    if story.parent is not None:
        label, before = story.parent
        names = (label, story.label)
        changes = diff_document(diff(before, story.database))
        curve = curve_document(before, story.database)
        ends = beyond_data(before, story.database)
        rows = _rows(story.report)
        front = Picture(
            partial(front_figure, before, story.database, names, rows),
            f"The curve that changes most from {label} to {story.label}, and the error per axis.",
            "Left: the curve that changes most; grey, between dotted lines: where flights have"
            " been. Right: error on the validation flights. "
            + with_true_signs(" ".join(front_ends(before, story.database))),
        )
        slices = [
            Picture(
                draw,
                f"Slices through {label} and {story.label} on the axes that change.",
                "Band: 95 % interval of the increments. Above: the largest change ± half of its"
                " 95 % interval, and where. Grey, between dotted lines: the"
                f" range that was flown. {_not_drawn(changes)}",
            )
            for draw in diff_figures(before, story.database, names)
        ]
    else:
        curves = Picture(
            partial(database_figure, story.database),
            "CX, CZ and Cm against angle of attack; CY, Cl and Cn against sideslip.",
            "All other inputs neutral (zero; V 1 m/s). Dots: breakpoints of the tables.",
        )
    return pieces(
        "version.html",
        title=f"{story.vehicle}: version {story.label}",
        story=story,
        head=story.head,
        recommendation=_recommendation(story),
        summary=release_lines(story.gate, story.report, story.responses, story.trim),
        checks=gate_rows(story.gate["checks"]),
        errors=_rows(story.report),
        front=front,
        changes=changes,
        edits=[] if changes is None else edits_of(changes),
        on_paper=_EDITS_ON_PAPER,
        nodes=0 if changes is None else sum(len(entry["nodes"]) for entry in changes["nodes"]),
        curve=curve,
        ends=ends,
        slices=slices if len(slices) > 1 or changes is None or _several(changes) else [],
        curves=curves,
        compared_figures=COMPARED,
        scales=response_scales(story.responses),
        qualification=qualification_table(story.responses),
    )


def _recommendation(story: VersionStory) -> str:
    """What is recommended, in a few words: from the gate's answer."""
    gate, now = story.gate, story.gate["released"]
    if now is not None and now["version"] == story.id:
        return f"released since {now['since'][:10]}, by {now['user']}"
    if gate["passed"]:
        return "recommendation: release"
    if gate["acceptable"] is not None:
        return "recommendation: release only if you accept what the gate refuses"
    return "recommendation: do not release"


def _rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the errors per axis, of the axes in which the document is told."""
    if "axes" not in report:
        return []
    shown = shown_axes(report)
    return [row for row in error_rows(report) if row["axis"] in shown]


def _several(changes: Mapping[str, Any]) -> bool:
    """Whether more than one axis, or more than one edit, changes: one curve is on the first
    page."""
    return len(edits_of(changes)) + len(changes["edited_tables"]) > 1


def _not_drawn(changes: Mapping[str, Any]) -> str:
    """Which axes are not drawn, and why."""
    changed = {term["axis"] for term in changes["terms"]}
    changed |= {entry["axis"] for entry in changes["nodes"]}
    same = [axis for axis in AXES if axis not in changed] if changed <= {*AXES} else []
    return f"Not drawn, as nothing changes there: {listed(same)}." if same else ""
