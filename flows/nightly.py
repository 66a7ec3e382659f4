"""Nightly flow: mark crashed runs, sweep the inbox, update databases with enough new flights.

The cost of a night depends on what is new, not on what is stored.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from aerodb.errors import AeroError, StoreError
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.run import Steps, requires, run_part
from aerodb.flows.update import update_flow
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import SettingsError, load_settings
from aerodb.tasks.steps import deliver, due, mark_ended, parameters_of, tell, trim_cache
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

_BODIES: Final[dict[str, Callable[..., Any]]] = {
    "close-loop": close_loop_flow,
    "update": update_flow,
}


def night_lock(workspace: Workspace, vehicle: str | None) -> Path:
    """Return the lock of a night, for one vehicle or for all; without it, a night does not
    start."""
    return workspace.lock(f"nightly-{vehicle}" if vehicle else "nightly")


@requires("ingest")
def nightly_flow(
    steps: Steps, *, workspace: str, run: str, vehicle: str | None = None, scheduled: bool = False
) -> dict[str, Any]:
    """Run one night, for one `vehicle` or for all.

    scheduled : leave out vehicles that have a schedule of their own. Returns the sweep's document
    with ``crashed`` runs and ``loops``: per vehicle and way, whether it was due, how many flights
    were new, the candidate (None if nothing was added) and the error of one that failed; one
    failure stops no other. ``trimmed`` says what was removed from the cache of an object store.
    """
    access = access_workspace(workspace)
    names = [row.name for row in access.catalogue.vehicles()]
    settings = load_settings(access.workspace.root, tuple(names))
    crashed = mark_ended(access)
    swept, fault = _swept(steps, workspace, run, vehicle)
    loops = [
        _advanced(steps, access, name, way, run)
        for name in names
        if name == vehicle or (vehicle is None and not (scheduled and settings.of(name).schedule))
        for way in settings.loop_of(name).run
    ]
    undelivered = steps(deliver, workspace, workspace=workspace, run=run)
    trimmed = steps(trim_cache, workspace, workspace=workspace, run=run)
    if (
        fault is not None
    ):  # said once all else is done: a log that waits for room keeps no database from going on
        raise fault
    return {
        **swept,
        "crashed": crashed,
        "loops": loops,
        "undelivered": undelivered,
        "trimmed": trimmed,
    }


def _swept(
    steps: Steps, workspace: str, run: str, vehicle: str | None
) -> tuple[dict[str, Any], AeroError | None]:
    """Return the sweep's document, or the error that ended it."""
    try:
        return sweep_flow(steps, workspace=workspace, run=run, vehicle=vehicle), None
    except (StoreError, SettingsError) as error:
        return {}, error


def _advanced(
    steps: Steps, access: WorkspaceAccess, vehicle: str, way: str, run: str
) -> dict[str, Any]:
    """Update one database in one way if it is due, and return the outcome."""
    loop = load_settings(access.workspace.root).loop_of(vehicle)
    state = due(access, vehicle, loop, way)
    outcome: dict[str, Any] = {
        "vehicle": vehicle,
        "way": way,
        "due": state.is_due,
        "new": state.new,
        "after": state.after,
    }
    outcome |= {"candidate": None, "label": None, "error": ""}
    if not state.is_due:
        return outcome
    before = access.named(vehicle, "candidate")
    try:
        parameters = parameters_of(access, vehicle, loop, way, state)
        document = run_part(steps, _BODIES[way], parameters, str(access.workspace.root), run)
    except Exception as error:
        text = f"{way} of {vehicle} failed: {error}"
        tell(
            access.workspace,
            "failed",
            vehicle,
            text,
            {"way": way, "error": f"{type(error).__name__}: {error}"},
        )
        return {**outcome, "error": str(error)}
    outcome |= {"candidate": document["candidate"], "label": document["label"]}
    if document["candidate"] and document["candidate"] != before:
        text = (
            f"new candidate {document['label']} of {vehicle}: review it, then promote it or"
            " leave it"
        )
        axes = {
            axis: {k: entry.get(k) for k in ("rms_before", "rms_after", "outcome")}
            for axis, entry in document["axes"].items()
        }
        details = {"version": document["candidate"], "label": document["label"], "axes": axes}
        tell(access.workspace, "candidate", vehicle, text, details)
    return outcome
