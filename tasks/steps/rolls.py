"""Updates of the legs from rolls on the ground: friction, brakes and side force of the tyres."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from aerodb.identification import (
    METHODS,
    RollError,
    Rolls,
    RollUpdate,
    flown_to_stop,
    recorded_rolls,
    roll_errors,
    updated_by_rolls,
    validated_rolls,
)
from aerodb.increments import HoldOut, Update, parse_model_file
from aerodb.remarks import said
from aerodb.report import add_remarks, parameter_changes, update_document
from aerodb.support import version_id
from aerodb.tables import AeroDatabase
from aerodb.tasks.actors import user
from aerodb.tasks.result_versions import CANDIDATE, RESULT_VERSION
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.steps.methods import method_for_rolls, rolled_flights
from aerodb.tasks.steps.publish import add_version, looks, move, roles_of
from aerodb.tasks.steps.update import UpdatePlan, by_itself, split_flights
from aerodb.tasks.workspace_access import access_workspace

#: The method that flies rolls where none is named.
FLIES: Final = "output-error"


def plan_rolls(
    flights: Sequence[str],
    *,
    workspace: str,
    run: str,
    vehicle: str,
    baseline: str,
    model: str,
    hold_out: list[str] | None,
    method: str = FLIES,
) -> UpdatePlan:
    """Split flights (ids) with rolls on the ground into identification and validation, as
    `plan_update` does; one without a roll is excluded, one that was never airborne is not.

    Raises InputError where no roll can be used, UnknownNameError for an unknown reference.
    """
    access = access_workspace(workspace)
    rolls = recorded_rolls(rolled_flights(access, flights, run), access.database(baseline))
    lacking = [by_itself(flight, reason) for flight, reason in rolls.left_out.items()]
    split, excluded = split_flights(access, vehicle, baseline, flights, lacking, hold_out)
    why = tuple((each.flight, each.reason) for each in excluded)
    keys = tuple(
        load_flight(access, access.catalogue.flight(each), run)[1]
        for each in (*split.identified, *split.held_out)
    )
    return UpdatePlan(vehicle, baseline, model, split, why, keys, method=method)


def update_from_rolls(plan: UpdatePlan, *, workspace: str, run: str) -> dict[str, Any]:
    """Estimate the declared parameters of the legs on the plan's rolls, validate them on those held
    out, store the candidate, and return its document (docs/reference/contract.md), in SI units.

    Raises what `updated_by_rolls` raises.
    """
    access = access_workspace(workspace)
    database, model = access.database(plan.baseline), parse_model_file(plan.model)
    function = method_for_rolls(METHODS[plan.method], model)
    rolls = recorded_rolls(rolled_flights(access, plan.flights, run), database)

    def updated(flights: Sequence[str]) -> RollUpdate:
        return updated_by_rolls(function, rolls.of(flights), model.parameters, database, model.wind)

    def errors(beside: AeroDatabase, flights: Sequence[str]) -> list[RollError]:
        values = {name: beside.parameters[name] for name in model.parameters}
        return roll_errors(function, rolls.of(flights), values, database, model.wind)

    update = updated(plan.hold_out.identified)
    before, after = (errors(each, plan.flights) for each in (database, update.candidate))
    left_out = [
        error
        for flight in plan.flights
        if plan.hold_out.kind == "cross-validated"
        for error in errors(updated([f for f in plan.flights if f != flight]).candidate, [flight])
    ]
    document = update_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: looks(access, flight) for flight in plan.hold_out.held_out},
        update=Update(update.candidate, (), plan.hold_out.identified, (), model.parameters),
        proof=validated_rolls(before, after, plan.hold_out, left_out),
    )
    document["parameters"] = parameter_changes(database, update.candidate)
    document["rolls"] = rolls_document(
        rolls, left_out or after, (database, update.candidate), model.parameters, plan.hold_out
    )
    add_remarks(document, map(said, (*_without_value(update.without_value), *rolls.assumed)))
    settings = {
        "model": plan.model,
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "update": RESULT_VERSION["update"],
        "method": plan.method,
    }
    document |= {"method": plan.method, "rivals": [], "derivatives": []}
    return publish_rolls(plan, update.candidate, document, settings, workspace=workspace, run=run)


def publish_rolls(
    plan: UpdatePlan,
    candidate: AeroDatabase,
    document: dict[str, Any],
    settings: Mapping[str, Any],
    *,
    workspace: str,
    run: str,
) -> dict[str, Any]:
    """Store the candidate (SI units) of rolls, point ``candidate`` at it, and return its document
    with ``label``."""
    access = access_workspace(workspace)
    document["by"] = user()
    document["candidate"] = version_id(plan.vehicle, plan.baseline, list(plan.keys), settings)
    version = add_version(
        access,
        candidate,
        plan.vehicle,
        plan.baseline,
        list(plan.keys),
        settings,
        document,
        roles_of(plan),
        run,
    )
    move(access, plan.vehicle, CANDIDATE, version.id, "parameters of the legs estimated")
    return {**access.catalogue.version_documents(version.id).report, "label": version.label}


def rolls_document(
    rolls: Rolls,
    errors: Sequence[RollError],
    databases: tuple[AeroDatabase, AeroDatabase],
    names: Sequence[str],
    hold_out: HoldOut,
) -> list[dict[str, Any]]:
    """Return of each roll where it stood still, and where two databases (before, after) have it
    stand still from the same start, in [s] and [m] from there, with the wind [m/s] that was found.

    errors : beside the second database. names : parameters in which they differ.
    """
    found = []
    for each in errors:
        flown = [
            flown_to_stop(rolls, each, {name: own.parameters[name] for name in names}, own)
            for own in databases
        ]
        stops = zip(("before", "after", "stopped"), (*flown, each.stopped), strict=True)
        found.append(
            {
                "roll": each.name,
                "flight": each.flight,
                "held_out": each.flight in hold_out.held_out,
                "wind": [each.found[f"wind_{way}[{each.name}]"] for way in ("north", "east")],
                **{name: None if stop is None else asdict(stop) for name, stop in stops},
            }
        )
    return found


def _without_value(reasons: Mapping[str, str]) -> list[str]:
    return [f"{name} stays as it is: {reason}." for name, reason in reasons.items()]
