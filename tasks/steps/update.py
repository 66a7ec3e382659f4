"""Update by declared increments: choose flights, estimate, validate on flights not used."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.identification import REGRESSION
from aerodb.increments import (
    AxisValidation,
    Beyond,
    ConsiderParameter,
    HoldOut,
    ModelFile,
    Update,
    choose_hold_out,
    held_or_free,
    parse_model_file,
    with_all_terms_free,
)
from aerodb.loop import ByMethod, estimate_declared, validate_declared
from aerodb.remarks import UNUSABLE, Remark, sentences
from aerodb.storage.catalogue import FlightRow
from aerodb.tasks.steps.counting import counted_out, sentence
from aerodb.tasks.steps.loop_flights import StoredFlights
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

#: Number of reasons that an error names.
_SHOWN: Final = 3
_REJECTED: Final = "rejected by the check of consistency"


@dataclass(frozen=True)
class Excluded:
    """A flight (id) that cannot be used and why.

    counted : the reason without what is this flight's own, as it is counted with those of other
    flights, and what to do. alone : both where there is no other flight.
    """

    flight: str
    reason: str
    counted: tuple[str, str]
    alone: tuple[str, str]


@dataclass(frozen=True)
class UpdatePlan:
    """Inputs of an update: baseline (id), flights with their roles, and the keys of the
    comparisons.

    left_out : flight -> its axes that contain a thrust that it lacks.
    method : by which an update estimates. select : conditions of the samples that count.
    beside : id of the version of the other line that flies and rolls with the baseline; empty where
        the baseline has both.
    """

    vehicle: str
    baseline: str
    model: str
    hold_out: HoldOut
    excluded: tuple[tuple[str, str], ...]
    keys: tuple[str, ...]
    left_out: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    method: str = REGRESSION
    select: tuple[str, ...] = ()
    beside: str = ""

    @property
    def flights(self) -> tuple[str, ...]:
        return (*self.hold_out.identified, *self.hold_out.held_out)


def plan_update(
    compared: list[dict[str, Any]],
    *,
    workspace: str,
    run: str,
    vehicle: str,
    baseline: str,
    model: str,
    hold_out: list[str] | None,
    method: str = REGRESSION,
    select: Sequence[str] = (),
) -> UpdatePlan:
    """Split flights into identification and validation flights; list those excluded, with reasons.

    compared : documents of `compare_with_version` on `baseline` (its id). hold_out : references of
    flights, an empty list for none, None for the default rule (docs/method/updates.md, section
    "Hold-out"). Raises InputError where no flight is usable, UnknownNameError for an unknown
    reference. select : conditions of the samples that count (`aerodb.conditioning.selected`).
    """
    access = access_workspace(workspace)
    excluded = [_incomparable(entry) for entry in compared if entry["key"] is None]
    excluded += [
        _rejected(row.id, row.remarks)
        for entry in compared
        if entry["key"] is not None
        and (row := access.catalogue.flight(entry["flight"])).verdict == "rejected"
        and row.retracted_utc is None
    ]
    split, excluded = split_flights(
        access, vehicle, baseline, [entry["flight"] for entry in compared], excluded, hold_out
    )
    out = {each.flight for each in excluded}
    keys = tuple(entry["key"] for entry in compared if entry["flight"] not in out)
    left_out = {
        entry["flight"]: tuple(entry["left_out"])
        for entry in compared
        if entry["flight"] not in out and entry.get("left_out")
    }
    why = tuple((each.flight, each.reason) for each in excluded)
    return UpdatePlan(vehicle, baseline, model, split, why, keys, left_out, method, tuple(select))


def split_flights(
    access: WorkspaceAccess,
    vehicle: str,
    baseline: str,
    flights: Sequence[str],
    excluded: Sequence[Excluded],
    hold_out: list[str] | None,
) -> tuple[HoldOut, list[Excluded]]:
    """Split flights (ids) for an update of `baseline` into identification and validation, without
    those that are excluded, retracted or repeats; return these too, with reasons.

    hold_out : as of `plan_update`, which raises the same errors.
    """
    catalogue, left = access.catalogue, list(excluded)
    rows = [catalogue.flight(each) for each in flights]
    out = {each.flight for each in left}
    left += [
        by_itself(row.id, f"retracted: {row.retract_reason}")
        for row in rows
        if row.retracted_utc is not None and row.id not in out
    ]
    left += _repeated(access, vehicle, {*flights} - {each.flight for each in left})
    out = {each.flight for each in left}
    usable = sorted((row for row in rows if row.id not in out), key=lambda row: _age(access, row))
    if not usable:
        raise _none_usable(vehicle, left)
    requested = (
        None if hold_out is None else [catalogue.flight(ref, vehicle).id for ref in hold_out]
    )
    split = choose_hold_out(
        [row.id for row in usable], catalogue.roles_in_line(baseline), requested
    )
    return split, left


def by_itself(flight: str, reason: str) -> Excluded:
    """A flight (its id) that is excluded for a reason of its own."""
    return Excluded(flight, reason, (reason, ""), (reason, ""))


def _rejected(flight: str, remarks: Sequence[Remark]) -> Excluded:
    errors = [remark for remark in remarks if remark.kind == UNUSABLE]
    own = [remark.clause if remark in errors else remark.sentence for remark in remarks]
    remedies = "\n".join(remark.subjects[1] for remark in errors)
    reason = f"rejected: {'; '.join(sentences(remarks))}"
    return Excluded(flight, reason, (_REJECTED, ""), (f"rejected: {'; '.join(own)}", remedies))


def _incomparable(compared: Mapping[str, Any]) -> Excluded:
    """A flight (document of `compare_with_version`) that cannot be compared with the baseline."""
    flight, cause = compared["flight"], compared["cause"]
    own = cause["where"] in ("", *(f"flight {flight[:n]}" for n in (12, len(flight))))
    shared = cause["what"] if own else f"{cause['where']}: {cause['what']}"
    counted = (shared, cause["remedy"])
    return Excluded(flight, compared["reason"], counted, counted)


def _none_usable(vehicle: str, excluded: Sequence[Excluded]) -> InputError:
    """The error that no flight can be used: how many flights each reason excludes, the most
    frequent reasons first; rejections are one reason, whatever their numbers, but for a flight
    alone."""
    where = f"update of {vehicle}"
    if not excluded:
        return InputError(
            "no usable flight: none is stored", where, "ingest flights of this vehicle"
        )
    alone = len(excluded) == 1
    reasons = Counter(each.alone if alone else each.counted for each in excluded)
    shown = [
        f"{count} of {len(excluded)} {what}" for (what, _), count in reasons.most_common(_SHOWN)
    ]
    more = len(reasons) - len(shown)
    if more > 0:
        shown.append(f"{more} other {'reason' if more == 1 else 'reasons'}")
    remedies = dict.fromkeys(remedy for (_, remedy), _ in reasons.most_common(_SHOWN) if remedy)
    see = f"see them: aerodb flight list --vehicle {vehicle}, aerodb flight show FLIGHT"
    return InputError(f"no usable flight: {'; '.join(shown)}", where, "\n".join([*remedies, see]))


def _repeated(access: WorkspaceAccess, vehicle: str, flights: set[str]) -> list[Excluded]:
    """Return those of `flights` (ids) that repeat another, with a reason: samples must not count
    twice."""
    repeats = {
        flight: rows
        for flight, rows in counted_out(access.catalogue, vehicle).items()
        if flight in flights
    }
    labels = access.catalogue.flight_labels(
        row.original for rows in repeats.values() for row in rows
    )
    return [by_itself(flight, sentence(rows, labels)) for flight, rows in repeats.items()]


def _age(access: WorkspaceAccess, row: FlightRow) -> tuple[Any, ...]:
    """Return a sort key by start time, equal on every machine; unknown starts come first, by log
    name.

    The time at which a flight was added is not used: logs are ingested in parallel and in any
    order.
    """
    if row.start_utc is not None:
        return (1, row.start_utc, row.id)
    log = access.catalogue.log(row.log_sha256)
    digits = re.split(r"(\d+)", row.name or (PurePath(log.name).name if log else ""))
    return (0, [(int(part), "") if part.isdecimal() else (-1, part) for part in digits], row.id)


def estimate(plan: UpdatePlan, *, workspace: str, run: str) -> Update:
    """Estimate the plan's declared increments on its identification flights, by its method
    (`aerodb.loop.estimate_declared`): values in SI units, covariance (k, k). Raises InputError
    where no declared term is excited."""
    access = access_workspace(workspace)
    return estimate_declared(
        StoredFlights(access, plan.vehicle, run, plan.select),
        plan.hold_out.identified,
        parse_model_file(plan.model),
        access.database(plan.baseline),
        _by_method(access, plan, run),
    )


def validate(
    plan: UpdatePlan, update: Update, *, workspace: str, run: str
) -> tuple[tuple[AxisValidation, ...], tuple[Beyond, ...]]:
    """Return the rms error (dimensionless) before and after the update, on flights that did not
    identify it if there are any, and both errors of those of them that leave the envelope."""
    access = access_workspace(workspace)
    return validate_declared(
        StoredFlights(access, plan.vehicle, run, plan.select),
        plan.hold_out,
        update,
        parse_model_file(plan.model),
        access.database(plan.baseline),
        _by_method(access, plan, run),
    )


def beside_all_free(
    plan: UpdatePlan, proof: Sequence[AxisValidation], *, workspace: str, run: str
) -> dict[str, Any]:
    """Update with all terms of the baseline freed beside the plan's, and compare with `proof`,
    which has them held; nothing is stored.

    Returns a document: axes (axis -> held-out rms before, held, free; dimensionless), terms (axis
    -> what was free), keep (``held`` or ``free``), because. Raises InputError where no flight is
    held out, and where a term of the baseline is no number times a regressor.
    """
    access = access_workspace(workspace)
    source = StoredFlights(access, plan.vehicle, run, plan.select)
    database = access.database(plan.baseline)
    model = with_all_terms_free(parse_model_file(plan.model), database)
    by_method = _by_method(access, plan, run)
    update = estimate_declared(source, plan.hold_out.identified, model, database, by_method)
    other, _ = validate_declared(source, plan.hold_out, update, model, database, by_method)
    found = held_or_free([each.axis for each in model.increment], proof, other)
    return {
        "axes": {
            axis: dict(zip(("before", "held", "free"), errors, strict=True))
            for axis, errors in found.errors.items()
        },
        "terms": {each.axis: list(each.terms) for each in model.increment},
        "keep": found.keep,
        "because": found.because,
    }


def _by_method(access: WorkspaceAccess, plan: UpdatePlan, run: str) -> ByMethod | None:
    """Estimates of declared increments by the plan's method; None for the plain regression."""
    if plan.method == REGRESSION:
        return None

    def estimated(
        flights: Sequence[str],
        model: ModelFile,
        consider: Mapping[str, Sequence[ConsiderParameter]] | None,
    ) -> Update:
        from aerodb.identification import METHODS, update_by, within  # loads the simulation
        from aerodb.tasks.steps.methods import identification_flights

        database = access.database(plan.baseline)
        given = [
            within(each, plan.select)
            for each in identification_flights(access, flights, database, run)
        ]
        return update_by(METHODS[plan.method], given, model, database, consider)

    return estimated
