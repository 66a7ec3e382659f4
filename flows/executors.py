"""Executors of per-flight steps: this machine, or the workers of a Dask cluster (settings
``[work]``).

A worker gets a step and its arguments and nothing of the orchestrator: the run, its record, its
retries and its time limits stay in the run's own process. Results have keys that follow from their
inputs, so a step that runs twice because a worker was lost gives one result.
"""

import json
import logging
import os
import socket
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Protocol, Self

from aerodb.errors import InputError, StoreBusyError
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import FILE, SettingsError, load_settings
from aerodb.tasks.provenance import code_version
from aerodb.tasks.result_versions import RESULT_VERSION

Step = Callable[..., Any]
#: A step with its arguments; calling it runs the step or waits for its result. It may be called
#: again after it has failed.
Call = Callable[[], Any]

#: Time limit [s] for the scheduler to answer and for a first worker to appear.
_CONNECT_SECONDS: Final = 5.0
_WHERE: Final = f"{FILE}: work"
_GUIDE: Final = "see flows/deploy/many-machines.md"


class Executor(Protocol):
    """Turns a step into calls, and releases its resources on exit."""

    def calls(
        self, step: Step, items: Iterable[Any], *args: Any, **keywords: Any
    ) -> Sequence[Call]:
        """Return one call for each item, which is the step's first argument."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


class LocalExecutor:
    """Runs steps in the calling process."""

    def calls(
        self, step: Step, items: Iterable[Any], *args: Any, **keywords: Any
    ) -> Sequence[Call]:
        return [partial(step, item, *args, **keywords) for item in items]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Release nothing."""


class DaskExecutor:
    """Runs steps on the Dask cluster at `address`; connects when the first step is submitted.

    remote : whether workers may be on other machines, because they share the catalogue.
    """

    def __init__(self, address: str, remote: bool) -> None:
        self._address, self._remote = address, remote
        self._client: Any = None
        self._connecting = threading.Lock()

    def calls(
        self, step: Step, items: Iterable[Any], *args: Any, **keywords: Any
    ) -> Sequence[Call]:
        todo = list(items)
        if not todo:
            return []
        job = partial(run_on_worker, RunSite.of(keywords, self._remote), step)
        # Submit all at once: the cluster limits how many run at a time.
        return [_RemoteCall(self, partial(job, item, args, keywords), item) for item in todo]

    def submit(self, job: Call) -> Any:
        """Return the future of a job; StoreBusyError if no scheduler or no worker is available."""
        with self._connecting:
            if self._client is None or self._client.status not in ("running", "connecting"):
                self._client = self._connected()
            return self._client.submit(job, pure=False)

    def _connected(self) -> Any:
        try:
            import distributed
        except ImportError as error:
            raise SettingsError(
                "Dask is not installed", _WHERE, "install aerodb[dask], or set engine = 'threads'"
            ) from error
        try:
            for name in (
                "distributed",
                "distributed.client",
                "distributed.core",
            ):  # what matters is raised
                logging.getLogger(name).setLevel(logging.CRITICAL)
            connect: Any = distributed.Client
            client = connect(self._address, timeout=_CONNECT_SECONDS, set_as_default=False)
        except OSError as error:
            what = f"no Dask scheduler answers at {self._address}"
            raise StoreBusyError(
                what, _WHERE, 'start it (dask scheduler), or set engine = "threads"'
            ) from error
        try:
            client.wait_for_workers(1, timeout=_CONNECT_SECONDS)
        except TimeoutError as error:
            client.close()
            remedy = f"start some: dask worker {self._address} --nworkers auto --nthreads 1"
            raise StoreBusyError(
                f"the Dask cluster at {self._address} has no worker", _WHERE, remedy
            ) from error
        return client

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._client is not None:
            self._client.close()


class _RemoteCall:
    """A step that a worker runs: `job` is the call, `item` the step's first argument."""

    def __init__(self, cluster: DaskExecutor, job: Call, item: Any) -> None:
        self._cluster, self._job, self._item = cluster, job, item
        self._future = cluster.submit(job)

    def __call__(self) -> Any:
        from distributed import KilledWorker
        from distributed.comm.core import CommClosedError

        future = self._future or self._cluster.submit(self._job)
        try:
            return future.result()
        except KilledWorker as error:
            what = "several worker processes ended during this step"
            raise InputError(
                what, str(self._item)[:200], "check the workers' output; they may need more memory"
            ) from error
        except (CancelledError, CommClosedError) as error:
            what = "the connection to the Dask cluster was lost during this step"
            raise StoreBusyError(
                what, _WHERE, "check that its scheduler runs; the same run resumes from here"
            ) from error
        finally:
            # release the result, so that it is not recomputed when its worker ends
            future.cancel()
            self._future = None


@dataclass(frozen=True)
class RunSite:
    """What a worker must have in common with the run.

    machine : of the run; ignored if `remote`. code : version of the package and of the steps. lock
    : file of the run's lock in the workspace folder; it exists as long as the run lasts.
    """

    machine: str
    code: str
    lock: str
    remote: bool

    @classmethod
    def of(cls, keywords: Mapping[str, Any], remote: bool) -> Self:
        """Return the site of this process for a step with these keywords (``workspace`` and
        ``run``)."""
        lock = Workspace(Path(keywords["workspace"])).lock(f"run-{keywords['run']}")
        return cls(_machine(), _code(), str(lock), remote)


def run_on_worker(
    site: RunSite, step: Step, item: Any, args: tuple[Any, ...], keywords: dict[str, Any]
) -> Any:
    """Run a step on a worker; SettingsError if the worker does not match the run's site."""
    here = socket.gethostname()
    if site.machine != _machine() and not site.remote:
        what = (
            f"the worker on {here} is not on the run's machine, and the catalogue is a file on that"
            " machine"
        )
        raise SettingsError(
            what,
            _WHERE,
            f'set [catalogue] url = "postgresql://..." and share the workspace folder; {_GUIDE}',
        )
    if site.code != _code():
        raise SettingsError(
            f"the worker on {here} has another version of aerodb",
            _WHERE,
            f"install {site.code} there",
        )
    if not os.path.exists(site.lock):
        what = (
            f"the worker on {here} does not see the workspace folder {Path(site.lock).parents[1]}"
        )
        raise SettingsError(what, _WHERE, f"share the folder under the same path; {_GUIDE}")
    return step(item, *args, **keywords)


def _machine() -> str:
    """Return an id of this machine since its boot; a container has its own."""
    try:
        booted = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        booted = ""
    return f"{socket.gethostname()} {booted}"


def _code() -> str:
    """Return what determines the results of a step: the package version and the step versions."""
    return f"{code_version().partition('+')[0]} {json.dumps(RESULT_VERSION, sort_keys=True)}"


def executor_of(root: Path) -> Executor:
    """Return the executor that the workspace's settings name; SettingsError if it cannot be
    used."""
    settings = load_settings(root)
    if settings.work.engine == "threads":
        return LocalExecutor()
    address = settings.work.address
    if address.startswith("$"):
        try:
            address = settings.work.checked(os.environ.get(address[1:], ""))
        except ValueError as error:
            raise SettingsError(
                f"{settings.work.address} does not contain an address: {error}",
                _WHERE,
                "set the variable",
            ) from error
    return DaskExecutor(address, remote=bool(settings.catalogue.url))
