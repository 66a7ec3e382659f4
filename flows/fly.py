"""Fly flows: a version through a manoeuvre, over one flight, or over its held-out flights."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import fly_manoeuvre, fly_version, response_page, summarise_responses


@requires("read")
def fly_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    version: str,
    flight: str,
    page: bool = False,
    **options: Any,
) -> dict[str, Any]:
    """Fly a version (its id) over a flight (its id); options are those of `fly_version`.

    Returns its document, with the figures as HTML in ``page`` if asked for.
    """
    where = {"workspace": workspace, "run": run}
    document: dict[str, Any] = steps(fly_version, flight, **where, version=version, **options)
    if page:
        document |= {"page": steps(response_page, [document], **where)}
    return document


@requires("read")
def manoeuvre_flow(
    steps: Steps, *, workspace: str, run: str, version: str, **options: Any
) -> dict[str, Any]:
    """Fly a version (its id) through a manoeuvre; options are those of `fly_manoeuvre`."""
    document: dict[str, Any] = steps(
        fly_manoeuvre, version, workspace=workspace, run=run, **options
    )
    return document


@requires("read")
def validate_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    version: str,
    baseline: str | None,
    flights: list[str],
    independent: bool = True,
    page: bool = False,
    in_pieces: bool = False,
    **options: Any,
) -> dict[str, Any]:
    """Fly a version and its baseline (ids; or None) over flights (ids), and sum up.

    independent : whether the flights were not used to identify the version. in_pieces : whether
    the page is an iterator that draws while it is read, for one who reads it in this process.
    """
    where = {"workspace": workspace, "run": run}
    after = steps.map(fly_version, flights, **where, version=version, **options)
    before = (
        []
        if baseline is None
        else steps.map(fly_version, flights, **where, version=baseline, **options)
    )
    document: dict[str, Any] = steps(
        summarise_responses, after, **where, before=before, independent=independent
    )
    if page:
        told = {"before": before, "summary": dict(document), "in_pieces": in_pieces}
        document |= {"page": steps(response_page, after, **where, **told)}
    return document
