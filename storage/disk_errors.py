"""What the disk may do to a run: be full, read-only or out of reach. Said in plain words, and asked
before a run begins."""

import errno
import glob
import hashlib
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from aerodb.errors import AeroError, StoreBusyError, StoreError

#: What cannot be written, by the system's number, and what to do about it.
_FULL: Final = "make room (or enlarge the quota), then run again: what is stored stays readable"
_FAULTS: Final = {
    errno.ENOSPC: ("the disk is full", _FULL),
    errno.EDQUOT: ("the quota of the disk is used up", _FULL),
    errno.EFBIG: ("the file would be larger than this system allows", _FULL),
    errno.EROFS: ("the disk is read-only now", "make it writable, then run again"),
    errno.EACCES: ("may not be written", "give yourself the right to write there, then run again"),
    errno.EPERM: ("may not be written", "give yourself the right to write there, then run again"),
    errno.EIO: ("the disk reports an input/output error", "check the disk, then run again"),
    errno.ESTALE: ("the disk is not reachable now", "check the network, then run again"),
}
#: Those that may pass by themselves.
_PASSING: Final = (errno.EIO, errno.ESTALE)
#: Bytes in the store per byte of a log, for its topics, its flight and what is computed from it:
#: 0.8 of a ULog of an hour, 0.9 of one of a minute, 1.9 of a CSV table were measured.
GROWTH: Final = 2.5
#: A temporary file that is older [s] was left behind, whoever wrote it.
_ABANDONED: Final = 86_400.0


@contextmanager
def translated_disk_errors(where: Path | str) -> Iterator[None]:
    """Turns what the system says of a disk that cannot take what is written into a StoreError that
    says what to do."""
    try:
        yield
    except OSError as error:
        known = None if isinstance(error, AeroError) else _FAULTS.get(error.errno or 0)
        if known is None:
            raise
        kind = StoreBusyError if error.errno in _PASSING else StoreError
        raise kind(known[0], str(where), known[1]) from error


def require_space(root: Path, size: int, reserve: int) -> None:
    """StoreError when the disk of `root` has no room for what logs of `size` bytes become, and
    `reserve` bytes beside it."""
    need = int(GROWTH * size) + reserve
    free = shutil.disk_usage(root).free
    if free < need:
        what = (
            f"{free / 1e6:.0f} MB are free, this log needs about {need / 1e6:.0f} MB with the"
            " reserve"
        )
        raise StoreError(
            what, str(root), "make room, or set [limits] reserve lower in the workspace's settings"
        )


def temporary_beside(path: Path) -> Path:
    """A name beside `path` that nobody else uses; what writers of the same that have died left
    there is removed."""
    name = path.name[:80]
    for left in path.parent.glob(f".{glob.escape(name)}.*.tmp"):
        if is_abandoned(left):
            with suppress(OSError):  # another who writes the same is removing it, too
                remove(left)
    return path.parent / f".{name}.{_machine()}.{os.getpid()}.{os.urandom(4).hex()}.tmp"


def is_temporary(path: Path) -> bool:
    """Whether a file or folder is one that a writer has not finished."""
    return path.name.startswith(".") and path.name.endswith(".tmp")


def is_abandoned(path: Path) -> bool:
    """Whether the writer of a temporary file is dead: a process of this machine that has ended, or
    anyone after a day."""
    try:
        age = time.time() - path.stat().st_mtime
    except FileNotFoundError:
        return False  # finished meanwhile
    parts = path.name.rsplit(".", 4)
    is_ours = len(parts) == 5 and parts[1] == _machine() and parts[2].isdecimal()
    return abs(age) > _ABANDONED or (is_ours and not _is_alive(int(parts[2])))


def _machine() -> str:
    return hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def remove(path: Path) -> None:
    """Removes a file, a link or a folder with all that is in it; nothing when it is not there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
