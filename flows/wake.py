"""Wake flow: the vortex pairs that stored flights met."""

from collections.abc import Sequence
from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import encounters


@requires("ingest")
def wake_flow(
    steps: Steps, *, workspace: str, run: str, flights: Sequence[str], **asked: Any
) -> dict[str, Any]:
    """Return the document of `encounters` on flights (ids); `asked` : its further arguments."""
    document: dict[str, Any] = steps(encounters, flights, workspace=workspace, run=run, **asked)
    return document
