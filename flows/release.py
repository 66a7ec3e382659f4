"""Flows that ask the gate and move names of versions; each attempt is recorded as a run with its
reasons."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import judge_version, promote, roll_back


@requires("release")
def promote_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    version: str,
    name: str,
    reason: str,
    accept: list[str] | None = None,
) -> dict[str, Any]:
    """Point a name at a version (its id); see `aerodb.tasks.steps.release.promote`."""
    result: dict[str, Any] = steps(
        promote,
        version,
        workspace=workspace,
        run=run,
        name=name,
        reason=reason,
        accept=accept or [],
    )
    return result


@requires("read")
def gate_flow(
    steps: Steps, *, workspace: str, run: str, version: str, accept: list[str] | None = None
) -> dict[str, Any]:
    """Ask the gate about a version (its id); see `aerodb.tasks.steps.release.judge_version`."""
    result: dict[str, Any] = steps(
        judge_version, version, workspace=workspace, run=run, accept=accept or []
    )
    return result


@requires("release")
def roll_back_flow(
    steps: Steps, *, workspace: str, run: str, vehicle: str, name: str, reason: str
) -> dict[str, Any]:
    """Undo the last standing move of a name; see `aerodb.tasks.steps.release.roll_back`."""
    result: dict[str, Any] = steps(
        roll_back, vehicle, workspace=workspace, run=run, name=name, reason=reason
    )
    return result
