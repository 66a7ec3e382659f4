"""Worker processes for jobs on untrusted logs, and the jobs.

Workers are forked from a process that has imported what they need and has no threads
(`aerodb.tasks.workers.server`). A worker stays for further jobs and gets new limits with each, or
does one job only. What breaks a limit is lost alone; its worker is replaced by a fork.
"""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, TypeVar

from aerodb.errors import CalculationError, StoreBusyError, StoreError, failing_alone
from aerodb.storage.confinement import confined_environment, environment_memory, how_it_ended
from aerodb.storage.limits import Limits
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.actors import Actor, acting

Result = TypeVar("Result")

#: Interval [s] at which a waiting caller looks for interrupts and time limits.
_TICK: Final = 1.0
#: Longest answer of a process that has parsed a log [bytes].
_LONGEST_ANSWER: Final = 1 << 20
#: What per-flight steps import, some of it at first use.
_SCIENCE: Final = (
    "aerodb.consistency.whole_flight",
    "aerodb.exchange.native",
    "aerodb.tasks.steps.compare",
)
#: Whether this process is a worker: work within work needs no further process.
_inside = False


def become_worker() -> None:
    """Let this process, a fork, do its work itself."""
    global _inside
    _inside = True


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
    needs: tuple[str, ...] = _SCIENCE
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
    needs: tuple[str, ...] = _SCIENCE,
) -> Result:
    """Return ``function(*arguments)``, run in a worker process under the limits of the workspace.

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
    job = Job(function, arguments, settings.limits, flight, what, where, needs=needs)
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


def _begun(control: int, needs: Collection[str]) -> "subprocess.Popen[bytes]":
    """Start a server that takes its requests from this file descriptor, and imports what jobs will
    need. Its session is its own: an interrupt at the terminal is this process' business."""
    command = [sys.executable, "-P", "-m", "aerodb.tasks.workers.server", *needs, str(control)]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command,
        stdin=quiet,
        stdout=quiet,
        env=confined_environment(),
        pass_fds=[control],
        start_new_session=True,
    )


class _Server:
    """The process that forks workers, and the connection to it."""

    def __init__(self, needs: Collection[str]) -> None:
        self.owner = os.getpid()
        self._lock = threading.Lock()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = _begun(theirs.fileno(), needs)
        self._control = Connection(ours.detach())

    def fork(self, job: Job) -> "_Worker":
        """Return a new worker that has imported what a job needs; OSError or EOFError if this
        server has ended."""
        ours, theirs = socket.socketpair()
        with theirs, self._lock:
            self._control.send((job.needs, job.scratch))
            with socket.socket(fileno=os.dup(self._control.fileno())) as carrier:
                socket.send_fds(carrier, [b"."], [theirs.fileno()])
            pid = self._control.recv()
        return _Worker(self, pid, Connection(ours.detach()))

    def end(self, pid: int) -> int | None:
        """End a worker if it has not ended, and return its exit code, negative for a signal; None
        if this server has ended, and its workers with it."""
        try:
            with self._lock:
                self._control.send(pid)
                code: int = self._control.recv()
                return code
        except (OSError, EOFError):
            return None

    def close(self) -> None:
        """End the server, and all workers with it."""
        self._control.close()
        self._process.kill()
        self._process.wait()


class _Worker:
    """A worker process; `last` is the flight that it worked on."""

    def __init__(self, server: _Server, pid: int, connection: Connection) -> None:
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
_servers: Final[list[_Server]] = []


def start_workers(suffixes: Collection[str], needs: tuple[str, ...] = _SCIENCE) -> None:
    """Start the process that forks workers in the background, so that it is ready when the first
    log with one of these suffixes (lower case) comes; nothing if there is one. needs : modules that
    it imports besides."""
    with _lock:
        _server((*suffixes, *needs))


def _server(needs: Collection[str] = ()) -> _Server:
    """Return the server of this process, a new one if there is none; call it with the lock."""
    for server in _servers:
        if server.owner == os.getpid():
            return server
    _servers.append(_Server(needs))
    return _servers[-1]


def _take(job: Job) -> _Worker:
    """Return an idle worker of this process, if possible the one that remembers this flight; or a
    new one, always for a job that is done `once`."""
    with _lock:
        mine = [w for w in _idle if w.server.owner == os.getpid() and not job.once]
        mine.sort(key=lambda worker: worker.last == job.flight)
        if mine:
            _idle.remove(mine[-1])
            return mine[-1]
        server = _server()
    with suppress(OSError, EOFError):
        return server.fork(job)
    with _lock:  # it was ended from outside: once more with another
        if server in _servers:
            _servers.remove(server)
            server.close()
        server = _server()
    try:
        return server.fork(job)
    except (OSError, EOFError) as error:
        raise StoreError(
            f"no process for flights can be started: {error}",
            job.where,
            "check memory and the number of processes, then run again",
        ) from error


def _give_back(worker: _Worker) -> None:
    with _lock:
        _idle.append(worker)
