"""A Dask cluster on this machine as tests and the bench start it: a scheduler and its workers, each
a process of its own."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.flows.processes import end_with_parent
from tests.support.paths import ROOT
from tests.support.ports import free_port

#: One thread per process of a worker: what steps spend is processor time.
_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONUTF8": "1",
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
}


@dataclass(frozen=True)
class Running:
    """A cluster: its scheduler's address, and the process that starts workers again. What ends two
    of them is given up."""

    address: str
    scheduler: "subprocess.Popen[bytes]"
    workers: "subprocess.Popen[bytes]"
    log: Path

    def settings(self) -> str:
        """The section of a workspace's settings that has its steps done here."""
        return f'[work]\nengine = "dask"\naddress = "{self.address}"\n'

    def at_work(self) -> list[int]:
        """The processes that do the work."""
        found = subprocess.run(
            ["pgrep", "-P", str(self.workers.pid), "-f", "spawn_main"],
            capture_output=True,
            text=True,
        )
        return [int(pid) for pid in found.stdout.split()]

    @contextmanager
    def one_killed(self, when: Callable[[], bool]) -> Iterator[list[int]]:
        """While this lasts, one worker is killed (kill -9) as soon as `when` holds; yields the list
        of those killed."""
        killed: list[int] = []

        def kill() -> None:
            until = time.monotonic() + 300
            while not when():
                if time.monotonic() > until:
                    return
                time.sleep(0.005)
            killed.append(self.at_work()[0])
            os.kill(killed[0], signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        yield killed
        killer.join()


def _command(name: str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", f"distributed.cli.dask_{name}", *arguments]


def _started(command: list[str], log: Path) -> "subprocess.Popen[bytes]":
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PREFECT_", "AERODB_", "DASK_"))
    }
    environment = {**kept, **_ENVIRONMENT, "PYTHONPATH": str(ROOT)}
    with log.open("ab") as said:
        return subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            start_new_session=True,
            preexec_fn=end_with_parent,
        )


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[Running]:
    """A scheduler on a free loopback port and so many workers, with their files in `folder`; ended
    whatever happens."""
    log = folder / "dask.log"
    log.unlink(missing_ok=True)
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = _started(
        _command("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"), log
    )
    options = [
        "--nworkers",
        str(workers),
        "--nthreads",
        "1",
        "--host",
        "127.0.0.1",
        "--no-dashboard",
    ]
    kept_by = _started(
        _command("worker", address, *options, "--local-directory", str(folder / "scratch")), log
    )
    try:
        _wait(log, workers, (scheduler, kept_by))
        yield Running(address, scheduler, kept_by, log)
    finally:
        for process in (kept_by, scheduler):
            end(process)


def end(process: "subprocess.Popen[bytes]") -> None:
    """Kills a process with all that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(timeout=120)


def _wait(log: Path, workers: int, processes: "tuple[subprocess.Popen[bytes], ...]") -> None:
    until = time.monotonic() + 300
    while (said := log.read_text(errors="replace")).count("Registered to") < workers:
        if time.monotonic() > until or any(process.poll() is not None for process in processes):
            raise RuntimeError(f"the cluster did not start:\n{said[-3000:]}")
        time.sleep(0.1)


def noting(
    item: Any, *, workspace: str, run: str, fatal: Any = None, always: bool = False, bad: Any = None
) -> int:
    """A step that notes that it begins; `fatal` ends the worker, the first time or `always`; `bad`
    is refused."""
    told = Path(workspace) / "begun.txt"
    again = told.exists() and f"{item}\n" in told.read_text()
    with told.open("a") as file:
        file.write(f"{item}\n")
    if item == bad:
        raise InputError("cannot be read", f"log {item}", "fly it again")
    if item == fatal and (always or not again):
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def slow(seconds: float, *, workspace: str, run: str) -> None:
    """A step that notes that it begins, and takes its time."""
    Path(workspace, "begun.txt").touch()
    time.sleep(seconds)
