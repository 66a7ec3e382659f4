"""Worker processes for jobs on untrusted logs, and the jobs.

Workers are forked from a process that has imported what they need and has no threads
(`aerodb.tasks.workers.server`). A worker stays for further jobs and gets new limits with each, or
does one job only. What breaks a limit is lost alone; its worker is replaced by a fork.
"""

import json
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, TypeVar

from aerodb.errors import CalculationError, StoreBusyError, StoreError, failing_alone
from aerodb.storage.confinement import environment_memory, how_it_ended, subordinate
from aerodb.storage.limits import Limits
from aerodb.storage.workspace_settings import load_settings
from aerodb.support import let_fork
from aerodb.tasks.actors import Actor, acting
from aerodb.tasks.workers.beginning import SCIENCE, Server, forget, server

Result = TypeVar("Result")

#: Interval [s] at which a waiting caller looks for interrupts and time limits.
_TICK: Final = 1.0
#: Longest answer of a process that has parsed a log [bytes].
_LONGEST_ANSWER: Final = 1 << 20
#: Whether this process is a worker: work within work needs no further process.
_inside = False


def become_worker() -> None:
    """Let this process, a fork without other threads, do its work itself, on all cores."""
    global _inside
    _inside = True
    let_fork(subordinate)


@dataclass(frozen=True)
class Job:
    """Work for a worker: `function` and its arguments, which pickle takes, and its limits.

    flight : id of the flight that a worker may remember. what, where, program, again : the work,
    the log or flight, what runs, and what to do with higher limits, for errors. actor,
    environment, folder : as in the calling process. needs : modules, or suffixes of logs, that are
    imported before the fork. once : the worker does nothing before or after it, and its answer is
    JSON, which can do no harm here. scratch : folder that is removed if this process dies first.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    limits: Limits
    flight: str
    what: str
    where: str
    program: str = "its process"
    again: str = "run it again"
    actor: Actor | None = field(default_factory=acting)
    environment: dict[str, str] = field(default_factory=lambda: dict(os.environ))
    folder: str = field(default_factory=os.getcwd)
    needs: tuple[str, ...] = SCIENCE
    once: bool = False
    scratch: str = ""


class OverLimitError(CalculationError):
    """Work on one log or flight took more memory or time than ``[limits]`` allow."""


def confined(
    function: Callable[..., Result],
    *arguments: Any,
    workspace: str,
    flight: str,
    what: str,
    where: str,
    needs: tuple[str, ...] = SCIENCE,
    limits: Limits | None = None,
) -> Result:
    """Return ``function(*arguments)``, run in a worker process under the limits of the workspace,
    or other `limits`.

    function : of a module, with arguments and a result that pickle takes; what is large goes
    through the store. flight : its id, or the hash of its log. what, where : the work ("the
    consistency step") and the log or flight. needs : modules that the worker imports first.
    Raises what the function raises, through `failing_alone`, and OverLimitError when it breaks a
    limit or takes its process down. Without ``[work] confined``, or on a system that cannot fork,
    it runs here, without limits.
    """
    settings = load_settings(Path(workspace))
    if _inside or not settings.work.confined or not hasattr(os, "fork"):
        with failing_alone(what, where, memory=True):
            return function(*arguments)
    limits = limits or settings.limits
    job = Job(function, arguments, limits, flight, what, where, needs=needs)
    result: Result = done(job)
    return result


def done(job: Job) -> Any:
    """Return what the function of a job returns, run in a worker under its `Limits` (memory
    [bytes], times [s]).

    Raises what the function raises, and OverLimitError when it breaks a limit or takes its process
    down; StoreBusyError when all workers end.
    """
    for _ in range(2):
        worker = _take(job)
        try:
            answer = worker.answer(job)
        except BaseException:
            worker.end()
            raise
        if answer is None:  # it died while it waited
            worker.end()
            continue
        kind, content = answer
        if job.once or kind not in ("done", "failed"):
            code = worker.end()
        else:
            _give_back(worker)
        if kind == "failed":
            raise content
        if kind == "done":
            return content
        raise _broken_limit(code, kind, job)
    raise _ended(job.where)


def _ended(where: str) -> StoreBusyError:
    """Return the error where processes are ended from outside: no log is at fault."""
    return StoreBusyError(
        "the processes for flights end unexpectedly",
        where,
        "check the free memory of this machine, then run again",
    )


def _broken_limit(code: int | None, kind: str, job: Job) -> OverLimitError | StoreBusyError:
    """Return the error of a job that broke a limit.

    kind : ``memory``, ``late`` or ``dead``. code : exit code of its worker, None if all workers
    ended with their server.
    """
    if code is None:
        return _ended(job.where)
    given = environment_memory()
    if kind == "memory" and given < job.limits.memory:
        return StoreBusyError(
            f"{job.what} gets {given / 1e6:.0f} MB of memory from the environment of this process,"
            f" less than the {job.limits.memory / 1e6:.0f} MB of [limits]",
            job.where,
            f"raise it (ulimit -v, ulimit -d), then {job.again}; no log is at fault",
        )
    if kind == "memory":
        ended = f"{job.what} needs more than {job.limits.memory / 1e6:.0f} MB of memory"
    else:
        ended = how_it_ended(code, kind == "late", job.limits, job.what, job.program)
    remedy = "check the log at its source, or raise [limits] in the workspace settings and"
    return OverLimitError(ended, job.where, f"{remedy} {job.again}")


class _Worker:
    """A worker process; `last` is the flight that it worked on."""

    def __init__(self, server: Server, pid: int, connection: Connection) -> None:
        self.server, self.last = server, ""
        self._pid, self._connection = pid, connection

    def answer(self, job: Job) -> tuple[str, Any] | None:
        """Return kind and content of the answer to a job; None if the worker was dead before."""
        self.last = job.flight
        try:
            self._connection.send(job)
        except OSError:
            return None
        until = time.monotonic() + job.limits.wall
        try:
            while not self._connection.poll(max(0.0, min(_TICK, until - time.monotonic()))):
                if time.monotonic() >= until:
                    return "late", None
            if job.once:
                kind, content = json.loads(self._connection.recv_bytes(_LONGEST_ANSWER))
            else:
                kind, content = self._connection.recv()
        except (OSError, EOFError):
            return "dead", None
        return kind, content

    def end(self) -> int | None:
        """End the worker, and return its exit code; None if its server has ended."""
        self._connection.close()
        return self.server.end(self._pid)


_lock: Final = threading.Lock()
_idle: Final[list[_Worker]] = []


def _take(job: Job) -> _Worker:
    """Return an idle worker of this process, if possible the one that remembers this flight; or a
    new one, always for a job that is done `once`."""
    with _lock:
        mine = [w for w in _idle if w.server.owner == os.getpid() and not job.once]
        mine.sort(key=lambda worker: worker.last == job.flight)
        if mine:
            _idle.remove(mine[-1])
            return mine[-1]
    with suppress(OSError, EOFError):
        return _forked(begun := server(), job)
    forget(begun)  # it was ended from outside: once more with another
    try:
        return _forked(server(), job)
    except (OSError, EOFError) as error:
        raise StoreError(
            f"no process for flights can be started: {error}",
            job.where,
            "check memory and the number of processes, then run again",
        ) from error


def _forked(begun: Server, job: Job) -> _Worker:
    return _Worker(begun, *begun.fork(job.needs, job.scratch))


def _give_back(worker: _Worker) -> None:
    with _lock:
        _idle.append(worker)
