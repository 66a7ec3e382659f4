"""Parsing of logs in another process, under resource limits, so that bad logs do no harm here.

The other process reads the log and writes its topics in the format of the store; this process reads
them on demand. The other process starts once and serves many logs
(`aerodb.storage.readers.worker`).
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from aerodb.errors import InputError, StoreError
from aerodb.recording import Recording
from aerodb.storage.confinement import confined_environment
from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors
from aerodb.storage.limits import Limits


@dataclass(frozen=True)
class Parsed:
    """A parsed log; its topics are in the temporary folder `folder` until `keep` moves them into
    place."""

    folder: Path
    recording: Recording

    def keep(self, place: Path) -> None:
        """Move the topics to `place`; topics that another process has put there in the meantime
        stay."""
        from aerodb.storage.workspace import put_in_place

        put_in_place(self.folder, place, keep=True)


@contextmanager
def parsed_log(path: Path, place: Path, limits: Limits) -> Iterator[Parsed]:
    """Parse the log at `path` in another process; its topics are written to a temporary folder
    beside `place`.

    The temporary folder is removed at the end unless its topics were kept. Raises InputError for a
    log that is damaged beyond use or exceeds its `limits`; only the process that parsed it may have
    died. Raises StoreError when the topics cannot be written.
    """
    from aerodb.storage.files import open_recording

    limits.check_size(path.stat().st_size, str(path))
    folder = temporary_beside(place)
    try:
        with translated_disk_errors(folder):
            _ask(path, {"folder": str(folder.absolute()), "limits": limits.model_dump()})
        yield Parsed(folder, replace(open_recording(folder), source=str(path)))
    finally:
        remove(folder)


class _Worker:
    """A worker process and the pipes to it."""

    def __init__(self, suffixes: Collection[str] = ()) -> None:
        command = [sys.executable, "-P", "-m", "aerodb.storage.readers.worker", *suffixes]
        # A session of its own: an interrupt at the terminal is this process' business, which then
        # ends the worker.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=confined_environment(),
            start_new_session=True,
        )

    def ask(self, job: dict[str, Any]) -> dict[str, str] | None:
        """The answer to a job; None when the worker is dead."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(job).encode("ascii") + b"\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except OSError:
            return None
        answer: dict[str, str] | None = json.loads(line) if line.endswith(b"\n") else None
        return answer

    def close(self) -> None:
        """End the worker and its current job."""
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()
        self._process.kill()
        self._process.wait()


#: Workers that wait for the next log, each with the process that started it: a fork must not use
#: its parent's.
_idle: list[tuple[int, _Worker]] = []
_lock = threading.Lock()


def start_reader(suffixes: Collection[str]) -> None:
    """Start a worker in the background that prepares for logs with these suffixes (lower case), so
    that it is ready when the first log comes; nothing if one is already waiting."""
    with _lock:
        if not any(owner == os.getpid() for owner, _ in _idle):
            _idle.append((os.getpid(), _Worker(suffixes)))


def _take() -> _Worker:
    with _lock:
        mine = [entry for entry in _idle if entry[0] == os.getpid()]
        if mine:
            _idle.remove(mine[-1])
            return mine[-1][1]
    return _Worker()


def _ask(log: Path, job: dict[str, Any]) -> None:
    """Have a log parsed, and raise its error if it failed. A dead worker is replaced once, because
    it may have died before this log."""
    absolute = str(log.absolute())
    for _ in range(2):
        worker = _take()
        try:
            answer = worker.ask({"log": absolute, **job})
        except BaseException:
            worker.close()
            raise
        if answer is None:
            worker.close()
            continue
        with _lock:
            _idle.append((os.getpid(), worker))
        kind = answer.pop("ended")
        if kind != "done":
            answer["where"] = answer["where"].replace(absolute, str(log))
            raise (StoreError if kind == "store" else InputError)(**answer)
        return
    raise StoreError(
        "the process that parses logs ends unexpectedly",
        str(log),
        "check the free memory of this machine, then run again",
    )
