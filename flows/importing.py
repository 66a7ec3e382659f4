"""Import flow: a database file becomes a version; what a version needs of flights; its tables."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import describe_inputs, import_database, tabulate_version


@requires("release")
def import_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    file: str,
    vehicle: str,
    bindings: dict[str, str],
    accept_proposals: bool = False,
    replace_reason: str = "",
    accept: list[str] | None = None,
    ask: bool = False,
    further: list[str] | None = None,
) -> dict[str, Any]:
    """Import a database file; see `aerodb.tasks.steps.importing.import_database`."""
    result: dict[str, Any] = steps(
        import_database,
        file,
        workspace=workspace,
        run=run,
        vehicle=vehicle,
        bindings=bindings,
        accept_proposals=accept_proposals,
        replace_reason=replace_reason,
        accept=tuple(accept or ()),
        ask=ask,
        further=tuple(further or ()),
    )
    return result


@requires("read")
def inputs_flow(
    steps: Steps, *, workspace: str, run: str, version: str, vehicle: str
) -> dict[str, Any]:
    """Describe the inputs of a version (its id); see `aerodb.tasks.steps.inputs`."""
    result: dict[str, Any] = steps(
        describe_inputs, version, workspace=workspace, run=run, vehicle=vehicle
    )
    return result


@requires("ingest")
def tabulate_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    version: str,
    over: dict[str, tuple[float, float, int]],
    at: dict[str, float],
) -> dict[str, Any]:
    """Make tables of a version (its id); see `aerodb.tasks.steps.tabulate`."""
    result: dict[str, Any] = steps(
        tabulate_version, version, workspace=workspace, run=run, over=over, at=at
    )
    return result
