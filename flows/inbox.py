"""Sweep of the inbox: each complete file ends as stored, duplicate or quarantined.

One bad file stops no other. The sweep looks at the inbox itself, not at the event that triggered
it: a lost trigger costs nothing but time.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from aerodb.errors import StoreBusyError, StoreError, is_of_machinery
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import Steps, requires
from aerodb.storage.files import remove_abandoned
from aerodb.storage.inbox import InboxFile
from aerodb.storage.locks import holding
from aerodb.storage.workspace_settings import Settings, SettingsError, load_settings
from aerodb.tasks.steps import (
    complete_file,
    deliver,
    files_of_inbox,
    note_failure,
    note_no_room,
    note_tries,
    set_aside,
    settle,
    tell,
)
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

#: Files of one vehicle in one per-flight run; finished batches stay stored if a later one fails.
BATCH: Final = 32
#: Largest number of files named in one notification.
_NAMED: Final = 20


@requires("ingest")
def sweep_flow(
    steps: Steps, *, workspace: str, run: str, vehicle: str | None = None, file: str | None = None
) -> dict[str, Any]:
    """Ingest what waits in the inbox, of one `vehicle` or of all, or one complete `file` (its path
    in the inbox); a second sweep waits for the first.

    Returns a document: ``files``, one ending each (`aerodb.tasks.steps.inbox.settle`, or
    ``no_room``), ``waiting``, what stays and why, and ``undelivered`` notifications.

    Raises StoreError if there was no room for any file and, after everything else is done,
    SettingsError if settings or what they name cannot be used: no attempt counts then.
    """
    access = access_workspace(workspace)
    settings = load_settings(access.workspace.root)
    with holding(access.workspace.lock("inbox")):
        entries = (
            files_of_inbox(access, settings, vehicle)
            if file is None
            else complete_file(access, settings, file)
        )
        files: list[dict[str, Any]] = []
        faults: list[SettingsError] = []
        try:
            for batch in _batches(access, settings, entries):
                try:
                    files += _dealt(steps, access, settings, batch, run)
                except SettingsError as error:  # of one vehicle's mapping, perhaps
                    faults.append(error)
        finally:
            _tell(access, files)
        if files:  # a run that was killed may have left its workers' unfinished files
            remove_abandoned(access.workspace)
    _check_progress(files, faults)
    left = [entry for entry in entries if entry.state in ("copying", "blocked")]
    waiting = [
        {"file": e.file[0], "vehicle": e.vehicle, "state": e.state, "reason": e.reason}
        for e in left
    ]
    undelivered = steps(deliver, workspace, workspace=workspace, run=run)
    return {"files": files, "waiting": waiting, "undelivered": undelivered}


def _check_progress(files: Sequence[dict[str, Any]], faults: Sequence[SettingsError]) -> None:
    """Raise the error that kept the sweep from doing anything, or that somebody must fix."""
    if faults:
        raise faults[0]
    if files and all(ending["kind"] == "no_room" for ending in files):
        others = f"; {len(files) - 1} more logs are waiting" if len(files) > 1 else ""
        raise StoreError(f"{files[0]['reason']}{others}", files[0]["file"])


def _batches(
    access: WorkspaceAccess, settings: Settings, entries: Sequence[InboxFile]
) -> Iterator[list[tuple[InboxFile, str]]]:
    """Yield the files to process together, each with the reason to quarantine it, if any.

    A file that was tried before is processed alone.
    """
    attempts = access.catalogue.inbox_attempts(entry.relative for entry in entries)
    fresh: dict[str, list[tuple[InboxFile, str]]] = {}
    alone: list[list[tuple[InboxFile, str]]] = []
    for entry in entries:
        times, error = attempts.get(entry.file, (0, ""))
        if entry.state == "refused":
            alone.append([(entry, entry.reason)])
        elif entry.state != "ready":
            continue
        elif times >= settings.inbox.attempts:
            alone.append(
                [
                    (
                        entry,
                        (
                            f"tried {times} times:"
                            f" {error or 'the process that read it died each time'}"
                        ),
                    )
                ]
            )
        elif times:
            alone.append([(entry, "")])
        else:
            fresh.setdefault(entry.vehicle, []).append((entry, ""))
    for files in fresh.values():
        yield from (files[start : start + BATCH] for start in range(0, len(files), BATCH))
    yield from alone


def _dealt(
    steps: Steps,
    access: WorkspaceAccess,
    settings: Settings,
    batch: Sequence[tuple[InboxFile, str]],
    run: str,
) -> list[dict[str, Any]]:
    where = {"workspace": str(access.workspace.root), "run": run}
    if batch[0][1]:
        return [steps(set_aside, entry, **where, reason=reason) for entry, reason in batch]
    entries = [entry for entry, _ in batch if entry.unchanged()]
    if not entries:
        return []
    note_tries(access, entries, run)
    own = settings.of(entries[0].vehicle)
    logs, vehicle = [str(entry.path) for entry in entries], entries[0].vehicle
    try:
        outcomes = flight_flow(
            steps, **where, logs=logs, vehicle=vehicle, mapping=own.mapping, strict=own.strict
        )
    except BaseException as error:
        if len(entries) == 1 and _is_its_fault(error):
            return [note_failure(access, entries[0], run, f"{type(error).__name__}: {error}")]
        if len(entries) == 1 and _is_no_room(error):
            return [note_no_room(access, entries[0], run, str(error))]
        for (
            entry
        ) in entries:  # not their fault, or one of them did it: the tries of all are taken back
            note_failure(access, entry, run, "")
        if not (_is_its_fault(error) or _is_no_room(error)):
            raise
        # Process each file alone, so that a bad one affects no other.
        return [
            ending
            for entry in entries
            for ending in _dealt(steps, access, settings, [(entry, "")], run)
        ]
    endings: list[dict[str, Any]] = steps(
        settle, list(zip(entries, outcomes, strict=True)), **where
    )
    return endings


def _is_its_fault(error: BaseException) -> bool:
    """Return whether the file may have caused an error.

    Otherwise it was an interrupt, the disk, the settings, or the orchestrator.
    """
    if (
        type(error).__name__ == "TaskRunTimeoutError"
    ):  # the orchestrator's: the file took longer than a step may
        return True
    return (
        isinstance(error, Exception)
        and not isinstance(error, (OSError, SettingsError))
        and not is_of_machinery(error)
    )


def _is_no_room(error: BaseException) -> bool:
    """Return whether there was no room for one log; a smaller one may still fit."""
    return isinstance(error, StoreError) and not isinstance(error, StoreBusyError)


def _tell(access: WorkspaceAccess, files: Sequence[dict[str, Any]]) -> None:
    """Queue one notification per vehicle for refused files, and one for failed files."""
    for vehicle in sorted({ending["vehicle"] for ending in files}):
        mine = [ending for ending in files if ending["vehicle"] == vehicle]
        refused = [e for e in mine if e["kind"] == "quarantined" or e["verdict"] == "rejected"]
        failed = [e for e in mine if e["kind"] == "failed"]
        named = [
            {"file": e["file"], "reason": e["reason"] or "; ".join(e["verdict_reasons"])}
            for e in refused or failed
        ]
        details = {"count": len(named), "files": named[:_NAMED]}
        if refused:
            text = (
                f"{len(refused)} of {len(mine)} logs of {vehicle or 'no vehicle'} were refused or"
                " rejected"
            )
            tell(access.workspace, "refused", vehicle, text, details)
        elif failed:
            tell(
                access.workspace,
                "failed",
                vehicle,
                f"{len(failed)} logs of {vehicle} could not be processed",
                details,
            )
