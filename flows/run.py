"""How a flow runs: under Prefect (a server, or Prefect's own ephemeral mode) or directly. Decided here and nowhere else.

A flow is a plain function ``body(steps, **parameters)``; a step is a plain function of ``tasks/``. Under Prefect each
becomes a flow or a task; directly the same bodies are called. So every way stores the same keys, and Prefect, which
takes seconds to import, is imported only where it runs something.
"""

import logging
import os
import urllib.request
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal, Protocol

from aerodb.errors import InputError
from storage.catalogue import Catalogue
from storage.workspace import Workspace
from tasks.provenance import code_version

How = Literal["auto", "direct"]
Way = Literal["server", "ephemeral", "direct"]


class Steps(Protocol):
    """What a flow body calls its steps through."""

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        """Runs one step and returns its result; its exception is raised here."""

    def map(self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any) -> list[Any]:
        """Runs a step for each item (its first argument), in parallel where the runner can; results in order."""


#: Told of progress: which step, how many items are done, of how many.
Progress = Callable[[str, int, int], None]


def silent(_step: str, _done: int, _total: int) -> None:
    """The progress report of callers who want none."""


class DirectSteps:
    """Steps as plain calls in this process."""

    def __init__(self, progress: Progress = silent) -> None:
        self._progress = progress

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        return self.map(step, [args[0]], *args[1:], **keywords)[0]

    def map(self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any) -> list[Any]:
        todo, results = list(items), []
        for done, item in enumerate(todo):
            self._progress(name_of(step), done, len(todo))
            results.append(step(item, *args, **keywords))
        self._progress(name_of(step), len(todo), len(todo))
        return results


class PrefectSteps:
    """Steps as Prefect tasks of the flow run that is under way."""

    def __init__(self, progress: Progress = silent) -> None:
        self._progress = progress

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        return self.map(step, [args[0]], *args[1:], **keywords)[0]

    def map(self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any) -> list[Any]:
        from prefect import task
        from prefect.cache_policies import NO_CACHE

        # The catalogue's keys decide what is done already: a second cache beside it could only disagree.
        prefect_task: Any = task(name=name_of(step), persist_result=False, cache_policy=NO_CACHE)(step)
        futures = [prefect_task.submit(item, *args, **keywords) for item in items]
        results = []
        for done, future in enumerate(futures):
            self._progress(name_of(step), done, len(futures))
            results.append(future.result())
        self._progress(name_of(step), len(futures), len(futures))
        return results


def name_of(step: Callable[..., Any]) -> str:
    """A step's name as people see it: module and function, ``ingest.store_log``."""
    return f"{step.__module__.rpartition('.')[2]}.{step.__name__}"


def run_flow(
    body: Callable[..., Any],
    parameters: dict[str, Any],
    workspace: Workspace,
    how: How = "auto",
    progress: Progress = silent,
) -> Any:
    """Runs a flow body with `parameters`, records the run in the catalogue, and returns the body's result.

    The body is called as ``body(steps, workspace=<folder as text>, run=<run id>, **parameters)``.
    """
    _check_text(parameters)
    way: Way = "direct" if how == "direct" else configure_prefect(workspace.root)
    catalogue = Catalogue.open(workspace.catalogue)
    run = catalogue.start_run(body.__name__, how=way, parameters=parameters, code_version=code_version()).id
    given = {"workspace": str(workspace.root), "run": run, **parameters}
    try:
        result = body(DirectSteps(progress), **given) if way == "direct" else _under_prefect(body, given, progress)
    except BaseException as error:
        catalogue.end_run(run, "failed", error=str(error) or type(error).__name__)
        raise
    catalogue.end_run(run, "completed")
    return result


def _check_text(parameters: dict[str, Any]) -> None:
    """Refuses names of files that are no text: neither the record of runs nor Prefect could hold them."""
    for value in parameters.values():
        for text in value if isinstance(value, list) else [value]:
            if isinstance(text, str) and not text.isascii() and text.encode("utf-8", "ignore").decode() != text:
                raise InputError("its name is not valid UTF-8", text, "rename the file")


def _under_prefect(body: Callable[..., Any], given: dict[str, Any], progress: Progress) -> Any:
    from prefect import flow
    from prefect.task_runners import ThreadPoolTaskRunner

    def run(**parameters: Any) -> Any:
        return body(PrefectSteps(progress), **parameters)

    run.__name__ = body.__name__
    threads: Any = ThreadPoolTaskRunner(max_workers=os.cpu_count() or 1)
    prefect_flow: Any = flow(
        name=body.__name__.replace("_", "-"),
        description=body.__doc__,
        task_runner=threads,
        validate_parameters=False,
        persist_result=False,
    )(run)
    return prefect_flow(**given)


def configure_prefect(root: Path) -> Literal["server", "ephemeral"]:
    """Sets Prefect's environment before its first import: quiet, no telemetry, its database in the workspace.

    Returns ``server`` when PREFECT_API_URL names one that answers, else ``ephemeral``.
    """
    home = root / "prefect"
    home.mkdir(parents=True, exist_ok=True)
    quiet = {
        "DO_NOT_TRACK": "1",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_HOME": str(home),
        "PREFECT_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_LOGGING_TO_API_ENABLED": "false",
        "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "90",
    }
    for name, value in quiet.items():
        os.environ.setdefault(name, value)
    logging.getLogger("httpx").setLevel(logging.WARNING)
    url = os.environ.get("PREFECT_API_URL", "")
    if url and _answers(url):
        return "server"
    os.environ.pop("PREFECT_API_URL", None)
    os.environ["PREFECT_SERVER_ALLOW_EPHEMERAL_MODE"] = "true"
    return "ephemeral"


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(f"{url.rstrip('/')}/health", timeout=2) as response:
            return bool(response.status == 200)
    except OSError:
        return False
