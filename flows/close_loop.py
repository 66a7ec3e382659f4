"""Closed-loop flow: trace residuals to missing effects, add these, and validate the candidate."""

from importlib import import_module
from threading import Thread
from typing import Any

from aerodb.errors import InputError
from aerodb.flows.run import Steps, requires
from aerodb.loop import Accept, until_all_gain
from aerodb.tasks.steps import (
    close_loop_on_rolls,
    compare_with_version,
    freeze_library,
    in_own_process,
    plan_rolls,
    plan_update,
    prove_loop,
    publish_loop,
    rolls_alone,
    run_loop,
    trace_flight,
    what_differs,
    what_is_left,
    which_levels_stay,
    with_bands,
    with_gate,
    with_rolls,
    write_update_page,
)
from aerodb.tasks.workspace_access import access_workspace


@requires("ingest")
def close_loop_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    vehicle: str,
    baseline: str,
    flights: list[str],
    hold_out: list[str] | None = None,
    accept_lumped: list[str] | None = None,
    accept_suspected: list[str] | None = None,
    accept_ambiguous: list[str] | None = None,
    measured: list[str] | None = None,
    effects: str = "",
    library: str = "",
    select: list[str] | None = None,
    on_ground: bool = False,
    beside: str = "",
) -> dict[str, Any]:
    """Trace the residuals of `flights` beside version `baseline` (full ids), and add confirmed
    effects.

    hold_out : as in the update. accept_* : effects to add although their verdict alone does not
    admit them. measured : what was measured outside flight, ``NAME=SIGMA, BY`` each. effects : the
    text of a file of user templates. library : the hash that the library
    must have, or its beginning. select : conditions of the samples that count. on_ground : the loop
    is of rolls on the ground, as it is where no flight was ever airborne, and where there is a
    version of the other line `beside` (its id; `WorkspaceAccess.flown_database`).
    Returns the loop's document with ``label``, ``gate`` and ``page``, the file of its
    report; ``candidate`` is None if nothing was added.
    """
    where = {"workspace": workspace, "run": run}
    accept = Accept(
        tuple(accept_lumped or ()), tuple(accept_suspected or ()), tuple(accept_ambiguous or ())
    )
    if rolls_alone(baseline, flights, on_ground, workspace=workspace, beside=beside):
        if select or measured or effects or library:
            raise InputError(
                "--select, --measured, --effects and --library are of flight",
                "close-loop on rolls",
                "leave them out: the parameters of the legs are tested",
            )
        plan = steps(
            plan_rolls,
            flights,
            **where,
            vehicle=vehicle,
            baseline=baseline,
            model="",
            hold_out=hold_out,
            **({"beside": beside} if beside else {}),
        )
        document = steps(close_loop_on_rolls, plan, **where, accept=accept)
        document = steps(with_gate, document, **where)
        return {**document, "page": steps(write_update_page, document, **where)}
    apart = in_own_process(flights, workspace=workspace)
    compare = steps.map if apart else steps.each
    compared = compare(compare_with_version, flights, **where, version=baseline, confine=apart)
    try:
        plan = steps(
            plan_update,
            compared,
            **where,
            vehicle=vehicle,
            baseline=baseline,
            model="",
            hold_out=hold_out,
            select=select or (),
        )
    except InputError as error:
        raise with_rolls(error, baseline, flights, **where) from error
    frozen = steps(
        freeze_library, plan, **where, effects=effects, expected=library, measured=measured or []
    )
    accept.check(frozen)
    if apart:  # meanwhile this process imports what the page needs
        Thread(target=import_module, args=("aerodb.report.update_page",), daemon=True).start()
    else:
        # The first round's normal equations do not depend on each other.
        steps.each(
            trace_flight,
            plan.hold_out.identified,
            **where,
            library=frozen,
            database=access_workspace(workspace).database(baseline),
            select=plan.select,
        )
    loop, (proof, beyond, stalls), left = until_all_gain(
        lambda out: steps(run_loop, plan, frozen, **where, accept=accept, without_gain=out),
        lambda loop: steps(prove_loop, plan, frozen, loop, **where, accept=accept),
        lambda loop: steps(what_is_left, plan, frozen, loop, **where),
    )
    between = steps(what_differs, plan, frozen, loop, **where)
    levels = steps(which_levels_stay, plan, frozen, loop, **where)
    loop = steps(with_bands, plan, frozen, loop, **where)
    document = steps(
        publish_loop,
        plan,
        frozen,
        loop,
        left,
        levels,
        between,
        proof,
        beyond,
        stalls,
        **where,
        accept=accept,
    )
    document = steps(with_gate, document, **where)
    return {**document, "page": steps(write_update_page, document, **where)}
