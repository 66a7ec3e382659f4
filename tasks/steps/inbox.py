"""Files of the inbox: which are ready, and how each ends (stored, duplicate or quarantined)."""

import hashlib
import time
from collections.abc import Sequence
from typing import Any

from aerodb.errors import InputError, StoreError
from aerodb.remarks import said
from aerodb.storage.catalogue import FlightRow, InboxEvent, InboxKind
from aerodb.storage.encoding import plain_text
from aerodb.storage.files import put
from aerodb.storage.inbox import (
    InboxFile,
    Quarantined,
    archive_log,
    archived_path,
    may_settle,
    newest_quarantined,
    open_log,
    quarantine_unreadable,
    refuse_oversized,
    rescan_inbox,
    scan_inbox,
    unreadable_key,
)
from aerodb.storage.workspace_settings import Settings
from aerodb.tasks.steps.counting import WHOLE
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace


def files_of_inbox(
    access: WorkspaceAccess, settings: Settings, vehicle: str | None = None, wait: bool = True
) -> list[InboxFile]:
    """Return the files in the inbox (of one vehicle) with their states.

    wait : give a file that changed a moment ago time to settle (setting `inbox.settle` [s]). One
    larger than the limits [bytes] is refused.
    """
    names = [row.name for row in access.catalogue.vehicles()]
    entries = scan_inbox(access.workspace.inbox, names, settings.inbox.settle)
    if wait and any(may_settle(entry) for entry in entries):
        time.sleep(settings.inbox.settle)
        entries = rescan_inbox(entries, settings.inbox.settle, settings.inbox.settle)
    return [
        refuse_oversized(entry, settings.limits)
        for entry in entries
        if vehicle is None or entry.vehicle == vehicle
    ]


def complete_file(access: WorkspaceAccess, settings: Settings, relative: str) -> list[InboxFile]:
    """Return the one file at this path in the inbox, known to be complete: it need not settle.
    Empty if it is no longer there."""
    entries = files_of_inbox(access, settings, wait=False)
    settle = settings.inbox.settle
    return rescan_inbox([e for e in entries if e.relative == relative], settle, settle)


def set_aside(entry: InboxFile, *, workspace: str, run: str, reason: str) -> dict[str, Any]:
    """Quarantine a file that is never to be read again: a link or pipe unopened, a log by its
    bytes.

    A log whose flight is stored, and which only later steps could not bear, ends as stored, and the
    flight is rejected with the reason. Returns its ending, as `settle` does. Raises StoreError on a
    full disk.
    """
    access = access_workspace(workspace)
    sha256 = "" if entry.state == "refused" else _sha256(access, entry)
    stored = access.catalogue.flights(entry.vehicle, log_sha256=sha256) if sha256 else []
    if stored:
        return _stored_all_the_same(access, entry, stored[0], sha256, run, reason)
    access.catalogue.add_inbox_events(
        [_event(entry, "quarantined", run, sha256 or unreadable_key(entry), reason)]
    )
    log = access.catalogue.log(sha256) if sha256 else None
    if sha256:
        if log is None:
            name = entry.path.name
            access.catalogue.add_log(
                sha256, name=name, size=entry.size, format="", status="quarantined", reason=reason
            )
        access.workspace.quarantine(entry.path, sha256, reason, entry.vehicle)
    else:
        quarantine_unreadable(access.workspace, entry, reason)
    return _ending(entry, "quarantined", {"what": reason})


def _stored_all_the_same(
    access: WorkspaceAccess, entry: InboxFile, row: FlightRow, sha256: str, run: str, reason: str
) -> dict[str, Any]:
    """End a file whose flight is stored: the flight is rejected with the reason."""
    remark = said(f"{access.name_of(row)}: {reason}")
    if remark not in row.remarks:
        access.catalogue.judge_flight(row.id, "rejected", [*row.remarks, remark])
    outcome = {"sha256": sha256, "status": "stored", "flight": row.id, "what": reason}
    verdict = {"verdict": "rejected", "reasons": [*row.reasons, remark.sentence]}
    return _settled(access, entry, {**outcome, "consistency": verdict, "repeats": []}, run)


def _sha256(access: WorkspaceAccess, entry: InboxFile) -> str:
    """Return the hash of a file's bytes, empty if they cannot be read."""
    try:
        with open_log(entry.path, access.workspace.inbox) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def in_quarantine(access: WorkspaceAccess, limit: int | None = None) -> list[Quarantined]:
    """Return the quarantined files, newest first, at most `limit`, without those stored since."""
    entries = newest_quarantined(access.workspace, limit)
    return [
        entry
        for entry in entries
        if not any(
            f.vehicle == entry.vehicle for f in access.catalogue.flights(log_sha256=entry.key)
        )
    ]


def note_tries(access: WorkspaceAccess, entries: Sequence[InboxFile], run: str) -> None:
    """Record an attempt before the files are read, so that a crash of the process counts as one."""
    access.catalogue.add_inbox_events([_event(entry, "tried", run) for entry in entries])


def note_failure(
    access: WorkspaceAccess, entry: InboxFile, run: str, reason: str
) -> dict[str, Any]:
    """Record that a file could not be processed, and return its ending, as `settle` does.

    An empty reason means that the file was not at fault.
    """
    access.catalogue.add_inbox_events([_event(entry, "failed", run, reason=reason)])
    return _ending(entry, "failed", {"what": reason})


def note_no_room(
    access: WorkspaceAccess, entry: InboxFile, run: str, reason: str
) -> dict[str, Any]:
    """Record that the disk or the machine has no room for a file now, and return its ending.

    The file is not at fault and waits (StoreError, MemoryError); see `note_failure`.
    """
    return {**note_failure(access, entry, run, ""), "kind": "no_room", "reason": reason}


def settle(
    dealt: Sequence[tuple[InboxFile, dict[str, Any]]], *, workspace: str, run: str
) -> list[dict[str, Any]]:
    """End files whose per-flight run is over: first the row, then the file leaves the inbox.

    Returns one ending per file: file, vehicle, kind (``stored``, ``duplicate``, ``quarantined``,
    ``failed``, or ``left`` for one that changed meanwhile and waits again), flight, reason,
    verdict.
    """
    access = access_workspace(workspace)
    return [_settled(access, entry, outcome, run) for entry, outcome in dealt]


def _settled(
    access: WorkspaceAccess, entry: InboxFile, outcome: dict[str, Any], run: str
) -> dict[str, Any]:
    there, sha256 = entry.path.exists() or entry.path.is_symlink(), outcome["sha256"]
    if there and not entry.unchanged():
        return _ending(entry, "left", {"what": "changed while it was read"})
    reason = _reason(outcome)
    stored = access.catalogue.flights(entry.vehicle, log_sha256=sha256) if sha256 else []
    if outcome["status"] == "refused" and stored:  # read again under another vehicle file, say
        return _stored_all_the_same(access, entry, stored[0], sha256, run, reason)
    if outcome["status"] == "refused" and not sha256:
        return note_failure(access, entry, run, reason)
    if outcome["status"] == "refused":
        if there:  # refused for another reason than its bytes: it is another vehicle's, say
            access.workspace.quarantine(entry.path, sha256, reason, entry.vehicle)
        access.catalogue.add_inbox_events([_event(entry, "quarantined", run, sha256, reason)])
        return _ending(entry, "quarantined", outcome)
    kind = _kind(access, entry, outcome)
    kept = archived_path(access.workspace, entry, sha256)
    try:
        if there:
            put(access.workspace, entry.path, kept, sha256)
    except InputError as error:
        return _ending(entry, "left", {"what": error.what})
    except (
        StoreError
    ) as error:  # its flight is stored; the log itself waits here until it can be put
        return note_no_room(access, entry, run, str(error))
    with access.catalogue.transaction():
        access.catalogue.add_inbox_events([_event(entry, kind, run, sha256)])
        if there:
            access.catalogue.add_file(access.workspace.relative(kept), sha256, entry.size)
    if there:
        archive_log(entry, kept, sha256)
    return _ending(entry, kind, outcome)


def _kind(access: WorkspaceAccess, entry: InboxFile, outcome: dict[str, Any]) -> InboxKind:
    """Return whether a file is stored or a duplicate.

    A run that crashed after storing a log finds its own flight again: that is not a duplicate.
    """
    earlier = [
        event
        for event in access.catalogue.inbox_events(sha256=outcome["sha256"])
        if event.kind == "stored"
    ]
    if earlier:  # copies that are read side by side do not know of each other
        return (
            "stored"
            if (earlier[0].path, earlier[0].size, earlier[0].mtime_ns) == entry.file
            else "duplicate"
        )
    if outcome["status"] != "duplicate":
        return "stored"
    if sum(repeat["share"] for repeat in outcome["repeats"] if repeat["counts"]) > WHOLE:
        return "duplicate"
    log = access.catalogue.log(outcome["sha256"])
    return "stored" if log is not None and log.name == plain_text(entry.path.name) else "duplicate"


def _reason(outcome: dict[str, Any]) -> str:
    return "; ".join(filter(None, (outcome.get("what", ""), outcome.get("remedy", ""))))


def _event(
    entry: InboxFile, kind: InboxKind, run: str, sha256: str = "", reason: str = ""
) -> InboxEvent:
    return InboxEvent(
        entry.relative, entry.vehicle, entry.size, entry.mtime_ns, kind, sha256, reason, run or None
    )


def _ending(entry: InboxFile, kind: str, outcome: dict[str, Any]) -> dict[str, Any]:
    consistency = outcome.get("consistency") or {}
    return {
        "file": entry.file[0],
        "vehicle": entry.vehicle,
        "kind": kind,
        "flight": outcome.get("flight"),
        "reason": _reason(outcome),
        "verdict": consistency.get("verdict"),
        "verdict_reasons": list(consistency.get("reasons", [])),
    }
