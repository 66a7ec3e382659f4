"""The process that forks workers for per-flight steps: ``python -m aerodb.tasks.confined_server``.

It imports the science once, has one thread and no connection to a catalogue, so that a fork is
sound and cheap. A request is ``fork`` with the worker's end of a socket, answered by the worker's
process id; or a process id, which ends that worker, answered by its exit code. It ends, and its
workers with it, when the process that started it closes the connection or ends.
"""

import gc
import os
import pickle
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any, Final, NoReturn

import numpy as np
from scipy.linalg import blas
from threadpoolctl import threadpool_limits

from aerodb.errors import CalculationError, failing_alone
from aerodb.storage.confinement import confine_next, lift_memory_limit, subordinate
from aerodb.tasks.actors import acting_as
from aerodb.tasks.confined import Job, become_worker
from aerodb.tasks.freed_memory import return_freed_memory
from aerodb.tasks.memory_cache import clear_cache

#: What per-flight steps import, some of it at first use.
_IMPORTED: Final = (
    "aerodb.tasks.steps.compare",
    "aerodb.consistency.whole_flight",
    "aerodb.exchange.native",
    "scipy.signal",
)


def main() -> None:
    """Serve requests until the connection is closed."""
    # Who ends a group of processes means the run: a flight whose worker ended first would be taken
    # for the cause.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    control = Connection(int(sys.argv[1]))
    for name in _IMPORTED:
        import_module(name)
    gc.collect()
    gc.freeze()
    while True:
        try:
            request = control.recv()
            if request == "fork":
                control.send(_forked(control))
            else:
                with suppress(ProcessLookupError):
                    os.kill(request, signal.SIGKILL)
                control.send(os.waitstatus_to_exitcode(os.waitpid(request, 0)[1]))
        except (EOFError, OSError):
            return


def _forked(control: Connection) -> int:
    """Fork a worker for the socket that comes with the request, and return its process id."""
    with socket.socket(fileno=os.dup(control.fileno())) as carrier:
        _, descriptors, _, _ = socket.recv_fds(carrier, 1, 1)
    child = os.fork()
    if child == 0:
        control.close()
        _work(Connection(descriptors[0]))
    os.close(descriptors[0])
    return child


def _work(connection: Connection) -> NoReturn:
    """The worker: do jobs until the connection is closed, and exit without returning."""
    try:
        subordinate()
        become_worker()
        _give_blas_its_memory()
        last = ""
        while True:
            job: Job = connection.recv()
            if job.flight != last:
                clear_cache()
            last = job.flight
            connection.send_bytes(_answer(job))
            return_freed_memory()
    except (EOFError, OSError):
        os._exit(0)
    finally:
        os._exit(1)


def _give_blas_its_memory() -> None:
    """Let the BLAS of numpy and of scipy take their buffers before memory is limited: one that gets
    none ends its process instead of raising an error."""
    square = np.ones((300, 300))
    with threadpool_limits(1, user_api="blas"):
        square @ square
        blas.dgemm(1.0, square, square)


def _answer(job: Job) -> bytes:
    """Do a job; return its answer as bytes: kind, and result or exception."""
    confine_next(job.limits)
    try:
        with _as_in_caller(job), failing_alone(job.what, job.where, memory=True):
            answer: tuple[str, Any] = ("done", job.function(*job.arguments))
    except Exception as error:
        lift_memory_limit()
        answer = ("memory", None) if _lacks_memory(error) else ("failed", error)
    try:
        content = pickle.dumps(answer)
        pickle.loads(content)
    except Exception as error:  # an exception, say, that cannot be made from its own arguments
        what = f"{job.what} failed ({type(answer[1]).__name__}: {answer[1]}; {error})"
        remedy = "report it with this log, as a fault of aerodb"
        content = pickle.dumps(("failed", CalculationError(what, job.where, remedy)))
    return content


@contextmanager
def _as_in_caller(job: Job) -> Iterator[None]:
    """Context in which folder, environment and actor are those of the caller; BLAS has one thread,
    because each core has a worker."""
    os.chdir(job.folder)
    if os.environ != job.environment:
        os.environ.clear()
        os.environ.update(job.environment)
    with acting_as(job.actor), threadpool_limits(1, user_api="blas"):
        yield


def _lacks_memory(error: BaseException | None) -> bool:
    """Return whether an exception goes back to memory, or a thread, that could not be had."""
    while error is not None:
        if isinstance(error, MemoryError) or "can't start new thread" in str(error):
            return True
        error = error.__cause__
    return False


if __name__ == "__main__":
    main()
