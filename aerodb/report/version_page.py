"""The report page of a database version: contents, lineage and changes from its parent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from aerodb.report.database_figure import database_figure
from aerodb.report.diff_documents import diff_document
from aerodb.report.diff_figures import diff_figures
from aerodb.report.head import Head
from aerodb.report.lineage_figure import HEIGHT, WIDTH, Graph
from aerodb.report.page import render
from aerodb.report.response_page import response_scales
from aerodb.report.style import channel_scale, picture
from aerodb.tables import AeroDatabase, diff

_MOST_NODES: Final = 24


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

    moves : of names to it. flights : its own, not those of its ancestors. headline, stayed : the
    two sentences of the document it was made with, empty for an imported one. head : where it
    comes from. responses : of `summarise_responses`, if the version was flown.
    """

    id: str
    label: str
    vehicle: str
    content_sha256: str
    names: Sequence[str]
    stale: Sequence[str]
    headline: str
    stayed: str
    moves: Sequence[NameMove]
    flights: Sequence[UsedFlight]
    database: AeroDatabase
    parent: tuple[str, AeroDatabase] | None
    graph: Graph
    head: Head
    responses: Mapping[str, Any] | None = None


def version_report(story: VersionStory) -> str:
    """Render the report of a version as one HTML page, in display units (`channel_scale`)."""
    changes, slices, curves = None, None, None
    if story.parent is not None:
        label, before = story.parent
        changes = diff_document(diff(before, story.database))
        slices = [
            picture(
                figure,
                f"Slices through {label} and {story.label} on the axes that change.",
                "Band: two standard errors of the increments. Above: the largest change ± two"
                " standard errors, and where. Shaded: envelope of the identification flights.",
            )
            for figure in diff_figures(before, story.database, (label, story.label))
        ]
    else:
        curves = picture(
            database_figure(story.database),
            "CX, CZ and Cm against angle of attack; CY, Cl and Cn against sideslip.",
            "All other inputs neutral (zero; V 1 m/s). Dots: breakpoints of the tables.",
        )
    return render(
        "version.html",
        title=f"{story.vehicle}: version {story.label}",
        story=story,
        head=story.head,
        stayed=story.stayed,
        changes=changes,
        nodes=[] if changes is None else [_table(entry) for entry in changes["nodes"]],
        slices=slices,
        curves=curves,
        scales=response_scales(story.responses),
        box=(WIDTH, HEIGHT),
    )


def _table(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Rows of the table nodes that change most, in display units."""
    largest = sorted(entry["nodes"], key=lambda node: -abs(node["change"]))
    scales = {name: channel_scale(name) for name in entry["channels"]}
    rows = [
        {**node, "shown": [scales[name][0] * node["at"][name] for name in entry["channels"]]}
        for node in largest[:_MOST_NODES]
    ]
    return {
        **entry,
        "labels": [scales[name][1] for name in entry["channels"]],
        "rows": rows,
        "more": len(largest) - len(rows),
    }
