"""``aerodb serve``, ``nightly``, ``status`` and ``retry``: unattended operation, and its status."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError, StoreBusyError
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Direct
from aerodb.storage.locks import take
from aerodb.tasks.result_versions import OF_LINES

if TYPE_CHECKING:
    from aerodb.storage.workspace import Workspace
    from aerodb.tasks.workspace_access import WorkspaceAccess


#: Largest number of entries printed of each kind; `--json` lists more.
_LISTED = 20


def _first_line(text: str) -> str:
    return next(iter(text.splitlines()), "")


def _access(session: Session) -> "WorkspaceAccess":
    from aerodb.tasks.workspace_access import WorkspaceAccess

    return WorkspaceAccess(session.workspace(), session.catalogue())


def serve(context: typer.Context) -> None:
    """Serve the workspace until stopped: Prefect server, schedules and inbox; one per workspace.

    The settings are in settings.toml of the workspace.

    Example: aerodb serve
    """
    from aerodb.flows.serve import serve as serve_workspace

    session: Session = context.obj
    workspace: Workspace = session.workspace(create=True)
    session.catalogue(create=True).close()
    serve_workspace(workspace, session.say)


def nightly(
    context: typer.Context,
    vehicle: Annotated[str | None, typer.Option(help="Only this vehicle.")] = None,
    direct: Direct = False,
) -> None:
    """Run the nightly flow once: sweep the inbox, update databases that are due, notify.

    Example: aerodb nightly
    """
    from aerodb.flows.nightly import night_lock, nightly_flow

    session: Session = context.obj
    if vehicle is not None:
        session.catalogue().vehicle(vehicle)
    lock = take(night_lock(session.workspace(), vehicle))
    if lock is None:
        what, remedy = (
            "a nightly run of this workspace is already running",
            "wait for it to end; aerodb status shows what runs",
        )
        raise StoreBusyError(what, str(session.workspace().root), remedy)
    try:
        document = session.run(nightly_flow, {"vehicle": vehicle}, direct, attended=False)
    finally:
        lock.release()
    for run in document["crashed"]:
        session.say(f"crashed before: {run['flow']} ({run['run'][:12]})")
    _say_files(session, document["files"])
    for entry in document["waiting"]:
        session.say(f"waits: {entry['file']}: {entry['reason']}")
    for loop in document["loops"]:
        session.say(_loop_text(loop))
    for entry in document["undelivered"]:
        session.say(f"not delivered: {entry['text']} ({entry['error']})")
    session.answer(document)
    if any(loop["error"] for loop in document["loops"]) or any(
        e["kind"] in ("failed", "no_room") for e in document["files"]
    ):
        raise typer.Exit(1)


def _say_files(session: Session, files: list[dict[str, Any]]) -> None:
    counts = {
        kind: sum(entry["kind"] == kind for entry in files)
        for kind in dict.fromkeys(e["kind"] for e in files)
    }
    session.say(
        "inbox: "
        + (", ".join(f"{number} {kind}" for kind, number in counts.items()) or "nothing was ready")
    )
    for entry in files:
        if entry["kind"] in ("quarantined", "failed", "no_room", "left"):
            session.say(f"  {entry['file']}: {entry['kind']}: {entry['reason']}")
        elif entry["verdict"] == "rejected":
            session.say(
                f"  {entry['file']}: stored and rejected: {'; '.join(entry['verdict_reasons'])}"
            )


def _loop_text(loop: dict[str, Any]) -> str:
    start = f"{loop['way']} of {loop['vehicle']}"
    if loop["error"]:
        return f"{start}: failed: {loop['error']}"
    if not loop["due"]:
        return f"{start}: not due, {loop['new']} new flights (needs {loop['after']})"
    return f"{start}: candidate {loop['label']}" if loop["label"] else f"{start}: nothing was added"


def status(context: typer.Context) -> None:
    """Show what waits, runs and failed, why, and what to do about it.

    Example: aerodb status
    """
    from aerodb.tasks.view import status_of

    session: Session = context.obj
    document = status_of(_access(session))
    serving, todo = document["serve"], document["todo"]
    things = "1 thing" if len(todo) == 1 else f"{len(todo)} things"
    session.say(f"{things} to do:" if todo else "nothing to do")
    for sentence in todo:
        session.say(f"- {sentence}")
    where = (
        f"yes, process {serving.get('pid')} at {serving.get('url')}" if serving["running"] else "no"
    )
    session.say(
        f"served: {where}; nightly: {serving['schedule']}; free disk:"
        f" {document['free_bytes'] / 1e9:.1f} GB"
    )
    if reach := document["reader_reach"]:
        session.say(f"this system lets the process that reads a log reach {reach}")
    for heading in ("waiting", "running", "failed"):
        session.say(f"{heading}: {len(document[heading]) or 'nothing'}")
    if document["waiting"]:
        rows = [
            [e["file"], e["state"], str(e["tries"]), e["reason"]]
            for e in document["waiting"][:_LISTED]
        ]
        session.table(["file", "state", "tries", "why"], rows, numbers=(2,))
    _say_runs(session, [*document["running"], *document["failed"]])
    aside = document["quarantined"]
    session.say(f"in quarantine: {aside['count'] or 'nothing'}")
    if aside["newest"]:
        rows = [
            [e["key"][:12], e["name"], e["vehicle"], _first_line(e["reason"])]
            for e in aside["newest"]
        ]
        session.table(["key", "log", "vehicle", "why"], rows[:_LISTED])
    for entry in document["vehicles"]:
        loops = "; ".join(
            f"{d['way']}: {d['new']} new flights (needs {d['after']})" for d in entry["loops"]
        )
        session.say(
            f"{entry['vehicle']}: released {entry['released'] or '-'}, candidate"
            f" {entry['candidate'] or '-'}{_of_lines(entry)}; {loops}"
        )
        if entry["rejected"]:
            session.say(f"rejected of the newest flights of {entry['vehicle']}:")
            cells = [
                [e["log"] or e["flight"][:12], _first_line(e["reason"])] for e in entry["rejected"]
            ]
            session.table(["flight", "why"], cells)
    session.answer(document)


def _of_lines(entry: Mapping[str, Any]) -> str:
    """What the lines of friction and wakes of a vehicle have; empty where there are none."""
    return "".join(f", {name} {entry[name]}" for name in OF_LINES if name in entry)


def _say_runs(session: Session, runs: list[dict[str, Any]]) -> None:
    if not runs:
        return
    rows = [
        [e["run"][:12], e["flow"], e["state"], e["started_utc"][:19], _first_line(e["error"])]
        for e in runs[:_LISTED]
    ]
    session.table(["run", "flow", "state", "started", "why"], rows)


def dismiss(
    context: typer.Context,
    run: Annotated[str, typer.Argument(help="A failed run: its id, or the first digits of it.")],
    reason: Annotated[str, typer.Option(help="Why nothing more is to be done; it is stored.")],
) -> None:
    """Dismiss a failed run: status no longer lists it, and `retry all` leaves it.

    Example: aerodb dismiss 1a2b3c4d --reason "disk replaced, logs ingested by hand"
    """
    from aerodb.tasks.steps import dismiss as dismiss_run

    session: Session = context.obj
    document = dismiss_run(_access(session), run, reason)
    session.say(f"run {document['run'][:12]} ({document['flow']}) dismissed: {reason}")
    session.answer(document)


def retry(
    context: typer.Context,
    what: Annotated[
        str,
        typer.Argument(help="A log in quarantine (key or name), a failed run, a flight, or `all`."),
    ],
    vehicle: Annotated[
        str | None, typer.Option(help="The vehicle that flew the log, if it is unknown.")
    ] = None,
    direct: Direct = False,
) -> None:
    """Retry what failed: a quarantined log, a run, or the steps of a flight.

    Example: aerodb retry all
    """
    from aerodb.flows.retry import retry as do_again

    session: Session = context.obj
    if not what.strip():
        raise InputError(
            "no log, run or flight is named", "retry", "aerodb status lists what can be retried"
        )
    access = _access(session)
    done = do_again(
        access, what, vehicle, lambda body, parameters: session.run(body, parameters, direct)
    )
    for entry in done:
        session.say(
            f"{entry['what']}:"
            f" {entry['outcome']}{': ' + entry['reason'] if entry['reason'] else ''}"
        )
    if not done:
        session.say("nothing to retry")
    session.answer(done)
    if any(entry["outcome"] == "quarantined" for entry in done):
        raise typer.Exit(3)
    if any(entry["outcome"] == "failed" for entry in done):
        raise typer.Exit(1)
