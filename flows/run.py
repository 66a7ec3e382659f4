"""Run a flow under Prefect (a server, or its ephemeral mode) or directly; decided here only.

A flow is a plain function ``body(steps, **parameters)``; a step is a plain function of
`aerodb.tasks.steps`. Under Prefect they become a flow and tasks; directly, the same functions are
called. Both ways store the same keys, and Prefect, which takes seconds to import, is imported only
if it is used.
"""

import gc
import logging
import os
import secrets
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, Literal, Protocol, TypeVar

from aerodb.errors import (
    CalculationError,
    GateRefusal,
    InputError,
    StoreBusyError,
    StoreError,
    UnknownNameError,
)
from aerodb.flows.deadline import at_most
from aerodb.flows.executors import Call, Executor, LocalExecutor, executor_of
from aerodb.flows.prefect_environment import prefect_environment
from aerodb.flows.run_words import label_of_run, labels_of_items, refused_in, said_of
from aerodb.storage.catalogue import Catalogue, RunState, UserRole
from aerodb.storage.locks import holding
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import load_settings
from aerodb.support import one_blas_thread
from aerodb.tasks.actors import require_role, user
from aerodb.tasks.provenance import code_version
from aerodb.units import UnitSystem, shown_in

How = Literal["auto", "direct"]
Way = Literal["server", "ephemeral", "direct"]
Body = TypeVar("Body", bound=Callable[..., Any])


class Steps(Protocol):
    """How a flow body calls its steps."""

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        """Run one step and return its result, or raise its exception."""

    def map(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        """Run a step for each item (its first argument), in parallel if possible; results in
        order."""

    def each(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        """As `map`, for a step whose work stays in this process: one item after the other where the
        executor is local. Many short calls of NumPy hold the interpreter's lock, and threads that
        wait for it take a fifth of the processor time and save none."""


#: Progress callback: the step's name, the number of items done, the total number.
Progress = Callable[[str, int, int], None]


def silent(_step: str, _done: int, _total: int) -> None:
    """Ignore a progress report."""


class DirectSteps:
    """Steps as plain calls; mapped steps run on the executor, on all cores. BLAS has one thread:
    the cores are for the threads of a step, and BLAS' own spend a sixth of a loop's processor time
    on waiting."""

    def __init__(self, progress: Progress = silent, executor: Executor | None = None) -> None:
        self._progress, self._executor = progress, executor or LocalExecutor()

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        calls = LocalExecutor().calls(step, args[:1], *args[1:], **keywords)
        with one_blas_thread():
            return self._reported(step, calls)[0]

    def map(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        return self._mapped(step, self._executor.calls(step, items, *args, **keywords))

    def each(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        calls = self._executor.calls(step, items, *args, **keywords)
        return self._mapped(step, calls, alone=isinstance(self._executor, LocalExecutor))

    def _mapped(
        self, step: Callable[..., Any], calls: Sequence[Call], *, alone: bool = False
    ) -> list[Any]:
        workers = 1 if alone else min(len(calls), os.cpu_count() or 1)
        if workers < 2:
            with one_blas_thread():
                return self._reported(step, calls)
        pool = ThreadPoolExecutor(workers)
        try:
            with one_blas_thread():
                return self._reported(step, [pool.submit(call).result for call in calls])
        finally:  # what has not begun when one fails, or the run is stopped, does not begin
            pool.shutdown(wait=isinstance(sys.exception(), Exception | None), cancel_futures=True)

    def _reported(self, step: Callable[..., Any], calls: Sequence[Call]) -> list[Any]:
        results = []
        for done, call in enumerate(calls):
            self._progress(name_of(step), done, len(calls))
            results.append(call())
        self._progress(name_of(step), len(calls), len(calls))
        return results


class PrefectSteps:
    """Steps as Prefect tasks of the current flow run; their work is done by the executor."""

    def __init__(self, progress: Progress = silent, executor: Executor | None = None) -> None:
        self._progress, self._executor = progress, executor or LocalExecutor()

    def __call__(self, step: Callable[..., Any], *args: Any, **keywords: Any) -> Any:
        calls = LocalExecutor().calls(step, args[:1], *args[1:], **keywords)
        return self._done(step, calls, list(args[:1]), keywords)[0]

    def map(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        listed = list(items)
        calls = self._executor.calls(step, listed, *args, **keywords)
        return self._done(step, calls, listed, keywords)

    def each(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        listed = list(items)
        calls = self._executor.calls(step, listed, *args, **keywords)
        alone = isinstance(self._executor, LocalExecutor)
        return self._done(step, calls, listed, keywords, alone=alone)

    def _done(
        self,
        step: Callable[..., Any],
        calls: Sequence[Call],
        items: Sequence[Any],
        keywords: dict[str, Any],
        *,
        alone: bool = False,
    ) -> list[Any]:
        from prefect import task
        from prefect.cache_policies import NO_CACHE

        # The catalogue's keys decide what is already computed: a second cache could only
        # disagree. A task is given its call alone: the orchestrator looks through whatever it is
        # given, and databases are large.
        workspace = keywords["workspace"]
        prefect_task: Any = task(
            name=name_of(step),
            persist_result=False,
            cache_policy=NO_CACHE,
            retries=len(_AGAIN_AFTER),
            retry_delay_seconds=list(_AGAIN_AFTER),
            retry_condition_fn=_may_pass,
            timeout_seconds=load_settings(Path(workspace)).limits.step,
        )(_run_call)
        results = []
        labels = labels_of_items(items, keywords, workspace)
        with one_blas_thread():  # as in `DirectSteps`
            given = [_Opaque(call) for call in calls]
            submitted = (
                prefect_task.with_options(
                    task_run_name=_constant(f"{name_of(step)} {label.name}".strip()),
                    tags=label.tags,
                ).submit(each)
                for each, label in zip(given, labels, strict=True)
            )
            futures = submitted if alone else list(submitted)
            for done, (future, each) in enumerate(zip(futures, given, strict=True)):
                self._progress(name_of(step), done, len(given))
                future.wait()
                results.append(each.result if each.ended else future.result())
        self._progress(name_of(step), len(given), len(given))
        return results


class _Opaque:
    """A call that Prefect does not look into, and its result once it has ended."""

    __slots__ = ("call", "ended", "result")

    def __init__(self, call: Call) -> None:
        self.call, self.ended, self.result = call, False, None


def _run_call(given: _Opaque) -> Any:
    from prefect import get_run_logger

    given.result = given.call()
    given.ended = True
    if said := said_of(given.result):
        get_run_logger().info(said)
    return state_of(given.result)


def _constant(text: str) -> Callable[[], str]:
    """A name as Prefect takes it where braces in it mean nothing."""
    return lambda: text


def state_of(result: Any) -> Any:
    """Return the state of Prefect in which a run or a task with this result ends: that of a refused
    log is no success, though the run went as it should."""
    from prefect.states import Completed, Failed

    if refused := refused_in(result):
        more = f" and {len(refused) - 5} more" if len(refused) > 5 else ""
        return Failed(name=REFUSED, message=f"{'; '.join(refused[:5])}{more}")
    return Completed()


#: Name of the state of a run in which a log was refused.
REFUSED: Final = "Refused"


#: Delays [s] before the retries of a step whose failure may be temporary.
_AGAIN_AFTER: Final = (2.0, 15.0, 60.0)


def _may_pass(_task: Any, _run: Any, state: Any) -> bool:
    """Return whether a failure may be temporary (a lock, an unreachable disk); a bad log stays
    bad."""
    return state.name != REFUSED and isinstance(
        state.result(raise_on_failure=False), StoreBusyError
    )


def name_of(step: Callable[..., Any]) -> str:
    """Return a step's name for people, module and function: ``ingest.store_log``."""
    return f"{step.__module__.rpartition('.')[2]}.{step.__name__}"


def run_flow(
    body: Callable[..., Any],
    parameters: dict[str, Any],
    workspace: Workspace,
    how: How = "auto",
    progress: Progress = silent,
    *,
    attended: bool = False,
) -> Any:
    """Run a flow body with `parameters`, record the run in the catalogue, and return the result.

    The body is called as ``body(steps, workspace=<folder as text>, run=<run id>, **parameters)``.
    attended : a person waits for it and is told of its error at once; where it is their input that
    was refused, the run leaves nothing to retry.
    """
    _check_text(parameters)
    _require_role(body, workspace)
    orchestrated = "" if how == "direct" else _present_flow_run()
    if how == "auto" and not orchestrated:
        with prefect_environment(workspace.root) as way:  # its server starts beside what follows
            freeze_imports()
            return _run(body, parameters, workspace, way, progress, attended=attended)
    freeze_imports()
    given: Way = "server" if orchestrated else "direct"
    return _run(body, parameters, workspace, given, progress, orchestrated, attended)


def _run(
    body: Callable[..., Any],
    parameters: dict[str, Any],
    workspace: Workspace,
    way: Way,
    progress: Progress,
    orchestrated: str = "",
    attended: bool = False,
) -> Any:
    given = {"workspace": str(workspace.root), **parameters}

    def call(run: str) -> Any:
        limit = load_settings(workspace.root).limits.run
        with at_most(limit, f"run {run[:12]}"), executor_of(workspace.root) as executor:
            if way == "direct":
                return body(DirectSteps(progress, executor), run=run, **given)
            if orchestrated:  # a deployment: its flow run is this run, and nobody chose units
                _open_loggers()
                with shown_in(UnitSystem(load_settings(workspace.root).show.units)):
                    return body(PrefectSteps(progress, executor), run=run, **given)
            return _under_prefect(body, {"run": run, **given}, PrefectSteps(progress, executor))

    return _recorded(body, call, parameters, workspace, way, orchestrated, attended)


def requires(role: UserRole) -> Callable[[Body], Body]:
    """Decorator of a flow body: the role that a user needs to start it."""

    def marked(body: Body) -> Body:
        body.role = role  # type: ignore[attr-defined]
        return body

    return marked


def _require_role(body: Any, workspace: Workspace) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        require_role(workspace, catalogue, body.role, body.__name__.replace("_", " "))


@lru_cache(maxsize=1)
def freeze_imports() -> None:
    """Exclude imported objects from garbage collection; that saves a tenth of a long run's time."""
    gc.collect()
    gc.freeze()


def run_part(
    steps: Steps, body: Callable[..., Any], parameters: dict[str, Any], workspace: str, within: str
) -> Any:
    """Run a flow body with the steps of the current run `within` (its id), with a record of its
    own."""
    folder = Workspace.open(Path(workspace))
    way: Way = Catalogue.open(folder.catalogue).run(within).how
    given = {"workspace": workspace, **parameters}
    return _recorded(body, lambda run: body(steps, run=run, **given), parameters, folder, way)


def _recorded(
    body: Callable[..., Any],
    call: Callable[[str], Any],
    parameters: dict[str, Any],
    workspace: Workspace,
    way: Way,
    id: str = "",
    attended: bool = False,
) -> Any:
    """Record the start and the end of a run in the catalogue; the run holds its lock while it
    lasts."""
    run = id or secrets.token_hex(16)
    with (
        Catalogue.open(workspace.catalogue) as catalogue,
        holding(workspace.lock(f"run-{run}"), remove=True),
    ):
        catalogue.start_run(
            body.__name__, how=way, parameters=parameters, code_version=code_version(), id=run
        )
        try:
            result = call(run)
        except BaseException as error:
            # A run that is stopped (by an interrupt, or the end of the server) has not failed.
            state: RunState = "failed" if isinstance(error, Exception) else "cancelled"
            with suppress(
                StoreError
            ):  # the same disk, perhaps: a run whose lock is free and that has no end has crashed
                catalogue.end_run(run, state, error=str(error) or type(error).__name__)
                if attended and _refuses(error):
                    catalogue.dismiss_run(run, "its input was refused", user=user())
            raise
        catalogue.end_run(run, "completed")
    return result


def _refuses(error: BaseException) -> bool:
    """Return whether a run ended because of what it was given: the same once more ends alike."""
    refusal = isinstance(error, InputError | UnknownNameError | GateRefusal)
    return refusal and not isinstance(error, CalculationError)


def _present_flow_run() -> str:
    """Return the id of Prefect's current flow run; empty outside of one."""
    if "prefect" not in sys.modules:
        return ""
    from prefect.context import FlowRunContext

    context = FlowRunContext.get()
    return str(context.flow_run.id) if context is not None and context.flow_run is not None else ""


def _check_text(parameters: dict[str, Any]) -> None:
    """Refuse file names that are not valid text: neither the catalogue nor Prefect could store
    them."""
    for value in parameters.values():
        for text in value if isinstance(value, list) else [value]:
            if (
                isinstance(text, str)
                and not text.isascii()
                and text.encode("utf-8", "ignore").decode() != text
            ):
                raise InputError("its name is not valid UTF-8", text, "rename the file")


def _under_prefect(body: Callable[..., Any], given: dict[str, Any], steps: Steps) -> Any:
    from prefect import flow, tags
    from prefect.context import TagsContext
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings
    from prefect.task_runners import ThreadPoolTaskRunner

    results: list[Any] = []

    def run(**parameters: Any) -> Any:
        with TagsContext(current_tags=set()):  # tasks have tags of their own
            results.append(body(steps, **parameters))
        return state_of(results[0])

    run.__name__ = body.__name__
    threads: Any = ThreadPoolTaskRunner(max_workers=os.cpu_count() or 1)
    label = label_of_run(body.__name__, given, given["workspace"])
    prefect_flow: Any = flow(
        name=body.__name__.replace("_", "-"),
        flow_run_name=_constant(label.name),
        description=body.__doc__,
        task_runner=threads,
        validate_parameters=False,
        persist_result=False,
    )(run)
    _open_loggers()
    # Our locks say who lives; Prefect's heartbeat would tell nobody, and its thread keeps the end
    # of a run waiting for a second.
    with (
        temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
        tags(f"run:{given['run']}", *label.tags),
    ):
        state = prefect_flow(**given, return_state=True)
    return results[0] if results else state.result()


def _open_loggers() -> None:
    """Let what runs say reach the server, which keeps it by run and task, and not the terminal."""
    for name in ("prefect.flow_runs", "prefect.task_runs"):
        logger = logging.getLogger(name)
        logger.setLevel(logging.INFO)
        logger.propagate = False
        logger.addFilter(_is_no_advice)


def _is_no_advice(record: logging.LogRecord) -> bool:
    """Whether a record is none about how time limits of tasks work in threads: the run's own limit
    (`at_most`) ends what a task's cannot interrupt."""
    return not str(record.msg).startswith("Timeout of ")
