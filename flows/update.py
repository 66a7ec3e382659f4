"""Update flow: declared increments from flights, a candidate version, its error before and
after."""

from typing import Any

from aerodb.flows.run import Steps
from aerodb.tasks.steps import (
    compare_with_version,
    estimate,
    plan_update,
    publish_candidate,
    validate,
    write_update_page,
)


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
) -> dict[str, Any]:
    """Estimate the increments declared in `model` (text of a model file) on version `baseline` (its
    id).

    flights : their full ids. hold_out : references of flights to hold out, an empty list for none,
    None for the default rule. Returns the update's document with ``label`` and ``page``, the file
    of its report.
    """
    where = {"workspace": workspace, "run": run}
    compared = steps.map(compare_with_version, flights, **where, version=baseline)
    plan = steps(
        plan_update,
        compared,
        **where,
        vehicle=vehicle,
        baseline=baseline,
        model=model,
        hold_out=hold_out,
    )
    update = steps(estimate, plan, **where)
    proof, beyond = steps(validate, plan, update, **where)
    document = steps(publish_candidate, plan, update, proof, beyond, **where)
    return {**document, "page": steps(write_update_page, document, **where)}
