"""Status of a workspace: what waits, runs and failed, why, and what to do about it."""

import shutil
from typing import Any, Final

from aerodb.errors import AeroError
from aerodb.storage.catalogue import RunRow
from aerodb.storage.confinement import reader_reach
from aerodb.storage.inbox import count_quarantined, undelivered_notifications
from aerodb.storage.locks import is_held, note_of
from aerodb.storage.workspace_settings import LoopSettings, Schedule, Settings, load_settings
from aerodb.tasks.result_versions import CANDIDATE, OF_LINES, RELEASED
from aerodb.tasks.steps import Due, due, files_of_inbox, in_quarantine, parameters_of
from aerodb.tasks.view.version_documents import waiting
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Largest number of entries listed of each kind; the counts include all.
_LISTED: Final = 50
#: Entries of the service's lock note that are shown; its token is not.
_SHOWN: Final = ("pid", "url", "since_utc")


def status_of(access: WorkspaceAccess) -> dict[str, Any]:
    """Return the status document.

    Keys: serve, settings, waiting, running, failed, quarantined, vehicles, undelivered, free_bytes,
    reader_reach (`aerodb.storage.confinement`), todo. ``todo`` lists in plain sentences what a
    person should do now; empty if nothing. Sizes are in [bytes], times in UTC; a fault of the
    settings is reported, not raised as InputError.
    """
    settings, fault = _settings(access)
    serving = {
        key: value
        for key, value in note_of(access.workspace.lock("serve")).items()
        if key in _SHOWN
    }
    runs = access.catalogue.runs("running", limit=1000)
    alive = [run for run in runs if is_held(access.workspace.lock(f"run-{run.id}"))]
    dead = [run for run in runs if run not in alive]
    failed = [_run(run, "its process ended without a message") for run in dead]
    failed += [_run(run, run.error) for run in access.catalogue.unresolved_runs(_LISTED)]
    aside = in_quarantine(access, _LISTED)
    elsewhere = min(count_quarantined(access.workspace), _LISTED) - len(aside)
    document: dict[str, Any] = {
        "serve": {
            "running": is_held(access.workspace.lock("serve")),
            **serving,
            "schedule": schedule_text(settings.nightly),
        },
        "settings": fault or "valid",
        "waiting": _waiting(access, settings),
        "running": [_run(run, "") for run in alive],
        "failed": failed,
        "quarantined": {
            "count": count_quarantined(access.workspace) - elsewhere,
            "newest": [
                {
                    "key": e.key,
                    "name": e.name,
                    "vehicle": e.vehicle,
                    "reason": e.reason,
                    "what": e.what,
                    "at_utc": e.at_utc,
                }
                for e in aside
            ],
        },
        "vehicles": [_vehicle(access, settings, row.name) for row in access.catalogue.vehicles()],
        "undelivered": [
            message["text"] for _, message in undelivered_notifications(access.workspace)
        ][:_LISTED],
        "free_bytes": shutil.disk_usage(access.workspace.root).free,
        "reader_reach": reader_reach(),
    }
    return {
        **document,
        "todo": [*_todo(document, settings.limits.reserve), *_decisions(access)],
    }


def _settings(access: WorkspaceAccess) -> tuple[Settings, str]:
    try:
        return (
            load_settings(
                access.workspace.root, tuple(row.name for row in access.catalogue.vehicles())
            ),
            "",
        )
    except AeroError as error:
        return Settings(), str(error)


def schedule_text(schedule: Schedule) -> str:
    """Return a schedule in words."""
    return (
        f"every {schedule.every:g} s"
        if schedule.every is not None
        else f"cron {schedule.cron} ({schedule.timezone})"
    )


def _waiting(access: WorkspaceAccess, settings: Settings) -> list[dict[str, Any]]:
    entries = files_of_inbox(access, settings, wait=False)
    tries = access.catalogue.inbox_attempts(entry.relative for entry in entries)
    return [
        {
            "file": entry.file[0],
            "vehicle": entry.vehicle,
            "size": entry.size,
            "state": entry.state,
            "tries": tries.get(entry.file, (0, ""))[0],
            "reason": entry.reason or tries.get(entry.file, (0, ""))[1],
        }
        for entry in entries
    ]


def _run(run: RunRow, error: str) -> dict[str, Any]:
    ended = run.ended_utc.isoformat() if run.ended_utc else None
    document = {
        "run": run.id,
        "flow": run.flow,
        "vehicle": run.parameters.get("vehicle"),
        "state": run.state,
    }
    return {
        **document,
        "started_utc": run.started_utc.isoformat(),
        "ended_utc": ended,
        "error": error,
    }


def _vehicle(access: WorkspaceAccess, settings: Settings, name: str) -> dict[str, Any]:
    loop = settings.loop_of(name)
    states = {way: due(access, name, loop, way) for way in loop.run}
    labels = {}
    for pointer in (RELEASED, CANDIDATE, *OF_LINES):
        version = access.named(name, pointer)
        if version or pointer not in OF_LINES:
            labels[pointer] = access.catalogue.version_of_id(version).label if version else None
    loops = [
        {
            "way": way,
            "new": d.new,
            "after": d.after,
            "due": d.is_due,
            "fault": _fault(access, name, loop, way, d),
        }
        for way, d in states.items()
    ]
    return {"vehicle": name, **labels, "loops": loops, "rejected": _rejected(access, name)}


def _rejected(access: WorkspaceAccess, name: str) -> list[dict[str, str]]:
    """Return the rejected ones of the newest flights of a vehicle, with their logs and reasons."""
    rows = [
        row
        for row in access.catalogue.newest_flights(name, _LISTED)
        if row.verdict == "rejected" and row.retracted_utc is None
    ]
    logs = [access.catalogue.log(row.log_sha256) for row in rows]
    return [
        {"flight": row.id, "log": "" if log is None else log.name, "reason": "; ".join(row.reasons)}
        for row, log in zip(rows, logs, strict=True)
    ]


def _fault(access: WorkspaceAccess, name: str, loop: LoopSettings, way: str, state: Due) -> str:
    """Return why an update could not start; empty if it could."""
    try:
        parameters_of(access, name, loop, way, state)
    except AeroError as error:
        return str(error)
    return "" if state.baseline else "no database is released: aerodb database import FILE"


def _decisions(access: WorkspaceAccess) -> list[str]:
    """Return which versions wait for a decision, and the command that shows what to decide on."""
    return [
        f"{row.label} of {row.vehicle} waits for a decision: aerodb version gate {row.label}"
        f" --vehicle {row.vehicle}"
        for vehicle in access.catalogue.vehicles()
        for row in waiting(access.catalogue, vehicle.name)
    ]


def _todo(document: dict[str, Any], reserve: int) -> list[str]:
    items = []
    if document["free_bytes"] < reserve:
        items.append(
            f"free disk space: {document['free_bytes'] / 1e6:.0f} MB are left, and no log is"
            f" ingested below {reserve / 1e6:.0f} MB ([limits] reserve)"
        )
    if document["settings"] != "valid":
        items.append(f"fix the settings: {document['settings'].splitlines()[0]}")
    for entry in document["waiting"]:
        if entry["state"] == "blocked":
            items.append(f"{entry['file']}: {entry['reason']}")
    ready = sum(entry["state"] in ("ready", "refused") for entry in document["waiting"])
    if ready and not document["serve"]["running"]:
        items.append(
            f"{ready} logs wait and no aerodb serve runs on this workspace: aerodb nightly ingests"
            " them once, aerodb serve continuously"
        )
    for run in document["failed"]:
        items.append(
            f"{run['flow']} failed ({(run['error'].splitlines() or ['?'])[0][:200]}): aerodb retry"
            f" {run['run'][:12]}, or aerodb dismiss {run['run'][:12]} --reason WHY"
        )
    for entry in document["vehicles"]:
        items += [
            f"{d['way']} of {entry['vehicle']}: {d['fault'].splitlines()[0]}"
            for d in entry["loops"]
            if d["fault"]
        ]
    if document["quarantined"]["count"]:
        items.append(
            f"{document['quarantined']['count']} logs are in quarantine: see why, fix the cause"
            " (vehicle file, mapping), then aerodb retry KEY or aerodb retry all"
        )
    items += [
        f"not delivered: {text}; see the webhook or command in the settings"
        for text in document["undelivered"]
    ]
    return items
