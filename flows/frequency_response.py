"""Frequency response flow: a stored flight's response, and a transfer function fitted to it."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import respond


@requires("ingest")
def frequency_response_flow(
    steps: Steps, *, workspace: str, run: str, flight: str, **asked: Any
) -> dict[str, Any]:
    """Return the document of `respond` on a flight (its id); `asked` : its further arguments."""
    document: dict[str, Any] = steps(respond, flight, workspace=workspace, run=run, **asked)
    return document
