"""What people note: comments and tags of versions, and failed runs that need nothing more."""

from typing import Any

from aerodb.errors import UnknownNameError, nearest
from aerodb.storage.catalogue import NoteKind, VersionRow
from aerodb.tasks.actors import require_role, user
from aerodb.tasks.steps.runs import mark_ended
from aerodb.tasks.view import notes_document
from aerodb.tasks.workspace_access import WorkspaceAccess


def note_version(
    access: WorkspaceAccess, version: VersionRow, kind: NoteKind, text: str
) -> dict[str, Any]:
    """Comment on a version, give it a tag, or take one away; the role `ingest` is needed. Raises
    InputError for an empty comment or a tag that is not allowed.

    Returns a document: version, label, vehicle, tags, comments (oldest first).
    """
    require_role(access.workspace, access.catalogue, "ingest", "a note on a version")
    access.catalogue.add_note(version.id, kind, text, user=user())
    return {
        "version": version.id,
        "label": version.label,
        "vehicle": version.vehicle,
        **notes_document(access.catalogue, access.catalogue.notes_of([version.id])[version.id]),
    }


def dismiss(access: WorkspaceAccess, reference: str, reason: str) -> dict[str, Any]:
    """Dismiss a failed run (its id, or a unique prefix): status no longer lists it, and ``retry
    all`` leaves it; the role `release` is needed. Nothing is deleted.

    Returns a document: run, flow, error, reason, user. Raises UnknownNameError, with the nearest,
    where no failed run is meant.
    """
    require_role(access.workspace, access.catalogue, "release", "dismissing a run")
    mark_ended(access)  # a run whose process is gone has failed
    failed = {run.id: run for run in access.catalogue.unresolved_runs()}
    meant = [run for id, run in failed.items() if reference and id.startswith(reference)]
    if len(meant) != 1:
        what = f"{'several failed runs' if meant else 'no failed run'}: '{reference[:80]}'"
        known = [id[:12] for id in failed]
        remedy = nearest(reference[:64], known) if known else "aerodb status lists failed runs"
        raise UnknownNameError(what, "dismiss", remedy)
    run = meant[0]
    access.catalogue.dismiss_run(run.id, reason, user=user())
    document = {"run": run.id, "flow": run.flow, "error": run.error}
    return {**document, "reason": reason, "user": user()}
