"""Update flow: declared increments from flights, a candidate version, its error before and
after."""

from typing import Any

from aerodb.errors import InputError
from aerodb.flows.run import Steps, requires
from aerodb.identification import REGRESSION
from aerodb.tasks.steps import (
    beside_all_free,
    compare_with_version,
    estimate,
    find_sensor_rivals,
    freeze_library,
    is_on_ground,
    plan_rolls,
    plan_update,
    publish_candidate,
    update_from_rolls,
    validate,
    with_gate,
    write_update_page,
)


@requires("ingest")
def update_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    vehicle: str,
    baseline: str,
    flights: list[str],
    model: str,
    hold_out: list[str] | None = None,
    method: str = "regression",
    all_free: bool = False,
    select: list[str] | None = None,
    beside: str = "",
) -> dict[str, Any]:
    """Estimate the increments declared in `model` (text of a model file) on version `baseline` (its
    id).

    flights : their full ids. hold_out : references of flights to hold out, an empty list for none,
    None for the default rule. method : by which to estimate (`aerodb.identification.METHODS`).
    all_free : whether to compare with an update that frees all terms of the baseline
    (`beside_all_free`). select : conditions of the samples that count. beside : id of a version of
    the other line (`WorkspaceAccess.flown_database`), for rolls on the ground. Returns the
    update's document with ``label``, ``gate`` and ``page``, the file of its report,
    and that comparison as ``held_or_free``.
    """
    where = {"workspace": workspace, "run": run}
    if is_on_ground(baseline, model, workspace=workspace, beside=beside):
        if all_free or select:
            raise InputError(
                f"{'--all-free' if all_free else '--select'} with parameters of the legs",
                "update",
                "leave it out: rolls on the ground are found by themselves",
            )
        plan = steps(
            plan_rolls,
            flights,
            **where,
            vehicle=vehicle,
            baseline=baseline,
            model=model,
            hold_out=hold_out,
            **({} if method == REGRESSION else {"method": method}),
            **({"beside": beside} if beside else {}),
        )
        document = steps(update_from_rolls, plan, **where)
        document = steps(with_gate, document, **where)
        return {**document, "page": steps(write_update_page, document, **where)}
    if beside:
        raise InputError(
            "--with is of rolls on the ground",
            "update",
            "leave it out, or declare parameters of the legs alone in the model file",
        )
    compared = steps.each(compare_with_version, flights, **where, version=baseline, confine=False)
    plan = steps(
        plan_update,
        compared,
        **where,
        vehicle=vehicle,
        baseline=baseline,
        model=model,
        hold_out=hold_out,
        method=method,
        select=select or (),
    )
    update = steps(estimate, plan, **where)
    proof, beyond = steps(validate, plan, update, **where)
    variants = steps(beside_all_free, plan, proof, **where) if all_free else None
    library = steps(freeze_library, plan, **where)
    rivals = steps(find_sensor_rivals, plan, library, update, **where)
    document = steps(publish_candidate, plan, update, proof, beyond, rivals, variants, **where)
    document = steps(with_gate, document, **where)
    return {**document, "page": steps(write_update_page, document, **where)}
