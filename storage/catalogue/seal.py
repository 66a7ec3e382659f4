"""Seal of the catalogue's SQLite file: the hash of all its bytes while nobody writes.

A bit that flips where no row is (in free space, or in an index that is not read) changes nothing
that a query shows; only the hash tells. Every writing transaction removes the seal before it
commits, and a process that wrote seals the file again when it closes it: so a file with a seal is
as that process left it, or damaged. The first write to a sealed file checks the seal before it
removes it, so that no new seal covers what another program changed.
"""

import hashlib
import os
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Final

from aerodb.errors import StoreError
from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors

#: Time [s] to wait for other writers: who writes later seals.
_PATIENCE: Final = 1.0
#: A larger file [bytes] gets no seal: its pages are in memory at once while they are hashed.
_LARGEST: Final = 1 << 29


def seal_of(path: Path) -> Path:
    """Return the path of the seal of the SQLite file at `path`."""
    return path.with_name(f"{path.name}.sha256")


def break_seal(path: Path, connection: sqlite3.Connection) -> None:
    """Check the seal and remove it; called in every writing transaction before its first change,
    on its `connection`, which has the lock.

    Raises StoreError where the bytes are not those that were sealed, and on a full or read-only
    disk; see `seal_of`.
    """
    with translated_disk_errors(path):
        try:
            sealed = seal_of(path).read_text(encoding="ascii", errors="replace").strip()
        except FileNotFoundError:
            return
        if sealed != _hash(connection):
            raise StoreError(
                "its bytes changed after aerodb had closed it: they are damaged, or another program"
                " wrote to it",
                str(path),
                "see what changed with `aerodb verify`, then restore a backup; if the change is"
                f" yours, remove {seal_of(path).name}",
            )
        seal_of(path).unlink(missing_ok=True)
        if os.name != "nt":  # a seal that a power cut brings back would not fit
            folder = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def seal(path: Path) -> bool:
    """Seal the file, and return whether it was possible: not while others write, not of a very
    large file, nor on a full or read-only disk: no error is raised. See `is_intact`."""
    with suppress(sqlite3.Error, OSError), closing(_connected(path)) as connection:
        connection.execute("BEGIN IMMEDIATE")
        try:
            if path.stat().st_size > _LARGEST:
                return False
            temporary = temporary_beside(seal_of(path))
            try:
                temporary.write_text(f"{_hash(connection)}\n", encoding="ascii")
                temporary.replace(seal_of(path))
            finally:
                remove(temporary)
        finally:
            connection.execute("ROLLBACK")
        return True
    return False


def is_intact(path: Path) -> bool | None:
    """Return whether the bytes of the file are those that were sealed; None without a seal
    (`seal`); errors of a damaged file mean False."""
    with closing(_connected(path)) as connection:
        try:
            connection.execute("BEGIN IMMEDIATE")  # a writer breaks the seal after that
            sealed = seal_of(path).read_text(encoding="ascii", errors="replace")
            return sealed.strip() == _hash(connection)
        except FileNotFoundError:
            return None
        except sqlite3.OperationalError:  # locked for long, or on a read-only disk
            return None
        except sqlite3.DatabaseError:
            return False


def _connected(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(path, timeout=_PATIENCE, isolation_level=None)


def _hash(connection: sqlite3.Connection) -> str:
    """Hash of all pages, those of the write-ahead log included.

    SQLite reads them: closing a file that this process opened would release SQLite's locks on it.
    """
    return hashlib.sha256(connection.serialize()).hexdigest()
