"""File locks (flock) that the operating system releases when their holder ends, however it ends.

So whether a process is running is known without relying on process ids. The content of a lock file
is a note for people and other processes.
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
except ImportError:  # no flock on this system: nothing is locked, and no lock counts as held
    fcntl = None  # type: ignore[assignment]


#: A lock held for longer than this [s] is held for work; `is_held` holds it for an instant only.
_PROBE_SECONDS: Final = 1.0


class Lock:
    """A lock that this process holds until `release`, or until it ends."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path, self._descriptor = path, descriptor

    def note(self, content: Mapping[str, Any]) -> None:
        """Write `content` into the lock file, readable by processes of the same user only. JSON in
        ASCII; OSError on a full disk."""
        if hasattr(os, "fchmod"):
            os.fchmod(self._descriptor, 0o600)
        text = json.dumps(content).encode("ascii")
        os.truncate(self._descriptor, 0)
        os.pwrite(self._descriptor, text, 0)

    def release(self, remove: bool = False) -> None:
        """Release the lock. remove : also delete the file, if no other process uses this lock."""
        if remove:
            with suppress(
                OSError
            ):  # on a disk that became read-only the file stays, but is not locked
                self._path.unlink(missing_ok=True)
        os.close(self._descriptor)


def take(path: Path, wait: bool = False) -> Lock | None:
    """Acquire the lock at `path`. Returns None when another holds it; with `wait`, waits instead.

    A check by `is_held` also holds the lock for an instant, so None means that it was held for 1
    [s]. StoreError where the file cannot be made.
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
    """Lock an open file; returns whether it succeeded."""
    if fcntl is None:
        return True
    if wait:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return True
    until = time.monotonic() + _PROBE_SECONDS
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
    """Context manager that holds the lock at `path`, waiting for it if necessary, without a limit.
    StoreError where the file cannot be made."""
    lock = take(path, wait=True)
    assert lock is not None
    try:
        yield lock
    finally:
        lock.release(remove)


def is_held(path: Path) -> bool:
    """Return whether a process holds the lock at `path`; False without the file, and without file
    locks (Windows). OSError where it cannot be opened."""
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
    """Return the note of the holder of a lock, as `Lock.note` writes it; empty, and no error, when
    the lock is free or the note cannot be read."""
    if not is_held(path):
        return {}
    try:
        content = json.loads(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
