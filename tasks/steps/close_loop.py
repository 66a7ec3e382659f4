"""The closed loop: its rounds, their validation, what stays unexplained, and what differs between
flights."""

from dataclasses import replace

from aerodb.increments import AxisValidation, Beyond
from aerodb.loop import (
    Accept,
    Library,
    LoopResult,
    StallWindow,
    UnexplainedLevel,
    dependences_between_flights,
    outside_envelopes,
    stall_windows,
    unexplained_levels,
    unexplained_residuals,
    validate_loop,
    with_model_error,
)
from aerodb.loop import run_loop as run_rounds
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.loop_flights import flights_of
from aerodb.tasks.steps.update import UpdatePlan
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tracing import FlightDependence, UnexplainedResidual


def run_loop(
    plan: UpdatePlan,
    library: Library,
    *,
    workspace: str,
    run: str,
    accept: Accept,
    without_gain: frozenset[str] = frozenset(),
) -> LoopResult:
    """Run the closed loop on the plan's identification flights; values in SI units. Raises
    InputError where a flight lacks what is needed.

    without_gain : hypotheses that stay out, because their addition proved no gain.
    """
    source, baseline = (
        flights_of(workspace, plan.vehicle, run, plan.select),
        access_workspace(workspace).database(plan.baseline),
    )
    return run_rounds(source, plan.hold_out.identified, baseline, library, accept, without_gain)


def prove_loop(
    plan: UpdatePlan,
    library: Library,
    loop: LoopResult,
    *,
    workspace: str,
    run: str,
    accept: Accept,
) -> tuple[tuple[AxisValidation, ...], tuple[Beyond, ...], tuple[StallWindow, ...]]:
    """Validate the loop: dimensionless rms error before and after on flights that were not used for
    identification, both errors of those that leave the envelope, and the errors in the stall of
    those that stall, where a stall was added and each is predicted from the others.

    Below five flights, each flight is predicted from the others.
    """
    source = flights_of(workspace, plan.vehicle, run, plan.select)
    predictors: dict[str, AeroDatabase] = {}
    proof = validate_loop(source, plan.hold_out, library, loop, accept, predictors)
    beyond = outside_envelopes(source, predictors)
    from_others = predictors if loop.separates and plan.hold_out.kind == "cross-validated" else {}
    stalled = {flight: predictors[flight] for flight in library.stall if flight in from_others}
    return proof, beyond, stall_windows(source, loop.baseline, stalled)


def what_is_left(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> tuple[UnexplainedResidual, ...]:
    """Return the unexplained residual, compared with the candidate, that the identification flights
    share; skills are dimensionless (docs/method/tracing.md, section 14).

    Empty if there are fewer flights than the test needs.
    """
    return unexplained_residuals(
        flights_of(workspace, plan.vehicle, run, plan.select),
        plan.hold_out.identified,
        loop.candidate,
        library,
    )


def which_levels_stay(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> tuple[UnexplainedLevel, ...]:
    """Return the large constants, dimensionless, that the identification flights share beside the
    candidate (docs/method/tracing.md, section 14)."""
    return unexplained_levels(
        flights_of(workspace, plan.vehicle, run, plan.select),
        plan.hold_out.identified,
        loop.candidate,
        library,
    )


def with_bands(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> LoopResult:
    """Return the loop with the errors of its shapes, and the scatter between flights, in the bands
    of what it added; values stay, in SI units; see `with_model_error`."""
    source = flights_of(workspace, plan.vehicle, run, plan.select)
    return replace(
        loop, candidate=with_model_error(source, plan.hold_out.identified, loop, library)
    )


def what_differs(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> tuple[FlightDependence, ...]:
    """Return the effects that change with the conditions of the identification flights, slopes in
    SI units (docs/method/tracing.md, section 25).

    Empty below five flights, or where these have the same conditions.
    """
    source = flights_of(workspace, plan.vehicle, run, plan.select)
    return dependences_between_flights(source, plan.hold_out.identified, library, loop)
