"""Versions as documents: `aerodb version list`, `show` and `history`, and the console's API."""

from collections.abc import Mapping, Sequence
from typing import Any

from aerodb.increments import held_out_error
from aerodb.report import change, hypothesis_words
from aerodb.storage.catalogue import Catalogue, NameEvent, NoteRow, VersionRow
from aerodb.tasks.result_versions import CANDIDATE, NAMES, RELEASED


def version_document(row: VersionRow) -> dict[str, Any]:
    """Return a version without its documents."""
    return {
        "version": row.id,
        "label": row.label,
        "vehicle": row.vehicle,
        "parent": row.parent,
        "content_sha256": row.content_sha256,
        "created_utc": row.created_utc.isoformat(),
    }


def versions_document(
    catalogue: Catalogue, vehicle: str, rows: Sequence[VersionRow]
) -> list[dict[str, Any]]:
    """Return versions of a vehicle, each with the names that now point at it, and what people look
    for in a list: held_out (`held_out_error`), findings (ids that were added), axes (with declared
    increments), flights (number by role), tags and comments."""
    names: dict[str, list[str]] = {}
    for name, version in catalogue.names(vehicle).items():
        names.setdefault(version, []).append(name)
    ids = [row.id for row in rows]
    reports, notes = catalogue.reports_of(ids), catalogue.notes_of(ids)
    return [
        {
            **version_document(row),
            "names": names.get(row.id, []),
            **_content(reports[row.id]),
            **notes_document(catalogue, notes[row.id]),
        }
        for row in rows
    ]


def _content(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a list says of the report that a version was made with."""
    flights = report.get("flights", {})
    added = list(report.get("added", ()))
    increments = [] if added else [entry["axis"] for entry in report.get("increments", ())]
    return {
        "held_out": held_out_error(report),
        "findings": added,
        "axes": increments,
        "flights": {role: len(flights.get(role, ())) for role in ("identified", "held_out")},
    }


def notes_document(catalogue: Catalogue, notes: Sequence[NoteRow]) -> dict[str, Any]:
    """Return the tags and comments (at_utc, user, text; oldest first) of one version."""
    return {
        "tags": list(catalogue.tags_of(notes)),
        "comments": [
            {"at_utc": each.at_utc.isoformat(), "user": each.user, "text": each.text}
            for each in notes
            if each.kind == "comment"
        ],
    }


def matching(documents: Sequence[dict[str, Any]], words: str) -> list[dict[str, Any]]:
    """Return the versions of `versions_document` that have all words: in label, id, names, tags,
    comments and their authors, findings, axes and the date; upper and lower case are one."""
    asked = words.casefold().split()
    return [each for each in documents if all(word in _searched(each) for word in asked)]


def _searched(document: dict[str, Any]) -> str:
    comments = [f"{each['text']} {each['user']}" for each in document["comments"]]
    keys = ("names", "tags", "findings", "axes")
    lists = [word for key in keys for word in document[key]]
    lists += [hypothesis_words(each) for each in document["findings"]]
    parts = [document["label"], document["version"], document["created_utc"], *lists, *comments]
    return " ".join(parts).casefold()


def held_out_words(error: dict[str, Any]) -> str:
    """Say an error of `aerodb.increments.held_out_error` in a table: the two axes that it changed
    most."""
    if error["after"] is None:
        return "not held out"
    changed = [
        f"{axis} {change(before, after)}"
        for axis, (before, after) in list(error["axes"].items())[:2]
    ]
    more = ", ..." if len(error["axes"]) > 2 else ""
    kind = "" if error["kind"] == "held-out" else f" ({error['kind']})"
    return f"{', '.join(changed) or 'unchanged'}{more}{kind}"


def flights_words(flights: dict[str, int]) -> str:
    """Say how many flights identified a version and how many validated it."""
    if not flights["identified"]:
        return ""
    held = f" + {flights['held_out']} held out" if flights["held_out"] else ""
    return f"{flights['identified']}{held}"


def findings_words(document: dict[str, Any]) -> str:
    """Say what was added to a version: findings by their names, or the axes with increments."""
    found = [hypothesis_words(each) for each in document["findings"]]
    more = f" and {len(found) - 3} more" if len(found) > 3 else ""
    declared = f"declared: {', '.join(document['axes'])}" if document["axes"] else ""
    return f"{', '.join(found[:3])}{more}" if found else declared


def waiting(catalogue: Catalogue, vehicle: str) -> list[VersionRow]:
    """Return the versions of a vehicle that wait for a decision: the candidate of each line, where
    it continues the released version, is not stale and was never released itself. That of the
    aerodynamics comes first, then those of friction and wakes."""
    found = (_waiting(catalogue, vehicle, n[CANDIDATE], n[RELEASED]) for n in NAMES.values())
    return [row for row in found if row is not None]


def _waiting(
    catalogue: Catalogue, vehicle: str, candidate_name: str, released_name: str
) -> VersionRow | None:
    names = catalogue.names(vehicle)
    candidate, released = names.get(candidate_name), names.get(released_name)
    if candidate is None or candidate == released:
        return None
    row = catalogue.version_of_id(candidate)
    moves = catalogue.moves_to(vehicle, [candidate])
    once = any(move.name == released_name for move in moves)
    ready = row.parent == released and not once and not catalogue.stale(candidate)
    return row if ready else None


def version_details(catalogue: Catalogue, row: VersionRow) -> dict[str, Any]:
    """Return a version with the reasons why it is stale, its report (docs/reference/contract.md,
    section "JSON", SI units) and its settings. UnknownNameError for an unknown one."""
    documents = catalogue.version_documents(row.id)
    stale = list(catalogue.stale(row.id))
    return {
        **version_document(row),
        **notes_document(catalogue, catalogue.notes_of([row.id])[row.id]),
        "stale": stale,
        "report": documents.report,
        "settings": documents.settings,
    }


def lineage_document(catalogue: Catalogue, version: VersionRow) -> dict[str, Any]:
    """Return what a version is based on: ancestors, reasons why it is stale, flights, inputs and
    runs (`Lineage`). Raises UnknownNameError for an unknown version."""
    lineage = catalogue.lineage(version.id)
    return {
        "version": lineage.version.id,
        "line": [version_document(ancestor) for ancestor in lineage.line],
        "stale": list(catalogue.stale(version.id)),
        "flights": [
            {"flight": f, "role": role, "log_sha256": lineage.logs[f]}
            for f, role in sorted(lineage.roles.items())
        ],
        "inputs": {key: list(values) for key, values in lineage.inputs.items()},
        "runs": [
            {
                "run": r.id,
                "flow": r.flow,
                "how": r.how,
                "state": r.state,
                "code_version": r.code_version,
            }
            for r in lineage.runs
        ],
    }


def history_document(
    events: Sequence[NameEvent], notes: Sequence[NoteRow] = ()
) -> list[dict[str, Any]]:
    """Return moves of names: when, which name, to and from which version, by whom, why; and among
    them, in order of time, notes on versions: ``name`` is then None, and ``note`` their kind."""
    moves = [
        {
            "at_utc": event.at_utc.isoformat(),
            "name": event.name,
            "to": event.version,
            "from": event.previous,
            "user": event.user,
            "reason": event.reason,
        }
        for event in events
    ]
    noted = [
        {
            "at_utc": note.at_utc.isoformat(),
            "name": None,
            "note": note.kind,
            "to": note.version,
            "from": None,
            "user": note.user,
            "reason": note.text,
        }
        for note in notes
    ]
    return sorted([*moves, *noted], key=lambda entry: str(entry["at_utc"])) if noted else moves
