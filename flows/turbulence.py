"""Turbulence flow: intensity and scale of the gusts that a stored flight met."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import turbulence


@requires("ingest")
def turbulence_flow(
    steps: Steps, *, workspace: str, run: str, flight: str, **asked: Any
) -> dict[str, Any]:
    """Return the document of `turbulence` on a flight (its id); `asked` : its further arguments."""
    document: dict[str, Any] = steps(turbulence, flight, workspace=workspace, run=run, **asked)
    return document
