"""Store versions in the catalogue: a validated candidate of an update or a closed loop."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from aerodb.exchange import database_content_sha256, to_document
from aerodb.identification import REGRESSION
from aerodb.increments import (
    AxisValidation,
    Beyond,
    Update,
    derivative_changes,
    derivatives_document,
    sign_reasons,
)
from aerodb.loop import Accept, Library, LoopResult, SensorRival, StallWindow, UnexplainedLevel
from aerodb.remarks import CONTRADICTS, REFUSED, SUSPECTED, Remark, said
from aerodb.report import (
    add_remarks,
    beyond_remarks,
    hold_out_remarks,
    left_out_remarks,
    loop_document,
    parameter_changes,
    rival_remarks,
    stall_remarks,
    update_document,
)
from aerodb.storage.catalogue import FlightRole, VersionRow
from aerodb.storage.files import write_document
from aerodb.storage.workspace_settings import load_settings
from aerodb.support import canonical_json, version_id
from aerodb.tables import AeroDatabase, make_check_cases
from aerodb.tasks.actors import user
from aerodb.tasks.result_versions import CANDIDATE, RESULT_VERSION
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.steps.inputs import input_remarks
from aerodb.tasks.steps.update import UpdatePlan
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.tracing import FlightDependence, UnexplainedResidual


def publish_candidate(
    plan: UpdatePlan,
    update: Update,
    proof: tuple[AxisValidation, ...],
    beyond: tuple[Beyond, ...],
    rivals: tuple[SensorRival, ...],
    variants: dict[str, Any] | None = None,
    *,
    workspace: str,
    run: str,
) -> dict[str, Any]:
    """Store an update's candidate with its validation, point ``candidate`` at it, and return the
    document (docs/reference/contract.md, section "update and close-loop"), in SI units.

    variants : what `beside_all_free` returns, where that was asked for.
    """
    access = access_workspace(workspace)
    document = update_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: looks(access, flight) for flight in plan.hold_out.held_out},
        update=update,
        proof=proof,
        beyond=beyond,
    )
    baseline = access.database(plan.baseline)
    document["rivals"] = [asdict(rival) for rival in rivals]
    document["derivatives"], refused = _derivatives(access, plan, baseline, update.candidate, run)
    if changed := parameter_changes(baseline, update.candidate):
        document["parameters"] = changed
    signs = (*sign_reasons(baseline, update.candidate), *refused)
    labels = access.catalogue.flight_labels([each.flight for each in beyond])
    inputs = input_remarks(access, plan.vehicle, plan.baseline, update.candidate, plan.flights, run)
    remarks = [
        *beyond_remarks(beyond, labels),
        *map(said, (*_selected(plan), *_without_thrust(access, plan), *inputs)),
        *map(said, _moving_air(access, plan)),
        *(Remark(REFUSED, text=reason) for reason in signs),
        *rival_remarks(rivals),
    ]
    add_remarks(document, remarks)
    settings = {
        "model": plan.model,
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "update": RESULT_VERSION["update"],
        **({} if plan.method == REGRESSION else {"method": plan.method}),
        **({} if variants is None else {"all_free": True}),
        **_selection(plan),
    }
    if variants is not None:
        document["held_or_free"] = variants
    document["method"] = plan.method
    document |= _selection(plan)
    why = "declared increments estimated"
    return store_candidate(access, plan, update.candidate, document, settings, why, run)


def store_candidate(
    access: WorkspaceAccess,
    plan: UpdatePlan,
    candidate: AeroDatabase,
    document: dict[str, Any],
    settings: Mapping[str, Any],
    why: str,
    run: str,
) -> dict[str, Any]:
    """Store a candidate (SI units) with its document, point ``candidate`` at it because of `why`,
    and return the document with ``label``."""
    keys = list(plan.keys)
    document["by"] = user()
    document["candidate"] = version_id(plan.vehicle, plan.baseline, keys, settings)
    origin = (plan.vehicle, plan.baseline, keys, settings, document, roles_of(plan))
    version = add_version(access, candidate, *origin, run)
    move(access, plan.vehicle, access.line_name(CANDIDATE, version.id), version.id, why)
    # Where the same was made before, the stored report is the one that counts.
    return {**access.catalogue.version_documents(version.id).report, "label": version.label}


def publish_loop(
    plan: UpdatePlan,
    library: Library,
    loop: LoopResult,
    left: tuple[UnexplainedResidual, ...],
    levels: tuple[UnexplainedLevel, ...],
    between: tuple[FlightDependence, ...],
    proof: tuple[AxisValidation, ...],
    beyond: tuple[Beyond, ...],
    stalls: tuple[StallWindow, ...],
    *,
    workspace: str,
    run: str,
    accept: Accept,
) -> dict[str, Any]:
    """Store the result of a closed loop: a validated candidate, or only the report if nothing was
    added.

    Returns the loop's document with ``label`` and ``report``, the key under which it is stored.
    Schema: docs/reference/contract.md, section "update and close-loop"; SI units.
    """
    access = access_workspace(workspace)
    settings = {
        "library": library.sha256,
        "tracing": library.settings.sha256,
        "accepted": asdict(accept),
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "close_loop": RESULT_VERSION["close_loop"],
        **_selection(plan),
    }
    document = loop_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: looks(access, flight) for flight in plan.hold_out.held_out},
        library=library.sha256,
        rounds=loop.rounds,
        traced=loop.traced,
        findings=loop.findings,
        added=loop.added,
        left=left,
        between=between,
        asked_for=[finding for finding in loop.added if accept.asks_for(finding)],
        without_gain=loop.without_gain,
        not_added=accept.not_added(loop.findings, loop.added, loop.without_gain),
        axis_models=[asdict(model) for model in loop.axis_models],
        proof=proof,
        beyond=beyond,
        stalls=stalls,
        levels=levels,
        remarks=_loop_remarks(plan, loop, accept),
        within_flights=_is_within_flights(plan, loop),
    )
    named = [*(entry.flight for entry in stalls), *(entry.flight for entry in beyond)]
    labels = access.catalogue.flight_labels(named)
    document["by"] = user()
    document |= _selection(plan)
    document["derivatives"], refused = _derivatives(
        access, plan, loop.baseline, loop.candidate, run
    )
    if changed := parameter_changes(loop.baseline, loop.candidate):
        document["parameters"] = changed
    inputs = input_remarks(access, plan.vehicle, plan.baseline, loop.candidate, plan.flights, run)
    signs = (*sign_reasons(loop.baseline, loop.candidate), *refused)
    remarks = [
        *map(said, stall_remarks(stalls, labels)),
        *beyond_remarks(beyond, labels),
        *map(said, (*_selected(plan), *_without_thrust(access, plan), *inputs)),
        *map(said, _moving_air(access, plan)),
        *(Remark(REFUSED, text=reason) for reason in signs),
    ]
    add_remarks(document, remarks)
    label = None
    if loop.added:
        why = "effects traced and added"
        document = store_candidate(access, plan, loop.candidate, document, settings, why, run)
        label = document.pop("label")
        document.pop("check_cases", None)
    return {
        **document,
        "label": label,
        "report": keep_report(access, plan, document, settings, run),
    }


def _derivatives(
    access: WorkspaceAccess,
    plan: UpdatePlan,
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    run: str,
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """The largest changes of derivatives inside the data, as JSON, and which of them the gate will
    refuse."""
    if candidate == baseline:
        return [], ()
    largest = load_settings(access.workspace.root).of(plan.vehicle).gate.largest_change
    rows = [access.catalogue.flight(flight) for flight in plan.hold_out.identified]
    flights = [load_coefficients(access, row, run).flight for row in rows]
    changes = derivative_changes(flights, baseline, candidate)
    refused = tuple(reason for each in changes if (reason := each.refusal(largest)))
    return derivatives_document(changes, largest), refused


def _selection(plan: UpdatePlan) -> dict[str, list[str]]:
    """The conditions of the samples that counted, where there are any."""
    return {"select": list(plan.select)} if plan.select else {}


def _selected(plan: UpdatePlan) -> list[str]:
    told = " and ".join(plan.select)
    return [f"Of all flights, only samples with {told} counted."] if told else []


def _without_thrust(access: WorkspaceAccess, plan: UpdatePlan) -> list[str]:
    labels = access.catalogue.flight_labels(plan.left_out)
    return left_out_remarks(plan.left_out, labels)


def _moving_air(access: WorkspaceAccess, plan: UpdatePlan) -> list[str]:
    """Flights in which air that only a part of the aircraft met may be what is left."""
    labels = access.catalogue.flight_labels(plan.flights)
    told = []
    for flight in plan.flights:
        for each in access.catalogue.flight(flight).remarks:
            if each.kind in (CONTRADICTS, SUSPECTED) and "air_from" in each.values:
                begin, end = (each.values[name][0] for name in ("air_from", "air_until"))
                told.append(
                    f"{labels[flight]} may have met air that only a part of the aircraft felt,"
                    f" between {begin:.1f} and {end:.1f} s. A wake would explain what is found"
                    " there (aerodb flight wake)."
                )
    return told


def _is_within_flights(plan: UpdatePlan, loop: LoopResult) -> bool:
    return loop.by_manoeuvre and plan.hold_out.kind == "cross-validated"


def _loop_remarks(plan: UpdatePlan, loop: LoopResult, accept: Accept) -> list[str]:
    remarks = [
        *loop.remarks,
        *hold_out_remarks(plan.hold_out, _is_within_flights(plan, loop)),
    ]
    remarks += [
        f"{f.hypothesis} was added because you asked for it: its verdict is"
        f" {f.verdict.replace('_', ' ')}."
        for f in loop.added
        if accept.asks_for(f)
    ]
    return remarks


def keep_report(
    access: WorkspaceAccess,
    plan: UpdatePlan,
    document: Mapping[str, Any],
    settings: Mapping[str, Any],
    run: str,
) -> str:
    """Store the loop's document as a result, with or without a new version, and return its key."""
    inputs = [plan.baseline, *plan.keys]
    result = StoredResult(
        access, "close_loop", "findings", {name: name for name in inputs}, settings, suffix=".json"
    )
    if not result.is_stored():
        result.keep(run, lambda path: write_document(path, document))
    return result.key


def roles_of(plan: UpdatePlan) -> list[FlightRole]:
    """Return the roles of the plan's flights, excluded ones with the reason."""
    roles = [FlightRole(flight, "identified") for flight in plan.hold_out.identified]
    roles += [FlightRole(flight, "held_out") for flight in plan.hold_out.held_out]
    return [*roles, *(FlightRole(flight, "excluded", reason) for flight, reason in plan.excluded)]


def move(access: WorkspaceAccess, vehicle: str, name: str, version: str, reason: str) -> None:
    """Point a name at a version (its id); does nothing if it already points there. Raises what
    `Catalogue.move_name` raises: NameMovedError where another moved it meanwhile."""
    current = access.named(vehicle, name)
    if current != version:
        access.catalogue.move_name(
            vehicle, name, version, user=user(), reason=reason, expected=current
        )


def add_version(
    access: WorkspaceAccess,
    database: AeroDatabase,
    vehicle: str,
    parent: str | None,
    inputs: list[str],
    settings: Mapping[str, Any],
    report: Mapping[str, Any],
    roles: list[FlightRole],
    run: str,
) -> VersionRow:
    """Store a database (SI units) as a version, with check cases of its numbers. Raises InputError
    where a flight's role violates the hold-out rule; see `Catalogue.add_version`."""
    return access.catalogue.add_version(
        version_id(vehicle, parent, inputs, settings),
        vehicle=vehicle,
        parent=parent,
        content=canonical_json(to_document(database)).decode(),
        content_sha256=database_content_sha256(database),
        settings=settings,
        report={**report, "check_cases": [asdict(case) for case in make_check_cases(database)]},
        flights=roles,
        inputs=inputs,
        run=run,
    )


def looks(access: WorkspaceAccess, flight: str) -> int:
    """Return how many versions of this vehicle a flight has already validated."""
    return sum(
        1
        for impact in access.catalogue.impact(flight)
        if impact.role == "held_out" and impact.through == impact.version.id
    )
