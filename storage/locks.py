"""Locks that the system takes back when their holder ends, however it ends: who runs is known
without trusting a process id.

A lock is a file that somebody holds locked (flock); what stands in it is a note for people and
other processes.
"""

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from aerodb.storage.disk_errors import translated_disk_errors

try:
    import fcntl
except ImportError:  # a system without it: nothing is kept apart there, and nothing counts as held
    fcntl = None  # type: ignore[assignment]


#: A lock that is held for longer [s] is held by somebody who works, not by one who looks.
_LOOKING: Final = 1.0


class Lock:
    """A lock that this process holds until `release`, or until it ends."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path, self._descriptor = path, descriptor

    def note(self, content: Mapping[str, Any]) -> None:
        """Writes what others may read of it: processes of the same user, no others."""
        if hasattr(os, "fchmod"):
            os.fchmod(self._descriptor, 0o600)
        text = json.dumps(content).encode("ascii")
        os.truncate(self._descriptor, 0)
        os.pwrite(self._descriptor, text, 0)

    def release(self, remove: bool = False) -> None:
        """Gives it back. remove : nobody else ever asks for this one, so that its file can go."""
        if remove:
            with suppress(
                OSError
            ):  # on a disk that is read-only meanwhile it stays: nobody holds it
                self._path.unlink(missing_ok=True)
        os.close(self._descriptor)


def take(path: Path, wait: bool = False) -> Lock | None:
    """The lock at `path`, or None where somebody else holds it; `wait` waits for it instead.

    Who only looks whether it is held (`is_held`) has it for an instant, too: None means that it was
    held for a second.
    """
    with translated_disk_errors(path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if not _locked(descriptor, wait):
            os.close(descriptor)
            return None
    except BaseException:
        os.close(descriptor)
        raise
    return Lock(path, descriptor)


def _locked(descriptor: int, wait: bool) -> bool:
    """Locks an open file; whether that came about."""
    if fcntl is None:
        return True
    if wait:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return True
    until = time.monotonic() + _LOOKING
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            time.sleep(0.02)


@contextmanager
def holding(path: Path, remove: bool = False) -> Iterator[Lock]:
    """Holds the lock at `path`, waiting for it where need be."""
    lock = take(path, wait=True)
    assert lock is not None
    try:
        yield lock
    finally:
        lock.release(remove)


def is_held(path: Path) -> bool:
    """Whether somebody holds the lock at `path` now."""
    if fcntl is None:
        return False
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def note_of(path: Path) -> dict[str, Any]:
    """What the holder of a lock wrote; empty where nobody holds it."""
    if not is_held(path):
        return {}
    try:
        content = json.loads(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
