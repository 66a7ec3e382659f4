"""Import flow: a database file becomes a version."""

from typing import Any

from aerodb.flows.run import Steps
from aerodb.tasks.steps import import_database


def import_flow(
    steps: Steps, *, workspace: str, run: str, file: str, vehicle: str, bindings: dict[str, str]
) -> dict[str, Any]:
    """Import a database file; see `aerodb.tasks.steps.publish.import_database`."""
    result: dict[str, Any] = steps(
        import_database, file, workspace=workspace, run=run, vehicle=vehicle, bindings=bindings
    )
    return result
