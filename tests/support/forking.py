"""Commands in processes forked from a server that has imported the product: a process of its own
for each command, without the second or two that the imports take.

The command runs as after ``python -c "from aerodb.flows.cli import main; main()"``, or after
``python -c`` with code of the caller's, to the real end of the interpreter: exit handlers, the
traceback of an uncaught exception, exit code, and signals.
It differs in what a process reads only when it starts: the hash seed, ``OPENBLAS_NUM_THREADS``,
``LD_PRELOAD``, limits and umask are those of the server; and the process that it starts to fork
workers (`aerodb.tasks.workers`) is such a command, too.
"""

import atexit
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO

from aerodb.storage.confined_environment import confined_environment
from tests.support.paths import ROOT

#: What commands and flows import, and what forks workers for flights. Not Prefect: it starts
#: threads, which a fork does not take along.
IMPORTED = (
    "aerodb.consistency.whole_flight",
    "aerodb.exchange.native",
    "aerodb.flows.cli.main",
    "aerodb.flows.close_loop",
    "aerodb.flows.flight",
    "aerodb.flows.importing",
    "aerodb.flows.inbox",
    "aerodb.flows.release",
    "aerodb.flows.update",
    "aerodb.flows.web.server",
    "aerodb.report.update_page",
    "aerodb.storage.catalogue.catalogue",
    "aerodb.tasks.workers.server",
    "aerodb.tasks.steps.compare",
    "matplotlib.backends.backend_svg",
    "scipy.signal",
)
_START = "from tests.support.forking import serve; serve()"
_FOR_FLIGHTS = "import os; os.setsid(); from aerodb.tasks.workers.server import main; main()"
#: In a command: the connection by which it asks its server for further commands.
_inherited: list[socket.socket] = []


def run_forked(
    arguments: Sequence[str],
    environment: Mapping[str, str],
    folder: Path | None = None,
    timeout: float = 600.0,
    code: str = "",
) -> subprocess.CompletedProcess[str]:
    """Run the command line (or `code`) with `arguments` in `folder` (None: the current one), and
    return what `subprocess.run` returns; subprocess.TimeoutExpired after `timeout` [s]."""
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        with Forked(arguments, environment, output, errors, folder, code) as process:
            try:
                ended = process.wait(timeout)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                raise subprocess.TimeoutExpired(
                    list(arguments), timeout, _bytes(output), _bytes(errors)
                ) from None
        return subprocess.CompletedProcess(list(arguments), ended, _text(output), _text(errors))


class Forked:
    """A command (or `code`) that runs; what it says goes into the files `output` and `errors`. With
    a file descriptor `passed`, its last argument is the number that this has there."""

    def __init__(
        self,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        output: IO[bytes],
        errors: IO[bytes],
        folder: Path | None = None,
        code: str = "",
        passed: int | None = None,
    ) -> None:
        self._arguments = list(arguments)
        self._answers, theirs = socket.socketpair()
        request = {
            "arguments": self._arguments,
            "environment": dict(environment),
            "folder": str(folder or Path.cwd()),
            "code": code,
        }
        with tempfile.TemporaryFile() as given, theirs:
            given.write(json.dumps(request).encode())
            given.flush()
            files = [theirs.fileno(), *(file.fileno() for file in (given, output, errors))]
            files += [] if passed is None else [passed]
            socket.send_fds(server(), [b"."], files)
        self.pid = int(_line(self._answers))
        self.returncode: int | None = None

    def __enter__(self) -> "Forked":
        return self

    def __exit__(self, *_: object) -> None:
        self._answers.close()

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code when it has ended; subprocess.TimeoutExpired after `timeout` [s]."""
        if self.returncode is None:
            self._answers.settimeout(timeout)
            try:
                self.returncode = int(_line(self._answers))
            except TimeoutError:
                raise subprocess.TimeoutExpired(self._arguments, timeout or 0.0) from None
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it is known to have ended."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def server() -> socket.socket:
    """The connection to this process's server, or in a command to that which forked it."""
    return _inherited[0] if _inherited else _started()


@cache
def _started() -> socket.socket:
    """The connection to a server that ends with this process."""
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
    for name in IMPORTED:
        import_module(name)
    gc.freeze()
    inherited, of_commands = socket.socketpair()
    while True:
        (ready, *_), _, _ = select.select([requests, of_commands], [], [])
        _, files, _, _ = socket.recv_fds(ready, 1, 5)
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
    of_commands.close()
    asking = socket.socket(fileno=files[0])
    command = _forked()
    if command:
        inherited.close()
        for file in files[1:]:
            os.close(file)
        asking.sendall(f"{command}\n".encode())
        _, status = os.waitpid(command, 0)
        with suppress(OSError):  # a command that is gone asked for it
            asking.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())
        os._exit(0)
    asking.close()
    _inherited.append(inherited)
    _become(*files[1:])


def fork_for_flights() -> None:
    """Let this process's server fork what `aerodb.tasks.workers` starts, instead of that importing
    for two seconds what the server has imported."""
    from aerodb.tasks.workers import beginning  # here: other tests need not wait for it

    server()
    beginning._begun = _ForFlights  # type: ignore[assignment]


class _ForFlights(Forked):
    """The process that forks workers for flights, as `subprocess.Popen` gives one; `control` is its
    end of the connection to it."""

    def __init__(self, control: int, needs: Collection[str]) -> None:
        with open(os.devnull, "r+b") as nothing:
            super().__init__(
                [*needs],
                confined_environment(),
                nothing,
                nothing,
                Path("/"),
                _FOR_FLIGHTS,
                passed=control,
            )

    def kill(self) -> None:
        with suppress(ProcessLookupError):
            super().kill()


def _forked() -> int:
    with warnings.catch_warnings():
        # BLAS has threads of its own, and ends them before a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _become(given: int, output: int, errors: int, *passed: int) -> None:
    """Take the place of the command that is asked for, and run it."""
    with open(given, "rb") as file:
        request = json.loads(_bytes(file))
    for number, stream in ((output, sys.stdout), (errors, sys.stderr)):
        os.dup2(number, stream.fileno())
        os.close(number)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    code = request["code"]
    sys.argv = ["-c" if code else "aerodb", *request["arguments"], *map(str, passed)]
    if os.environ.get("PYTHONPATH") == str(ROOT):  # else Python itself might start with more
        fork_for_flights()
    exec(code or "from aerodb.flows.cli import main; main()", {"__name__": "__main__"})
