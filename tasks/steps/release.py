"""Move names of versions: ``released`` through the gate, other names freely, each move logged."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

from aerodb.conditioning import Suspicion
from aerodb.errors import GateRefusal, InputError
from aerodb.exchange import database_content_sha256
from aerodb.increments import (
    AT_LEAST,
    CONTENT,
    CONTRADICTIONS,
    FILE_CHECKS,
    SENSORS,
    GateCheck,
    GateVerdict,
    Measure,
    Standing,
    judge_aliases,
    judge_contradictions,
    judge_derivatives,
    judge_import,
    judge_release,
    judge_rivals,
    judge_shapes,
    notes_on_release,
    open_shapes,
)
from aerodb.remarks import CONTRADICTS, SUSPECTED
from aerodb.storage.catalogue import (
    FlightRow,
    NameEvent,
    VersionDocuments,
    VersionRow,
    standing_moves,
)
from aerodb.storage.encoding import VERSION_NAME, checked, plain_text
from aerodb.storage.workspace_settings import GateSettings, load_settings
from aerodb.suspicions import limits_flight
from aerodb.tables import AeroDatabase, CheckCase
from aerodb.tasks.actors import user
from aerodb.tasks.result_versions import NAMES, RELEASED
from aerodb.tasks.steps.conditioning import stored_suspicions
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace, database_from

#: What the versions of a line are, in words.
_OF: Final = {"": "aerodynamics", "friction": "legs alone", "wake": "wakes alone"}


def promote(
    version: str,
    *,
    workspace: str,
    run: str,
    name: str,
    reason: str,
    accept: Sequence[str] = (),
) -> dict[str, Any]:
    """Point `name` at a version (its id); ``released`` only through the gate. In the lines of
    friction and of wakes that is ``released-friction`` or ``released-wake`` (`NAMES`).

    accept : changes of derivatives (``Cm_delta_elevator``), errors of sensors
    (``alpha_scale@all``, all of them ``sensors``), estimates that cannot be told apart
    (``alias@Cm``), findings whose shape is open (``unnamed@CZ``) and ``contradictions`` of flights,
    for which the gate would refuse; they are stored with the reason.

    Returns a document: vehicle, name, version, label, previous, moved, checks, notes (what was not
    held out, what is only suspected), derivatives. Raises GateRefusal with every reason, also if
    another run moved the name meanwhile; nothing is changed
    then.
    """
    access = access_workspace(workspace)
    catalogue = access.catalogue
    row = catalogue.version_of_id(version)
    _check_words(name, reason)
    own = _released_name(access, row)
    name = own if name == RELEASED else name
    guarded = name == own
    others = {names[RELEASED]: _OF[line] for line, names in NAMES.items()}
    if not guarded and name in others:
        raise InputError(
            f"'{name}' is of {others[name]}", f"version {row.label}", f"its line has the name {own}"
        )
    current = catalogue.named(row.vehicle, name)
    if current is not None and current.version == row.id:
        return _document(current, row, moved=False)
    used = _used(row, access) if guarded else []
    verdict = _gate(access, row, used, current, accept, run) if guarded else GateVerdict(())
    if not verdict.passed:
        raise _refusal(row, verdict.reasons)
    if accept:
        reason = f"{reason} (accepted: {', '.join(accept)})"
    with catalogue.transaction():
        # A flight may have been retracted while the gate was judging.
        if guarded and (stale := catalogue.stale(row.id)):
            raise _refusal(row, stale)
        expected = current.version if current is not None else None
        event = catalogue.move_name(
            row.vehicle, name, row.id, user=user(), reason=reason, expected=expected
        )
    report = catalogue.version_documents(row.id).report
    notes = [*notes_on_release(report), *_suspected(used, access)] if guarded else []
    return {
        **_document(event, row, moved=True),
        "checks": [check.name for check in verdict.checks],
        "notes": notes,
        "derivatives": report.get("derivatives", []),
    }


def judge_version(
    version: str, *, workspace: str, run: str, accept: Sequence[str] = (), fly: bool = True
) -> dict[str, Any]:
    """Ask the gate whether a version (its id) could be released now; nothing is moved.

    accept : as of `promote`. fly : whether held-out flights that the settings demand and nobody
    has flown yet are flown now; else they are a reason to refuse.

    Returns a document: vehicle, version, label, released (label, since and user of the version that
    is released; None before the first), passed, checks (name, passed, reasons, measures and
    acceptable, of `aerodb.increments.GateCheck`), acceptable (names under which a person may accept
    every reason; None where one cannot be accepted), accepted, notes and derivatives as of
    `promote`. Checks are empty for the released version itself. Raises InputError for a name of
    `accept` under which nothing can be accepted.
    """
    access = access_workspace(workspace)
    catalogue = access.catalogue
    row = catalogue.version_of_id(version)
    current = catalogue.named(row.vehicle, _released_name(access, row))
    there = current is not None and current.version == row.id
    used = _used(row, access)
    try:
        verdict = GateVerdict(()) if there else _gate(access, row, used, current, accept, run, fly)
    except GateRefusal as refusal:
        verdict = GateVerdict((GateCheck("it can be judged", refusal.reasons, "content"),))
    failed = [check for check in verdict.checks if not check.passed]
    report = catalogue.version_documents(row.id).report
    return {
        "vehicle": row.vehicle,
        "version": row.id,
        "label": row.label,
        "released": None
        if current is None
        else {
            "version": current.version,
            "label": catalogue.version_of_id(current.version).label,
            "since": current.at_utc.isoformat(),
            "user": current.user,
        },
        "passed": verdict.passed,
        "checks": [{**asdict(check), "passed": check.passed} for check in verdict.checks],
        "acceptable": [name for check in failed for name in check.acceptable]
        if all(len(check.acceptable) for check in failed)
        else None,
        "accepted": list(accept),
        "notes": [*notes_on_release(report), *_suspected(used, access)],
        "derivatives": report.get("derivatives") or [],
    }


def with_gate(document: dict[str, Any], *, workspace: str, run: str) -> dict[str, Any]:
    """Return the document of an update or a closed loop with ``gate``: what the gate says now of
    its candidate (`judge_version`; nothing is flown), None where nothing was added.

    It is asked anew each time and not stored: another release changes the answer.
    """
    version = document["candidate"]
    gate = judge_version(version, workspace=workspace, run=run, fly=False) if version else None
    return {**document, "gate": json.loads(json.dumps(gate))}  # as it is read back from a document


def roll_back(vehicle: str, *, workspace: str, run: str, name: str, reason: str) -> dict[str, Any]:
    """Undo the last standing move of `name` by a new event.

    Twice in a row by one user for one reason is one roll-back, whose command was killed and runs
    again: nothing is moved then. Another reason undoes the move before. Returns a document as
    `promote` does. Raises InputError if there is no earlier version, and GateRefusal if the earlier
    version has changed since it was stored.
    """
    access = access_workspace(workspace)
    catalogue = access.catalogue
    catalogue.vehicle(vehicle)
    _check_words(name, reason)
    history = catalogue.name_history(vehicle, name)
    standing = standing_moves(history)
    newest = history[-1] if history else None
    is_repeated = (
        newest is not None
        and (not standing or newest.step != standing[-1].step)
        and (newest.user, newest.reason) == (plain_text(user()), plain_text(reason))
    )
    if newest is not None and is_repeated:
        target = catalogue.version_of_id(newest.version)
        document = _document(newest, target, moved=False)
        return {**document, "stale": list(catalogue.stale(target.id))}
    if len(standing) < 2:
        raise InputError(
            f"'{name}' has no version to go back to",
            f"vehicle {vehicle}",
            "see: aerodb version history",
        )
    target = catalogue.version_of_id(standing[-2].version)
    if (
        database_content_sha256(_read(target, catalogue.version_documents(target.id)))
        != target.content_sha256
    ):
        raise _refusal(target, ("its content has changed since it was stored: the hash differs",))
    event = catalogue.move_name(
        vehicle, name, target.id, user=user(), reason=reason, expected=history[-1].version
    )
    return {**_document(event, target, moved=True), "stale": list(catalogue.stale(target.id))}


def _released_name(access: WorkspaceAccess, row: VersionRow) -> str:
    """The name ``released`` as the line of a version has it."""
    try:
        return access.line_name(RELEASED, row.id)
    except (ValueError, RecursionError):  # content that cannot be read, as the gate then says
        return RELEASED


def _check_words(name: str, reason: str) -> None:
    checked(name, VERSION_NAME, "a name for versions")
    if not reason.strip():
        raise InputError("moving a name requires a reason", f"'{name}'", "add --reason TEXT")


def _gate(
    access: WorkspaceAccess,
    row: VersionRow,
    used: "Sequence[_Used]",
    released: NameEvent | None,
    accept: Sequence[str],
    run: str,
    fly: bool = True,
) -> GateVerdict:
    catalogue = access.catalogue
    replaced = catalogue.version_of_id(released.version) if released is not None else None
    if row.parent is None and (replaced is None or replaced.parent is None):
        return _gate_of_import(access, row, accept)
    if released is None:
        raise GateRefusal(
            ("no version is released yet to compare it with",),
            f"vehicle {row.vehicle}",
            "import a database first",
        )
    line = catalogue.lineage(row.id).line
    labels = {ancestor.id: ancestor.label for ancestor in line}
    documents = catalogue.version_documents(row.id)
    candidate = _read(row, documents)
    standing = Standing(
        label=row.label,
        parent=labels.get(row.parent or "", ""),
        released=catalogue.version_of_id(released.version).label,
        below_released=released.version in labels,
        stale=catalogue.stale(row.id),
        stored_sha256=row.content_sha256,
        content_sha256=database_content_sha256(candidate),
    )
    cases = [CheckCase(**case) for case in documents.report.get("check_cases", [])]
    verdict = judge_release(
        standing,
        access.database(released.version),
        candidate,
        cases,
        documents.report.get("axes", {}),
        within_flights=documents.report.get("validation", {}).get("within_flights", False),
        cross_validated=documents.report.get("validation", {}).get("kind") == "cross-validated",
    )
    gate = load_settings(access.workspace.root).of(row.vehicle).gate
    listed = documents.report.get("derivatives")
    derivatives = judge_derivatives(listed, gate.largest_change, accept)
    rivals = documents.report.get("rivals", [])
    known = {f"{each['axis']}_{each['variable']}" for each in listed or ()}
    known |= {rival["hypothesis"] for rival in rivals} | {CONTRADICTIONS, SENSORS}
    known |= {f"alias@{entry['axis']}" for entry in documents.report.get("increments", ())}
    unknown = set(accept) - known - open_shapes(documents.report).keys()
    if unknown:
        raise InputError(
            f"nothing to accept under {', '.join(sorted(unknown))}",
            f"version {row.label}",
            f"what can be accepted: aerodb version show {row.label} --vehicle {row.vehicle}",
        )
    return GateVerdict(
        (
            *verdict.checks,
            derivatives,
            judge_rivals(rivals, accept),
            judge_aliases(documents.report, accept),
            judge_shapes(documents.report, accept),
            judge_contradictions(_contradictions(used, access), accept),
            *_enough_flights(row, access, gate),
            *_responses(row, access, gate, run, fly),
        )
    )


def _gate_of_import(access: WorkspaceAccess, row: VersionRow, accept: Sequence[str]) -> GateVerdict:
    """The gate of an import that becomes the first released version, or replaces another import."""
    documents = access.catalogue.version_documents(row.id)
    imported = _read(row, documents)
    unknown = set(accept) - {FILE_CHECKS, CONTENT}
    if unknown:
        raise InputError(
            f"nothing to accept under {', '.join(sorted(unknown))}",
            f"version {row.label}",
            f"of an import, {FILE_CHECKS} and {CONTENT} can be accepted",
        )
    standing = Standing(
        label=row.label,
        parent="",
        released="",
        below_released=False,
        stale=access.catalogue.stale(row.id),
        stored_sha256=row.content_sha256,
        content_sha256=database_content_sha256(imported),
    )
    cases = [CheckCase(**case) for case in documents.report.get("check_cases", [])]
    report = documents.report
    checks, unusual = report.get("file_checks"), report.get("unusual", ())
    return judge_import(standing, imported, cases, checks, accept, unusual)


def _enough_flights(
    row: VersionRow, access: WorkspaceAccess, gate: GateSettings
) -> tuple[GateCheck, ...]:
    """Return whether enough flights identified and validated a version for the vehicle's settings.

    None if the settings set no minimum.
    """
    if not (gate.identified or gate.held_out):
        return ()
    roles: list[str] = [use.role for use in access.catalogue.version_flights(row.id)]
    shortfalls, measures = [], []
    for role, fewest in (("identified", gate.identified), ("held_out", gate.held_out)):
        words = f"flights {role.replace('_', ' ')}"
        measures.append(Measure(words, roles.count(role), fewest, AT_LEAST))
        if (count := roles.count(role)) < fewest:
            shortfalls.append(f"{count} {words}, the settings require {fewest}")
    name = "as many flights as the settings require"
    return (GateCheck(name, tuple(shortfalls), "flights", tuple(measures)),)


@dataclass(frozen=True)
class _Used:
    """A flight that a version used: its row, its role, and what it is suspected of."""

    row: FlightRow
    role: str
    suspicions: tuple[Suspicion, ...]


def _used(row: VersionRow, access: WorkspaceAccess) -> list[_Used]:
    uses = access.catalogue.version_flights(row.id)
    rows = access.catalogue.flights_by_id(use.flight for use in uses)
    return [
        _Used(rows[use.flight], use.role, stored_suspicions(access, rows[use.flight]))
        for use in uses
        if use.role != "excluded"
    ]


def _contradictions(used: Sequence[_Used], access: WorkspaceAccess) -> list[str]:
    """Return what the flights that identified or validated a version contradict: their vehicle, at
    ingest, or the released version, by the remarks of their verdicts."""
    found = []
    for each in used:
        if each.role not in ("identified", "held_out"):
            continue
        remarks = [s.remark for s in each.suspicions if limits_flight(s)]
        remarks += [remark for remark in each.row.remarks if remark.kind == CONTRADICTS]
        found += [f"{access.name_of(each.row)}: {remark.sentence}" for remark in remarks]
    return found


def _suspected(used: Sequence[_Used], access: WorkspaceAccess) -> list[str]:
    """Return what the flights of a version are suspected of without being limited by it; one
    sentence for all flights of which the same is."""
    named: dict[str, list[str]] = {}
    for each in used:
        said = [s.sentence for s in each.suspicions if not limits_flight(s)]
        said += [
            replace(remark, kind=CONTRADICTS).sentence
            for remark in each.row.remarks
            if remark.kind == SUSPECTED
        ]
        for sentence in said:
            named.setdefault(sentence, []).append(access.name_of(each.row))
    return [
        f"only suspected, of {flights[0] if len(flights) == 1 else f'{len(flights)} flights'}:"
        f" {sentence}"
        for sentence, flights in named.items()
    ]


def _responses(
    row: VersionRow, access: WorkspaceAccess, gate: GateSettings, run: str, fly: bool
) -> tuple[GateCheck, ...]:
    """Return whether the version flies its held-out flights within tolerance; none where the
    vehicle's settings do not demand it.

    fly : as of `judge_version`.
    """
    if not gate.responses:
        return ()
    from aerodb.simulation import parse_tolerances  # loads the simulation, as does the next line
    from aerodb.tasks.steps.fly import default_tolerances, fly_version, read_tolerances
    from aerodb.tasks.steps.validate_responses import known_responses, summarise_responses

    name = "responses on held-out flights within tolerance"
    uses = access.catalogue.version_flights(row.id)
    held = [use.flight for use in uses if use.role == "held_out"]
    if not held:
        what = "not held out: no flight was, so no response can be judged"
        return (GateCheck(name, (what,), "responses"),)
    folder = str(access.workspace.root)
    path = access.workspace.root / gate.tolerances if gate.tolerances else None
    text = read_tolerances(path) if path else default_tolerances()
    rolled = access.catalogue.version_documents(row.id).report
    if fly:
        flown = [
            fly_version(
                flight,
                workspace=folder,
                run=run,
                version=row.id,
                tolerances=text,
                beside=rolled.get("with", {}).get("version", ""),
            )
            for flight in held
        ]
        summary = summarise_responses(flown, workspace=folder, run=run, before=(), independent=True)
    else:
        known = known_responses(access, row, None, parse_tolerances(text).name)
        if known is None or len(known["flights"]) < len(held):
            what = "not flown yet; to fly them: aerodb version gate"
            reason = f"{what} {row.label} --vehicle {row.vehicle}"
            return (GateCheck(name, (reason,), "responses"),)
        summary = known
    reasons = [
        f"{check['check']}: within tolerance in {check['passed']} of {check['manoeuvres']}"
        " manoeuvres"
        for check in summary["checks"]
        if check["passed"] < check["manoeuvres"]
    ]
    if not summary["checks"]:
        reasons.append("no manoeuvre of the held-out flights could be judged")
    measures = [
        Measure(check["check"], check["passed"], check["manoeuvres"], AT_LEAST)
        for check in summary["checks"]
    ]
    return (GateCheck(name, tuple(reasons), "responses", tuple(measures)),)


def _read(row: VersionRow, documents: VersionDocuments) -> AeroDatabase:
    try:
        return database_from(documents.content)
    except (ValueError, RecursionError) as error:
        raise _refusal(row, (f"its stored content cannot be read: {error}",)) from error


def _refusal(row: VersionRow, reasons: tuple[str, ...]) -> GateRefusal:
    remedy = f"nothing changed; see: aerodb version show {row.label} --vehicle {row.vehicle}"
    return GateRefusal(reasons, f"the gate refused {row.label} of {row.vehicle}", remedy)


def _document(event: NameEvent, row: VersionRow, moved: bool) -> dict[str, Any]:
    moves = {
        "sequence": event.sequence,
        "at_utc": event.at_utc.isoformat(),
        "user": event.user,
        "reason": event.reason,
    }
    return {
        "vehicle": row.vehicle,
        "name": event.name,
        "version": row.id,
        "label": row.label,
        "previous": event.previous,
        "moved": moved,
        "event": moves,
    }
