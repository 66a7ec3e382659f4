"""Commands in processes forked from a server that has imported the product: a process of its own
for each command, without the second or two that the imports take.

The command runs as after ``python -c "from aerodb.flows.cli import main; main()"``, to the real end
of the interpreter: exit handlers, the traceback of an uncaught exception, exit code, and signals.
It differs in what a process reads only when it starts: the hash seed, ``OPENBLAS_NUM_THREADS``,
``LD_PRELOAD``, limits and umask are those of the server.
"""

import atexit
import gc
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO

from tests.support.paths import ROOT

#: What commands import. Not Prefect: it starts threads, which a fork does not take along.
_IMPORTED = (
    "aerodb.flows.cli.main",
    "aerodb.flows.close_loop",
    "aerodb.flows.flight",
    "aerodb.flows.importing",
    "aerodb.flows.release",
    "aerodb.flows.update",
    "aerodb.report.update_page",
    "aerodb.storage.catalogue.catalogue",
    "scipy.signal",
)
_START = "from tests.support.forking import serve; serve()"


def run_forked(
    arguments: Sequence[str],
    environment: Mapping[str, str],
    folder: Path | None = None,
    timeout: float = 600.0,
) -> subprocess.CompletedProcess[str]:
    """Run the command line with `arguments` in `folder` (None: the current one), and return what
    `subprocess.run` returns; subprocess.TimeoutExpired after `timeout` [s]."""
    ours, theirs = socket.socketpair()
    with (
        ours,
        tempfile.TemporaryFile() as given,
        tempfile.TemporaryFile() as output,
        tempfile.TemporaryFile() as errors,
    ):
        request = {
            "arguments": list(arguments),
            "environment": dict(environment),
            "folder": str(folder or Path.cwd()),
        }
        given.write(json.dumps(request).encode())
        given.flush()
        files = [theirs.fileno(), *(file.fileno() for file in (given, output, errors))]
        with theirs:
            socket.send_fds(_server(), [b"."], files)
        ours.settimeout(timeout)
        pid = int(_line(ours))
        try:
            code = int(_line(ours))
        except TimeoutError:
            os.kill(pid, signal.SIGKILL)
            raise subprocess.TimeoutExpired(
                list(arguments), timeout, _bytes(output), _bytes(errors)
            ) from None
        return subprocess.CompletedProcess(list(arguments), code, _text(output), _text(errors))


@cache
def _server() -> socket.socket:
    """The connection to this process's server, which ends with it."""
    ours, theirs = socket.socketpair()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    with theirs:
        command = [sys.executable, "-c", _START, str(theirs.fileno())]
        server = subprocess.Popen(
            command,
            env=environment,
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
        )

    def end() -> None:
        ours.close()
        server.wait()

    atexit.register(end)
    return ours


def _line(connection: socket.socket) -> str:
    """Read one line; the server writes a line at once, and the next only when it is awaited."""
    text = b""
    while not text.endswith(b"\n"):
        part = connection.recv(1)
        if not part:
            raise ConnectionError("the server that forks commands has ended")
        text += part
    return text.decode()


def _bytes(file: IO[bytes]) -> bytes:
    file.seek(0)
    return file.read()


def _text(file: IO[bytes]) -> str:
    """The text of a file with line ends as `subprocess.run` with ``text=True`` gives them."""
    return _bytes(file).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")


def serve() -> None:
    """Fork a process for each request that comes, until nobody can send one; in that process, run
    the command, and return."""
    requests = socket.socket(fileno=int(sys.argv[1]))
    for name in _IMPORTED:
        import_module(name)
    gc.freeze()
    while True:
        _, files, _, _ = socket.recv_fds(requests, 1, 4)
        with suppress(ChildProcessError):  # those that have waited for a command
            while os.waitpid(-1, os.WNOHANG if files else 0)[0]:
                pass
        if not files:
            return
        if _forked() == 0:
            break
        for file in files:
            os.close(file)
    requests.close()
    asking = socket.socket(fileno=files[0])
    command = _forked()
    if command:
        asking.sendall(f"{command}\n".encode())
        _, status = os.waitpid(command, 0)
        asking.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())
        os._exit(0)
    asking.close()
    _become(*files[1:])


def _forked() -> int:
    with warnings.catch_warnings():
        # BLAS has threads of its own, and ends them before a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _become(given: int, output: int, errors: int) -> None:
    """Take the place of the command that is asked for, and run it."""
    from aerodb.flows.cli import main

    with open(given, "rb") as file:
        request = json.loads(_bytes(file))
    for number, stream in ((output, sys.stdout), (errors, sys.stderr)):
        os.dup2(number, stream.fileno())
        os.close(number)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    sys.argv = ["aerodb", *request["arguments"]]
    main()
