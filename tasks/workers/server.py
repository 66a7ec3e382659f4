"""The process that forks workers: ``python -m aerodb.tasks.workers.server``.

It imports what jobs need once, has one thread, no connection to a catalogue and none of the secrets
of the process that started it, and never reads a log, so that a fork is sound and cheap. A request
is what the worker needs (names of modules, suffixes of logs) and its scratch folder, with the
worker's end of a socket, answered by the worker's process id; or a process id, which ends that
worker, answered by its exit code. What its arguments name it imports in advance, and serves
requests in between. It ends, and its workers with it, when the process that started it closes the
connection or ends.
"""

import gc
import json
import os
import pickle
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from threadpoolctl import threadpool_limits

from aerodb.errors import CalculationError, failing_alone
from aerodb.storage.confinement import confine, lift_memory_limit, subordinate
from aerodb.storage.disk_errors import remove
from aerodb.storage.readers import prepare_reader
from aerodb.tasks.actors import acting_as
from aerodb.tasks.workers.freed_memory import return_freed_memory
from aerodb.tasks.workers.memory_cache import clear_cache
from aerodb.tasks.workers.pool import Job, become_worker

#: Workers that have not been ended, and the folders in which they work.
_scratch: Final[dict[int, str]] = {}


def main() -> None:
    """Serve requests until the connection is closed."""
    # Who ends a group of processes means the run: a flight whose worker ended first would be taken
    # for the cause.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    control = Connection(int(sys.argv[-1]))
    with suppress(EOFError, OSError):
        for name in sys.argv[1:-1]:
            _prepare(name)
            while control.poll():
                _serve(control)
        while True:
            _serve(control)
    for child, folder in _scratch.items():
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        remove(Path(folder))


@cache
def _prepare(name: str) -> None:
    """Import a module, or the reader of logs with this suffix, once for all workers."""
    if name[:1] in ("", "."):
        prepare_reader(name)
    else:
        import_module(name)
    gc.collect()
    gc.freeze()


def _serve(control: Connection) -> None:
    """Answer the next request; EOFError or OSError if the connection is closed."""
    request = control.recv()
    if isinstance(request, int):
        _scratch.pop(request, None)
        with suppress(ProcessLookupError):
            os.kill(request, signal.SIGKILL)
        control.send(os.waitstatus_to_exitcode(os.waitpid(request, 0)[1]))
        return
    with socket.socket(fileno=os.dup(control.fileno())) as carrier:
        _, descriptors, _, _ = socket.recv_fds(carrier, 1, 1)
    needs, scratch = request
    for name in needs:
        _prepare(name)
    child = os.fork()
    if child == 0:
        control.close()
        _work(Connection(descriptors[0]))
    os.close(descriptors[0])
    if scratch:
        _scratch[child] = scratch
    control.send(child)


def _work(connection: Connection) -> NoReturn:
    """The worker: do one job, or jobs until the connection is closed; exit without returning."""
    try:
        subordinate()
        become_worker()
        job: Job = connection.recv()
        if not job.once:
            _give_blas_its_memory()
        last = job.flight
        while True:
            if job.flight != last:
                clear_cache()
            last = job.flight
            connection.send_bytes(_answer(job))
            if job.once:
                os._exit(0)
            return_freed_memory()
            job = connection.recv()
    except (EOFError, OSError):
        os._exit(0)
    finally:
        os._exit(1)


def _give_blas_its_memory() -> None:
    """Let the BLAS of numpy and of scipy take their buffers before memory is limited: one that gets
    none ends its process instead of raising an error."""
    from scipy.linalg import blas  # here: parsing does without

    square = np.ones((300, 300))
    with threadpool_limits(1, user_api="blas"):
        square @ square
        blas.dgemm(1.0, square, square)


def _answer(job: Job) -> bytes:
    """Do a job; return its answer as bytes: kind, and result or exception."""
    confine(job.limits, for_good=job.once)
    try:
        with _as_in_caller(job), failing_alone(job.what, job.where, memory=True):
            answer: tuple[str, Any] = ("done", job.function(*job.arguments))
    except Exception as error:
        lift_memory_limit()
        answer = ("memory", None) if _lacks_memory(error) else ("failed", error)
    if job.once:
        return json.dumps(answer).encode("ascii")
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
