"""The process that forks workers, begun and asked: `aerodb.tasks.workers.server` is its other side.

This module imports nothing of the science, of settings or of numpy: a command begins that process
first, and imports the rest in the meantime.
"""

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Collection
from multiprocessing.connection import Connection
from typing import Final

from aerodb.storage.confined_environment import confined_environment

#: What per-flight steps import, some of it at first use.
SCIENCE: Final = (
    "aerodb.consistency.whole_flight",
    "aerodb.exchange.native",
    "aerodb.tasks.steps.compare",
)
#: What the process imports that looks into a log: a small part of what steps do.
FINDINGS: Final = ("aerodb.tasks.steps.log_findings",)


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


class Server:
    """The process that forks workers, and the connection to it."""

    def __init__(self, needs: Collection[str]) -> None:
        self.owner = os.getpid()
        self._lock = threading.Lock()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = _begun(theirs.fileno(), needs)
        self._control = Connection(ours.detach())

    def fork(self, needs: tuple[str, ...], scratch: str) -> tuple[int, Connection]:
        """Return the id of a new worker that has imported these modules, and the connection to it;
        OSError or EOFError if this server has ended. scratch : folder that is its own."""
        ours, theirs = socket.socketpair()
        with theirs, self._lock:
            self._control.send((needs, scratch))
            with socket.socket(fileno=os.dup(self._control.fileno())) as carrier:
                socket.send_fds(carrier, [b"."], [theirs.fileno()])
            pid = self._control.recv()
        return pid, Connection(ours.detach())

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


_servers: Final[list[Server]] = []
_lock: Final = threading.Lock()


def start_workers(suffixes: Collection[str], needs: tuple[str, ...] = SCIENCE) -> None:
    """Start the process that forks workers in the background, so that it is ready when the first
    log with one of these suffixes (lower case) comes; nothing if there is one. needs : modules that
    it imports besides."""
    server((*suffixes, *needs))


def server(needs: Collection[str] = ()) -> Server:
    """Return the server of this process, a new one if there is none."""
    with _lock:
        for each in _servers:
            if each.owner == os.getpid():
                return each
        _servers.append(Server(needs))
        return _servers[-1]


def forget(ended: Server) -> None:
    """Close a server that was ended from outside; the next use begins another."""
    with _lock:
        if ended in _servers:
            _servers.remove(ended)
            ended.close()
