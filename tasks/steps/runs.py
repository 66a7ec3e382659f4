"""Runs that did not record their end: their process was killed, or the machine went down."""

from typing import Any

from aerodb.storage.catalogue import RunState
from aerodb.storage.locks import is_held
from aerodb.tasks.steps.notify import tell
from aerodb.tasks.workspace_access import WorkspaceAccess


def mark_ended(
    access: WorkspaceAccess,
    state: RunState = "crashed",
    why: str = "its process ended without a message",
) -> list[dict[str, Any]]:
    """Mark every run as ended that counts as running but whose lock is free.

    Returns these runs, newest first, with `RunRow`'s start (UTC). Raises InputError where the
    catalogue belongs to another workspace.
    """
    access.catalogue.require_own()
    ended = []
    for run in access.catalogue.runs("running", limit=10_000):
        if is_held(access.workspace.lock(f"run-{run.id}")):
            continue
        row = access.catalogue.end_run(run.id, state, error=why)
        access.workspace.lock(f"run-{run.id}").unlink(missing_ok=True)
        if row.state != state:  # it has come to its end meanwhile
            continue
        ended.append({"run": run.id, "flow": run.flow, "started_utc": run.started_utc.isoformat()})
        if state == "crashed":
            vehicle = str(run.parameters.get("vehicle") or "")
            tell(
                access.workspace,
                "failed",
                vehicle,
                f"a run of {run.flow} crashed: {why}",
                ended[-1],
            )
    return ended
