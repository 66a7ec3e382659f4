"""Estimate flow: declared increments by several methods, beside each other."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import estimate_by_methods, estimates_page


@requires("ingest")
def estimate_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    flights: list[str],
    model: str,
    methods: list[str],
    version: str | None = None,
    whole: bool = False,
    page: bool = False,
    select: list[str] | None = None,
    beside: str = "",
) -> dict[str, Any]:
    """Estimate the increments declared in `model` (text of a model file) from `flights` (ids) on a
    version (its id), or on none; only samples for which all conditions of `select` hold.
    beside : id of a version of the other line (`WorkspaceAccess.flown_database`).
    Returns the document of `estimate_by_methods`, with the HTML ``page`` if asked for."""
    document: dict[str, Any] = steps(
        estimate_by_methods,
        flights,
        workspace=workspace,
        run=run,
        model=model,
        methods=methods,
        version=version,
        whole=whole,
        select=select or (),
        **({"beside": beside} if beside else {}),
    )
    if page:
        document |= {"page": steps(estimates_page, document, workspace=workspace, run=run)}
    return document
