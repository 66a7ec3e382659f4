"""Updates of the legs from rolls on the ground: friction, brakes and side force of the tyres."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification import (
    METHODS,
    RollError,
    Rolls,
    flown_to_stop,
    ground_rolls,
    leg_parameters,
    recorded_rolls,
    roll_errors,
    updated_by_rolls,
    validated_rolls,
    with_fitted_legs,
)
from aerodb.increments import AxisValidation, HoldOut, Update, parse_model_file
from aerodb.loop import Accept, search_rolls, with_air_drag, without_added
from aerodb.remarks import NEVER_AIRBORNE, said
from aerodb.report import (
    add_remarks,
    hold_out_remarks,
    loop_document,
    parameter_changes,
    update_document,
)
from aerodb.support import canonical_json
from aerodb.tables import AeroDatabase
from aerodb.tasks.actors import user
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.steps.methods import method_for_rolls, rolled_flights
from aerodb.tasks.steps.publish import keep_report, looks, store_candidate
from aerodb.tasks.steps.update import UpdatePlan, by_itself, split_flights
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.tracing import Traced, TracingSettings

#: The method that flies rolls where none is named.
FLIES: Final = "output-error"
_WHY: Final = "parameters of the legs estimated"
#: What to do about a parameter that rolls do not show.
_ADVICE: Final = "a roll that shows {name}: with the brakes on and off, steering, or a crosswind"


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
    beside: str = "",
) -> UpdatePlan:
    """Split flights (ids) with rolls on the ground into identification and validation, as
    `plan_update` does; one without a roll is excluded, one that was never airborne is not.

    beside : as of `WorkspaceAccess.flown_database`; the plan's baseline is then the version of legs
    alone, whichever of both that is.
    Raises InputError where no roll can be used, UnknownNameError for an unknown reference.
    """
    access = access_workspace(workspace)
    database = access.flown_database(baseline, beside)
    if beside and access.database(baseline).line != "friction":
        baseline, beside = beside, baseline
    rolls = recorded_rolls(rolled_flights(access, flights, run), database)
    lacking = [by_itself(flight, reason) for flight, reason in rolls.left_out.items()]
    split, excluded = split_flights(access, vehicle, baseline, flights, lacking, hold_out)
    why = tuple((each.flight, each.reason) for each in excluded)
    keys = tuple(
        load_flight(access, access.catalogue.flight(each), run)[1]
        for each in (*split.identified, *split.held_out)
    )
    keys += (beside,) if beside else ()
    return UpdatePlan(vehicle, baseline, model, split, why, keys, method=method, beside=beside)


def update_from_rolls(plan: UpdatePlan, *, workspace: str, run: str) -> dict[str, Any]:
    """Estimate the declared parameters of the legs on the plan's rolls, validate them on those held
    out, store the candidate, and return its document (docs/reference/contract.md), in SI units.

    Raises what `updated_by_rolls` raises.
    """
    access = access_workspace(workspace)
    database = access.flown_database(plan.baseline, plan.beside)
    model = parse_model_file(plan.model)
    function = method_for_rolls(METHODS[plan.method], model)
    rolls = recorded_rolls(rolled_flights(access, plan.flights, run), database)

    names = model.parameters

    update = updated_by_rolls(
        function, rolls.of(plan.hold_out.identified), names, database, model.wind
    )
    begun = _found(update.fit)

    def updated(flights: Sequence[str]) -> AeroDatabase:
        used = rolls.of(flights)
        return updated_by_rolls(function, used, names, database, model.wind, begun).candidate

    beside = (database, update.candidate)
    starts = (None, begun)
    proof = _proved(plan, rolls, function, beside, names, updated, starts, model.wind)
    candidate = _of_line(access, plan, update.candidate)
    document = update_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: looks(access, flight) for flight in plan.hold_out.held_out},
        update=Update(candidate, (), plan.hold_out.identified, (), model.parameters),
        proof=proof.axes,
    )
    document["parameters"] = parameter_changes(database, update.candidate)
    document["rolls"] = proof.rolls
    document |= _beside(access, plan)
    add_remarks(document, map(said, (*_without_value(update.without_value), *rolls.assumed)))
    settings = {
        "model": plan.model,
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "update": RESULT_VERSION["update"],
        "method": plan.method,
        **_with(plan),
    }
    document |= {"method": plan.method, "rivals": [], "derivatives": []}
    return store_candidate(access, plan, candidate, document, settings, _WHY, run)


def _of_line(access: WorkspaceAccess, plan: UpdatePlan, updated: AeroDatabase) -> AeroDatabase:
    """What the plan's line stores of an updated database: all of it, or of a line of legs alone
    the legs with their parameters."""
    if not plan.beside:
        return updated
    legs = access.database(plan.baseline)
    own = {name: updated.variables[name] for name in legs.variables}
    return replace(legs, variables=own)


def _with(plan: UpdatePlan) -> dict[str, str]:
    """What settings say of the version that rolled with the baseline."""
    return {"with": plan.beside} if plan.beside else {}


def _beside(access: WorkspaceAccess, plan: UpdatePlan) -> dict[str, Any]:
    """What a document says of the version that rolled with the baseline."""
    if not plan.beside:
        return {}
    row = access.catalogue.version_of_id(plan.beside)
    return {"with": {"version": row.id, "label": row.label}}


@dataclass(frozen=True)
class _Proof:
    """Errors before and after, and the document of the rolls."""

    axes: tuple[AxisValidation, ...]
    rolls: list[dict[str, Any]]


def _proved(
    plan: UpdatePlan,
    rolls: Rolls,
    function: Callable[..., Fit],
    databases: tuple[AeroDatabase, AeroDatabase],
    names: Sequence[str],
    updated: Callable[[Sequence[str]], AeroDatabase],
    starts: tuple[Mapping[str, float] | None, Mapping[str, float] | None],
    wind: tuple[float, float] | None,
) -> _Proof:
    """Errors of the rolls beside two databases (before, after) that differ in `names`.

    updated : the second one from some flights (ids), where each is left out in turn. starts :
    wind and start of rolls beside both, from which they are searched again.
    """

    def errors(
        beside: AeroDatabase, flights: Sequence[str], start: Mapping[str, float] | None
    ) -> list[RollError]:
        values = {name: beside.parameters[name] for name in names}
        return roll_errors(function, rolls.of(flights), values, beside, wind, start)

    before = errors(databases[0], plan.flights, starts[0])
    changed = databases[0] != databases[1]
    after = errors(databases[1], plan.flights, starts[1]) if changed else before
    left_out = list[RollError]()
    for flight in plan.flights if changed and plan.hold_out.kind == "cross-validated" else ():
        # others that do not tell predict as the baseline
        by_others = _by_others(updated, plan.flights, flight)
        left_out += errors(by_others or databases[0], [flight], starts[by_others is not None])
    return _Proof(
        validated_rolls(before, after, plan.hold_out, left_out),
        rolls_document(rolls, left_out or after, databases, names, plan.hold_out),
    )


def _found(fit: Fit) -> dict[str, float]:
    """The values that a fit has, by name."""
    return {each.name: each.value for each in fit.estimates if np.isfinite(each.value)}


def _by_others(
    updated: Callable[[Sequence[str]], AeroDatabase], flights: Sequence[str], flight: str
) -> AeroDatabase | None:
    """The database updated by all flights but one; None where they do not tell of any parameter."""
    try:
        return updated([each for each in flights if each != flight])
    except InputError:
        return None


def close_loop_on_rolls(
    plan: UpdatePlan, *, workspace: str, run: str, accept: Accept
) -> dict[str, Any]:
    """Find which parameters of the legs the plan's rolls contradict, add what is confirmed, prove
    it on rolls left out, and store the result, in SI units.

    Returns the document of a closed loop (docs/reference/contract.md), ``label`` and ``report``.
    """
    access = access_workspace(workspace)
    database = access.flown_database(plan.baseline, plan.beside)
    function, names = METHODS[FLIES].load(), leg_parameters(database)
    wide = with_air_drag(database)
    rolls = recorded_rolls(rolled_flights(access, plan.flights, run), wide)
    used = rolls.of(plan.hold_out.identified)
    search = search_rolls(function, used, names, wide, accept)
    taken, candidate = search.taken, database

    begun = search.start if search.fit is None else _found(search.fit)

    @cache
    def by(flights: tuple[str, ...]) -> AeroDatabase:
        used = rolls.of(flights)
        return updated_by_rolls(function, used, taken, database, None, begun).candidate

    def updated(flights: Sequence[str]) -> AeroDatabase:
        return by(tuple(flights))

    asked = any(accept.asks_for(each) for each in search.added)
    if taken and not asked and plan.hold_out.kind == "cross-validated":
        alone = [_by_others(updated, plan.flights, flight) for flight in plan.flights]
        if not any(alone):
            search = without_added(search, "rolls of fewer flights do not tell of it")
    if search.fit is not None and search.taken:
        candidate = with_fitted_legs(database, search.fit, used, search.taken)
    beside, starts = (database, candidate), (search.start, begun)
    proof = _proved(plan, rolls, function, beside, search.taken or names, updated, starts, None)
    library = hashlib.sha256(
        canonical_json({"rolls": 1, "parameters": list(names), "level": TracingSettings().level})
    ).hexdigest()
    open_ones = [each.parameter for each in search.not_found if each.verdict != "not_detected"]
    document = loop_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: looks(access, flight) for flight in plan.hold_out.held_out},
        library=library,
        rounds=search.rounds,
        traced=Traced(
            plan.hold_out.identified,
            search.findings,
            search.not_found,
            tuple(_ADVICE.format(name=name) for name in open_ones),
            (),
        ),
        findings=search.findings,
        added=search.added,
        left=(),
        proof=proof.axes,
        asked_for=[each for each in search.added if accept.asks_for(each)],
        not_added=accept.not_added(search.findings, search.added, ()),
        remarks=[
            *hold_out_remarks(plan.hold_out),
            *_without_value(search.without_value),
            *(f"{note[0].upper()}{note[1:]}." for note in search.notes),
            *rolls.assumed,
        ],
    )
    document["rolls"] = proof.rolls
    document |= _beside(access, plan)
    settings = {
        "library": library,
        "accepted": asdict(accept),
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "close_loop": RESULT_VERSION["close_loop"],
        "phase": "ground",
        **_with(plan),
    }
    document |= {"by": user(), "derivatives": []}
    label = None
    if search.added:
        document["parameters"] = parameter_changes(database, candidate)
        of_line = _of_line(access, plan, candidate)
        document = store_candidate(access, plan, of_line, document, settings, _WHY, run)
        document.pop("check_cases", None)
        label = document["label"]
    return {
        **document,
        "label": label,
        "report": keep_report(access, plan, document, settings, run),
    }


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


def with_rolls(
    error: InputError, version: str, flights: Sequence[str], *, workspace: str, run: str
) -> InputError:
    """Return an error of flights (ids) of which nothing tells of the aerodynamics, with what to do
    where they roll, and the version (its id) has parameters of legs."""
    access = access_workspace(workspace)
    if not leg_parameters(access.database(version)):
        return error
    if not any(ground_rolls(each.flight) for each in rolled_flights(access, flights, run)):
        return error
    remedy = "to learn friction from their rolls alone: aerodb close-loop --on-ground"
    return InputError(error.what, error.where, "\n".join(filter(None, (error.remedy, remedy))))


def rolls_alone(
    version: str, flights: Sequence[str], on_ground: bool, *, workspace: str, beside: str = ""
) -> bool:
    """Return whether a closed loop of flights (ids) is of their rolls on the ground: because it is
    asked to be (`on_ground`, or legs beside the version), or because none was ever airborne and the
    version has parameters of legs.

    beside : as of `WorkspaceAccess.flown_database`. Raises InputError where it is asked to be, and
    the version has none.
    """
    access = access_workspace(workspace)
    rows = [access.catalogue.flight(flight) for flight in flights]
    on_wheels = [NEVER_AIRBORNE in (remark.kind for remark in row.remarks) for row in rows]
    if not (on_ground or beside or all(on_wheels)):
        return False
    names = leg_parameters(access.flown_database(version, beside))
    if (on_ground or beside) and not names:
        raise InputError(
            "no parameter of the database acts on the ground alone",
            "close-loop --on-ground",
            "write the legs with [parameters], and import the database again",
        )
    return bool(names)
