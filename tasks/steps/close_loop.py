"""The closed loop: its rounds, their validation, what stays unexplained, and what differs between
flights.

On more than two cores, long flights are worked on in a process without threads, which can be forked
for each core (`aerodb.support.in_processes`). It remembers the flights of its run.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Concatenate, Final, ParamSpec, TypeVar

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
from aerodb.storage.workspace_settings import load_settings
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.loop_flights import StoredFlights, flights_of
from aerodb.tasks.steps.update import UpdatePlan
from aerodb.tasks.workers import confined, start_workers
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tracing import FlightDependence, UnexplainedResidual

Given = ParamSpec("Given")
Result = TypeVar("Result")
#: What a step of the loop does on the flights of a plan.
OnFlights = Callable[Concatenate[StoredFlights, UpdatePlan, Given], Result]

#: Samples of all flights together from which a process that can be forked saves more than it takes
#: to start: a second, as much as the loop takes for that many.
_WORTH: Final = 100_000
#: Fewest cores on which it does. On two, its start and loading the flights again take what forks
#: save: ten flights of ten minutes take 61 s in one process, 64 to 68 s in forks.
_CORES: Final = 3
#: Modules that this process imports before it is forked.
_NEEDS: Final = ("aerodb.tasks.steps.close_loop",)
#: Memory that the process may take [bytes]: any, as the loop in the run's own process.
_ANY: Final = 2**60


def in_own_process(flights: Sequence[str], *, workspace: str) -> bool:
    """Return whether the loop over these flights (ids) is worth a process of its own, in which the
    steps of this module run; the process that forks it is then started in the background."""
    work = load_settings(Path(workspace)).work
    if (os.cpu_count() or 1) < _CORES:
        return False
    rows = access_workspace(workspace).catalogue.flights_by_id(flights).values()
    if sum(row.samples for row in rows) < _WORTH or work.engine != "threads" or not work.confined:
        return False
    start_workers((), _NEEDS)
    return True


def _on_flights(
    function: OnFlights[Given, Result],
    plan: UpdatePlan,
    workspace: str,
    run: str,
    *given: Given.args,
    **none: Given.kwargs,
) -> Result:
    """Return ``function(source, plan, *given)``, from a process of its own where that is worth
    it."""
    hold_out = plan.hold_out
    if not in_own_process((*hold_out.identified, *hold_out.held_out), workspace=workspace):
        return _here(function, plan, workspace, run, *given)
    limits = load_settings(Path(workspace)).limits
    longest = {"memory": _ANY, "processor": limits.step, "wall": limits.step}
    result: Result = confined(
        _here,
        function,
        plan,
        workspace,
        run,
        *given,
        workspace=workspace,
        flight=f"run {run}",
        what="the closed loop",
        where=f"vehicle {plan.vehicle}",
        needs=_NEEDS,
        limits=limits.model_copy(update=longest),
    )
    return result


def _here(
    function: Callable[..., Result], plan: UpdatePlan, workspace: str, run: str, *given: Any
) -> Result:
    return function(flights_of(workspace, plan.vehicle, run, plan.select), plan, *given)


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
    return _on_flights(_rounds, plan, workspace, run, library, accept, without_gain)


def _rounds(
    source: StoredFlights,
    plan: UpdatePlan,
    library: Library,
    accept: Accept,
    without_gain: frozenset[str],
) -> LoopResult:
    baseline = source.access.database(plan.baseline)
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
    return _on_flights(_proof, plan, workspace, run, library, loop, accept)


def _proof(
    source: StoredFlights, plan: UpdatePlan, library: Library, loop: LoopResult, accept: Accept
) -> tuple[tuple[AxisValidation, ...], tuple[Beyond, ...], tuple[StallWindow, ...]]:
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
    return _on_flights(_unexplained, plan, workspace, run, library, loop)


def _unexplained(
    source: StoredFlights, plan: UpdatePlan, library: Library, loop: LoopResult
) -> tuple[UnexplainedResidual, ...]:
    return unexplained_residuals(source, plan.hold_out.identified, loop.candidate, library)


def which_levels_stay(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> tuple[UnexplainedLevel, ...]:
    """Return the large constants, dimensionless, that the identification flights share beside the
    candidate (docs/method/tracing.md, section 14)."""
    return _on_flights(_levels, plan, workspace, run, library, loop)


def _levels(
    source: StoredFlights, plan: UpdatePlan, library: Library, loop: LoopResult
) -> tuple[UnexplainedLevel, ...]:
    return unexplained_levels(source, plan.hold_out.identified, loop.candidate, library)


def with_bands(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> LoopResult:
    """Return the loop with the errors of its shapes, and the scatter between flights, in the bands
    of what it added; values stay, in SI units; see `with_model_error`."""
    return _on_flights(_banded, plan, workspace, run, library, loop)


def _banded(
    source: StoredFlights, plan: UpdatePlan, library: Library, loop: LoopResult
) -> LoopResult:
    candidate = with_model_error(source, plan.hold_out.identified, loop, library)
    return replace(loop, candidate=candidate)


def what_differs(
    plan: UpdatePlan, library: Library, loop: LoopResult, *, workspace: str, run: str
) -> tuple[FlightDependence, ...]:
    """Return the effects that change with the conditions of the identification flights, slopes in
    SI units (docs/method/tracing.md, section 25).

    Empty below five flights, or where these have the same conditions.
    """
    return _on_flights(_differences, plan, workspace, run, library, loop)


def _differences(
    source: StoredFlights, plan: UpdatePlan, library: Library, loop: LoopResult
) -> tuple[FlightDependence, ...]:
    return dependences_between_flights(source, plan.hold_out.identified, library, loop)
