"""Report flow: HTML pages of a flight, of an update or closed loop, and of a version."""

from collections.abc import Callable, Iterator
from typing import Any, Final

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import flight_page, update_page, version_page

_PAGES: Final[dict[str, Callable[..., str | Iterator[str]]]] = {
    "flight": flight_page,
    "update": update_page,
    "version": version_page,
}


@requires("read")
def report_flow(
    steps: Steps, *, workspace: str, run: str, kind: str, about: str, **options: Any
) -> str | Iterator[str]:
    """Return the HTML page of `kind` (``flight``, ``update``, ``version``) about a full id.

    options : those of the page's step.
    """
    page: str | Iterator[str] = steps(_PAGES[kind], about, workspace=workspace, run=run, **options)
    return page
