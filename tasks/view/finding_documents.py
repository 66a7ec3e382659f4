"""Findings of updates and closed loops, from their stored documents; nothing is recomputed."""

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, Final

from aerodb.errors import AeroError, InputError
from aerodb.report import capital, decision
from aerodb.storage.catalogue import RunRow
from aerodb.storage.files import read_document
from aerodb.tasks.references import version_of
from aerodb.tasks.steps import FLOWS
from aerodb.tasks.workspace_access import WorkspaceAccess

_KEY: Final = re.compile(r"[0-9a-f]{64}")
#: Headline of a run that stored nothing of its own.
_UNTOLD: Final = {
    "completed": "Same result as an earlier run: nothing new was stored.",
    "running": "Running.",
    "unread": "A report of an earlier release: open it.",
}
_PLACE: Final = re.compile(r"([0-9T:.+-]{19,40})~([A-Za-z0-9-]{1,64})")


def findings_page(
    access: WorkspaceAccess, limit: int, after: str = ""
) -> tuple[list[dict[str, Any]], str]:
    """Return the newest `limit` updates and closed loops, and the start of the next page (empty at
    the end).

    Each is a document: run, flow, vehicle, state, started_utc, reference (for `finding_document`;
    None if nothing was stored), label, headline, outcome (verdict and proof, short), verdicts.
    after : the second value that the previous page returned; InputError if it is invalid.
    """
    rows = access.catalogue.runs_of(FLOWS.values(), limit + 1, _place(after) if after else None)
    shown = rows[:limit]
    results = access.catalogue.made_by([run.id for run in shown], "close_loop")
    versions = access.catalogue.versions_by_id(id for ids, _ in results.values() for id in ids)
    reports = access.catalogue.reports_of(versions)
    entries = []
    for run in shown:
        ids, keys = results[run.id]
        reference = next((id for id in ids if "axes" in reports.get(id, {})), None) or next(
            iter(keys), None
        )
        report = reports[reference] if reference in reports else _stored(access, reference)
        label = versions[reference].label if reference in versions else None
        entries.append(_entry(run, reference, label, report))
    further = f"{shown[-1].started_utc.isoformat()}~{shown[-1].id}" if len(rows) > limit else ""
    return entries, further


def finding_document(
    access: WorkspaceAccess, reference: str, vehicle: str | None = None
) -> dict[str, Any]:
    """Return the document of an update or closed loop (docs/reference/contract.md, section "update
    and close-loop"), by its report's key or by the version it made.

    Raises UnknownNameError for an unknown reference, InputError for an imported version.
    """
    meant = reference_of(access, reference, vehicle)
    reports = access.catalogue.reports_of([meant])
    if meant not in reports:
        row = access.catalogue.result(meant)
        assert row is not None
        document: dict[str, Any] = read_document(access.file_of(row.path))
        return document
    report = {name: part for name, part in reports[meant].items() if name != "check_cases"}
    if "axes" not in report:
        label = access.catalogue.version_of_id(meant).label
        raise InputError(
            "was imported, not made by an update", f"version {label}", "see the version itself"
        )
    return report


def reference_of(access: WorkspaceAccess, reference: str, vehicle: str | None = None) -> str:
    """Return the key of a closed loop's report, or the id of a version; UnknownNameError otherwise,
    of `version_of`."""
    result = access.catalogue.result(reference) if _KEY.fullmatch(reference) else None
    if result is not None and result.step == "close_loop":
        return result.key
    if vehicle is None and reference in access.catalogue.versions_by_id([reference]):
        return reference
    return version_of(access.catalogue, reference, vehicle).id


def labels_of(access: WorkspaceAccess, document: Mapping[str, Any]) -> dict[str, str]:
    """Return id -> label, for the flights and versions of an update's document."""
    roles = document["flights"]
    flights = [
        *roles["identified"],
        *roles["held_out"],
        *(entry["flight"] for entry in roles["excluded"]),
    ]
    versions = access.catalogue.versions_by_id(
        filter(None, (document["baseline"], document["candidate"]))
    )
    return {
        **access.catalogue.flight_labels(flights),
        **{id: row.label for id, row in versions.items()},
    }


def _entry(
    run: RunRow, reference: str | None, label: str | None, report: Mapping[str, Any]
) -> dict[str, Any]:
    verdicts: Sequence[str] = [finding["verdict"] for finding in report.get("findings", ())]
    outcome = _outcome(report, label) if report else []
    return {
        "run": run.id,
        "flow": run.flow,
        "vehicle": run.parameters.get("vehicle"),
        "state": run.state,
        "started_utc": run.started_utc.isoformat(),
        "reference": reference,
        "label": label,
        "headline": " ".join(f"{capital(each)}." for each in outcome)
        or run.error
        or _UNTOLD.get("unread" if report else run.state, ""),
        "outcome": outcome,
        "verdicts": {verdict: verdicts.count(verdict) for verdict in dict.fromkeys(verdicts)},
    }


def _outcome(report: Mapping[str, Any], label: str | None) -> list[str]:
    """Return the verdict of a report and its proof, each in a short sentence; empty where no report
    is kept, or one of an earlier release that has no decision."""
    try:
        told = decision({**report, "label": label})
    except KeyError:
        return []
    return [told.verdict, *dict(told.lines).get("proved", ())]


def _stored(access: WorkspaceAccess, key: str | None) -> Mapping[str, Any]:
    """Return the document stored under a key; empty if it is lost, so that a list stays
    complete."""
    row = access.catalogue.result(key) if key is not None else None
    try:
        return {} if row is None else read_document(access.file_of(row.path))
    except AeroError:
        return {}


def _place(text: str) -> tuple[datetime, str]:
    match = _PLACE.fullmatch(text)
    try:
        if match is None:
            raise ValueError(text[:80])
        when = datetime.fromisoformat(match[1])
        if when.tzinfo is None:
            raise ValueError("no time zone")
        return when, match[2]
    except ValueError as error:
        raise InputError(
            "not a position in this list", "after", "omit it for the first page"
        ) from error
