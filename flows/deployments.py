"""Prefect deployments of a workspace, and the runner that starts their runs (for `aerodb serve`).

This module and `aerodb.flows.run` are the only ones that import Prefect. Each run is a process of
its own.
"""

import os
import sys
from datetime import timedelta
from pathlib import Path
from typing import Any, Final

from prefect import flow, serve
from prefect.events import DeploymentEventTrigger
from prefect.schedules import Cron, Interval
from prefect.schedules import Schedule as PrefectSchedule
from prefect.task_runners import ThreadPoolTaskRunner
from prefect.types.entrypoint import EntrypointType

from aerodb.flows.orchestrator import ARRIVAL, ARRIVED
from aerodb.flows.processes import end_with_parent
from aerodb.flows.run import run_flow, state_of
from aerodb.storage.locks import take
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import Schedule, Settings, load_settings

#: Runs at once: one of the night beside one of the day. Each uses all cores for its flights.
_AT_ONCE: Final = 2
_POLL_SECONDS: Final = 2.0
_THREADS: Any = ThreadPoolTaskRunner(max_workers=os.cpu_count() or 1)


@flow(name="nightly", persist_result=False, validate_parameters=False, task_runner=_THREADS)
def nightly(workspace: str, vehicle: str | None = None) -> Any:
    """Run the nightly flow; does nothing while an earlier night is still running."""
    from aerodb.flows.nightly import (
        night_lock,
        nightly_flow,
    )  # here and below: a run does not wait for the science of the other

    end_with_parent()
    folder = Workspace.open(Path(workspace), create=False)
    lock = take(night_lock(folder, vehicle))
    if lock is None:
        return None
    try:
        parameters = {"vehicle": vehicle, "scheduled": vehicle is None}
        return state_of(run_flow(nightly_flow, parameters, folder))
    finally:
        lock.release()


@flow(name="arrival", persist_result=False, validate_parameters=False, task_runner=_THREADS)
def arrival(workspace: str) -> Any:
    """Run the per-flight flow on every log that waits in the inbox."""
    from aerodb.flows.inbox import sweep_flow

    end_with_parent()
    return state_of(run_flow(sweep_flow, {}, Workspace.open(Path(workspace), create=False)))


def schedules(settings: Settings, workspace: str) -> list[PrefectSchedule]:
    """Return the workspace's schedule, and one for each vehicle that has its own."""
    all_schedules = [_schedule(settings.nightly, {"workspace": workspace})]
    for name, own in settings.vehicles.items():
        if own.schedule is not None:
            all_schedules.append(_schedule(own.schedule, {"workspace": workspace, "vehicle": name}))
    return all_schedules


def _schedule(settings: Schedule, parameters: dict[str, Any]) -> PrefectSchedule:
    if settings.every is not None:
        return Interval(
            timedelta(seconds=settings.every), timezone=settings.timezone, parameters=parameters
        )
    return Cron(settings.cron, timezone=settings.timezone, parameters=parameters)


def main() -> None:
    """Register the deployments of the workspace in the first argument, and start their runs until
    stopped."""
    workspace = sys.argv[1]
    settings = load_settings(Path(workspace))
    kind: dict[str, Any] = {
        "entrypoint_type": EntrypointType.MODULE_PATH,
        "enforce_parameter_schema": False,
    }
    every_night: Any = nightly.to_deployment(
        "nightly", schedules=schedules(settings, workspace), **kind
    )
    trigger = DeploymentEventTrigger(
        name="logs wait in the inbox", expect={ARRIVED}, parameters={"workspace": workspace}
    )
    on_arrival: Any = arrival.to_deployment(
        ARRIVAL, triggers=[trigger], parameters={"workspace": workspace}, **kind
    )
    options: dict[str, Any] = {"pause_on_shutdown": False, "print_starting_message": False}
    serve(every_night, on_arrival, limit=_AT_ONCE, query_seconds=_POLL_SECONDS, **options)
