"""Wake flow: the vortex pairs that stored flights met."""

from collections.abc import Sequence
from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import encounters, keep_wake


@requires("ingest")
def wake_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    flights: Sequence[str],
    keep: bool = False,
    **asked: Any,
) -> dict[str, Any]:
    """Return the document of `encounters` on flights (ids); `asked` : its further arguments.

    keep : store what they met as versions of the line of wakes, in this order (`keep_wake`).
    """
    document: dict[str, Any] = steps(encounters, flights, workspace=workspace, run=run, **asked)
    kept = [
        steps(keep_wake, met["flight"], workspace=workspace, run=run, wake=met["wake"])
        for met in document["encounters"]
        if keep and met["wake"]
    ]
    return {**document, "versions": kept}
