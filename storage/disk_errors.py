"""Disk errors as `StoreError` with a remedy, checks of free space, and temporary files."""

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

#: Message and remedy by errno.
_FULL: Final = "free disk space or raise the quota, then run again: stored data remain readable"
_MESSAGES: Final = {
    errno.ENOSPC: ("the disk is full", _FULL),
    errno.EDQUOT: ("the disk quota is exhausted", _FULL),
    errno.EFBIG: ("the file exceeds the maximum size of this file system", _FULL),
    errno.EROFS: ("the disk is read-only", "make it writable, then run again"),
    errno.EACCES: ("no permission to write", "change the permissions, then run again"),
    errno.EPERM: ("no permission to write", "change the permissions, then run again"),
    errno.EIO: ("the disk reports an input/output error", "check the disk, then run again"),
    errno.ESTALE: ("the disk cannot be reached", "check the network, then run again"),
}
#: Conditions that may be transient.
_TRANSIENT: Final = (errno.EIO, errno.ESTALE)
#: Bytes in the store per byte of a log, for its topics, its flight and the results computed from
#: them. Measured: 0.8 (ULog of one hour), 0.9 (ULog of one minute), 1.9 (CSV table).
GROWTH: Final = 2.5
#: A temporary file older than this [s] is abandoned, whoever wrote it.
_ABANDONED: Final = 86_400.0


@contextmanager
def translated_disk_errors(where: Path | str) -> Iterator[None]:
    """Context manager that raises disk errors (OSError) as StoreError with a remedy, those that
    pass as StoreBusyError; by errno, see `_MESSAGES`. Other errors stay."""
    try:
        yield
    except OSError as error:
        known = None if isinstance(error, AeroError) else _MESSAGES.get(error.errno or 0)
        if known is None:
            raise
        kind = StoreBusyError if error.errno in _TRANSIENT else StoreError
        raise kind(known[0], str(where), known[1]) from error


def require_space(root: Path, size: int, reserve: int) -> None:
    """Raise StoreError when the disk of `root` has less free space than logs of `size` bytes need
    in the store plus `reserve` bytes."""
    need = int(GROWTH * size) + reserve
    free = shutil.disk_usage(root).free
    if free < need:
        what = (
            f"{free / 1e6:.0f} MB are free, this log needs about {need / 1e6:.0f} MB including the"
            " reserve"
        )
        raise StoreError(
            what, str(root), "free disk space, or lower [limits] reserve in the workspace settings"
        )


def temporary_beside(path: Path) -> Path:
    """Return a unique temporary name in the folder of `path`; abandoned temporary files of the same
    path are removed, and an OSError of their removal is ignored."""
    name = path.name[:80]
    for left in path.parent.glob(f".{glob.escape(name)}.*.tmp"):
        if is_abandoned(left):
            with suppress(OSError):  # another writer of the same file removes it too
                remove(left)
    return path.parent / f".{name}.{_machine()}.{os.getpid()}.{os.urandom(4).hex()}.tmp"


def is_temporary(path: Path) -> bool:
    """Return whether a file or folder is an unfinished temporary one."""
    return path.name.startswith(".") and path.name.endswith(".tmp")


def is_abandoned(path: Path) -> bool:
    """Return whether the writer of a temporary file has ended: a process of this machine that no
    longer exists, or any writer after a day."""
    try:
        age = time.time() - path.stat().st_mtime
    except FileNotFoundError:
        return False  # completed in the meantime
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
    """Remove a file, a link or a folder with its content; do nothing when it does not exist. Raises
    OSError, which `translated_disk_errors` translates."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
