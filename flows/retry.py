"""Retry a quarantined log, a failed run, or the steps of a flight; stored results are reused."""

from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Any, Final

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import again_flow, flight_flow
from aerodb.flows.importing import import_flow, tabulate_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.nightly import nightly_flow
from aerodb.flows.recalibrate import recalibrate_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue import RunRow
from aerodb.storage.inbox import Quarantined, return_to_inbox
from aerodb.tasks.steps import in_quarantine, mark_ended
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Runs a flow with its parameters, as the command line or a test does.
Run = Callable[[Any, dict[str, Any]], Any]

_BODIES: Final[dict[str, Callable[..., Any]]] = {
    body.__name__: body
    for body in (
        flight_flow,
        again_flow,
        sweep_flow,
        nightly_flow,
        update_flow,
        close_loop_flow,
        recalibrate_flow,
        import_flow,
        tabulate_flow,
    )
}
#: Shortest prefix of an id; a shorter one is more likely a mistyped name.
_SHORTEST: Final = 4
#: Flights of each vehicle, the newest, among which proposals are looked for.
_COMPARED: Final = 500


def retry(
    access: WorkspaceAccess, reference: str, vehicle: str | None, run: Run
) -> list[dict[str, Any]]:
    """Retry what `reference` names: ``all``, a log in quarantine (key or name), a failed run, a
    flight.

    vehicle : of a log whose vehicle is unknown. Returns what was done: ``what``, ``kind``,
    ``outcome``, ``reason``. Raises UnknownNameError for an unknown reference.
    """
    mark_ended(access)  # a run whose process is gone has failed, as `aerodb status` says
    entries = in_quarantine(access)
    failed = access.catalogue.unresolved_runs()
    if reference == "all":
        chosen, runs = [entry for entry in entries if entry.can_return], list(failed)
    else:
        chosen = [
            entry for entry in entries if _means(reference, entry.key) or reference == entry.name
        ]
        runs = [] if chosen else [each for each in failed if _means(reference, each.id)]
    if reference != "all" and not chosen and not runs:
        known = [name for entry in entries for name in (entry.name, entry.key[:12])]
        known += [each.id[:12] for each in failed]
        return [_flight_again(access, reference, vehicle, run, known)]
    done = _logs_again(access, chosen, vehicle, run) if chosen or reference == "all" else []
    return done + [_run_again(each, run) for each in runs if each.flow != "sweep_flow" or not done]


def _means(reference: str, id: str) -> bool:
    return len(reference) >= _SHORTEST and id.startswith(reference)


def _logs_again(
    access: WorkspaceAccess, entries: list[Quarantined], vehicle: str | None, run: Run
) -> list[dict[str, Any]]:
    """Put logs back into the inbox and sweep it; one that cannot go back does not stop the
    others."""
    names = [row.name for row in access.catalogue.vehicles()]
    whose = {
        entry.key: entry.vehicle or vehicle or (names[0] if len(names) == 1 else "")
        for entry in entries
    }
    stay = []
    for entry in entries:
        try:
            if whose[entry.key] not in names:
                raise InputError(
                    "the vehicle that flew it is unknown",
                    entry.name,
                    f"--vehicle {' or '.join(names[:6])}",
                )
            return_to_inbox(access.workspace, entry, whose[entry.key])
        except InputError as error:
            if len(entries) == 1:
                raise
            reason = f"{error.what}: {error.remedy}"
            stay.append(
                {"what": entry.name, "kind": "log", "outcome": "quarantined", "reason": reason}
            )
    files = run(sweep_flow, {})["files"]
    return stay + [
        {"what": e["file"], "kind": "log", "outcome": e["kind"], "reason": e["reason"]}
        for e in files
    ]


def _run_again(row: RunRow, run: Run) -> dict[str, Any]:
    document = {"what": row.id, "kind": "run", "outcome": "completed", "reason": row.flow}
    if row.flow not in _BODIES:
        return {
            **document,
            "outcome": "failed",
            "reason": f"{row.flow} cannot be retried on its own",
        }
    try:
        run(_BODIES[row.flow], dict(row.parameters))
    except Exception as error:  # the others are tried all the same; the record of runs has it, too
        return {**document, "outcome": "failed", "reason": f"{row.flow}: {error}"}
    return document


def _flight_again(
    access: WorkspaceAccess,
    reference: str,
    vehicle: str | None,
    run: Run,
    known: Sequence[str],
) -> dict[str, Any]:
    """Repeat the steps of a flight; known : what else could have been meant."""
    try:
        flight = access.catalogue.flight(reference, vehicle)
    except UnknownNameError as error:
        what = f"neither a log in quarantine, nor a failed run, nor a flight: '{reference[:80]}'"
        rows = access.catalogue.vehicles()
        newest = [f for row in rows for f in access.catalogue.newest_flights(row.name, _COMPARED)]
        close = get_close_matches(reference[:128], ["all", *known, *(f.label for f in newest)])
        remedy = "aerodb status lists what can be retried"
        if close:
            remedy = f"did you mean {' or '.join(map(repr, close))}? {remedy}"
        raise UnknownNameError(what, "retry", remedy) from error
    document = run(again_flow, {"flight": flight.id})
    verdict = document["consistency"]["verdict"] if document["consistency"] else ""
    return {"what": flight.id, "kind": "flight", "outcome": "completed", "reason": verdict}
