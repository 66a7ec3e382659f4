"""The inbox: one folder per vehicle with logs that wait to be ingested. Contents are not parsed
here.

Users choose the names of files in the inbox, so names never become part of another path and links
are never followed.
"""

import errno
import hashlib
import os
import stat
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from io import BufferedReader
from pathlib import Path
from typing import Final, Literal

from aerodb.errors import InputError
from aerodb.storage.encoding import plain_text
from aerodb.storage.limits import Limits
from aerodb.storage.workspace import Workspace, has_sha256, write_atomically
from aerodb.support import key_of

try:
    import fcntl
except ImportError:  # see `aerodb.storage.locks`
    fcntl = None  # type: ignore[assignment]

State = Literal["ready", "copying", "refused", "blocked"]

#: Suffixes of unfinished files; names with a leading dot or a trailing ~ are unfinished too.
UNFINISHED: Final = (
    ".part",
    ".partial",
    ".tmp",
    ".temp",
    ".crdownload",
    ".download",
    ".filepart",
    ".swp",
    ".!sync",
)
_DEEPEST: Final = 16
_BLOCK: Final = 1 << 20


@dataclass(frozen=True)
class InboxFile:
    """A file in the inbox. `relative` is its path there; `size`, `mtime_ns`, `ctime_ns` and `inode`
    show whether it changed.

    state : ``ready``; ``copying`` while it may still grow; ``refused`` if it is not a regular file
    or is too large; ``blocked`` if something else must be done first (see `reason`).
    """

    path: Path
    relative: str
    vehicle: str
    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int
    state: State
    reason: str = ""

    @property
    def file(self) -> tuple[str, int, int]:
        """Path, size [bytes] and time [ns] that identify this file in `InboxHistory`."""
        return plain_text(self.relative), self.size, self.mtime_ns

    def unchanged(self) -> bool:
        """Return whether the file is still the same as when it was scanned: size [bytes], times
        [ns] and inode; an OSError means False."""
        try:
            status = os.lstat(self.path)
        except OSError:
            return False
        now = (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
        return now == (self.size, self.mtime_ns, self.ctime_ns, self.inode)


def scan_inbox(inbox: Path, vehicles: Collection[str], settle: float) -> list[InboxFile]:
    """All files in the inbox, by path. A file is ready when it has not changed for `settle` [s] and
    no process has it open for writing.

    vehicles : names of all vehicles. A file outside their folders belongs to the only vehicle, if
    there is just one.
    """
    now = time.time_ns()
    return [
        _judged(entry, vehicles, settle, now)
        for entry in sorted(_files(inbox, inbox, 0), key=lambda each: each.relative)
    ]


def refuse_oversized(entry: InboxFile, limits: Limits) -> InboxFile:
    """`entry`, refused if it exceeds the size limit; none of its bytes are read."""
    try:
        limits.check_size(entry.size, "")
    except InputError as error:
        return (
            replace(entry, state="refused", reason=f"{error.what}: {error.remedy}")
            if entry.state == "ready"
            else entry
        )
    return entry


def open_log(path: Path, inbox: Path) -> BufferedReader:
    """Open a log for reading. In the inbox, neither the file nor a folder above it may be a link,
    even one created after the scan. Raises OSError when it cannot be opened or is not a regular
    file of the inbox."""
    if not path.absolute().is_relative_to(inbox):
        return path.open("rb")
    descriptor = os.open(
        path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    )
    try:
        itself, there = os.fstat(descriptor), os.stat(path.resolve(strict=True))
        outside = not path.resolve().is_relative_to(inbox.resolve())
        if (
            outside
            or not stat.S_ISREG(itself.st_mode)
            or (itself.st_dev, itself.st_ino) != (there.st_dev, there.st_ino)
        ):
            raise OSError(errno.ELOOP, "not a file in the inbox, or no longer there")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def may_settle(entry: InboxFile) -> bool:
    """Return whether the file can become ready by waiting."""
    return entry.state == "copying" and not named_unfinished(entry.path.name)


def rescan_inbox(entries: list[InboxFile], waited: float, settle: float) -> list[InboxFile]:
    """The files `entries`, `waited` [s] later: those that did not change are ready, whatever
    their time stamps say."""
    return [
        replace(entry, state="ready", reason="")
        if may_settle(entry) and waited >= settle and entry.unchanged() and _closed(entry.path)
        else entry
        for entry in entries
    ]


def _files(folder: Path, inbox: Path, depth: int) -> Iterator[InboxFile]:
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except FileNotFoundError:
        return  # removed in the meantime
    except OSError as error:
        yield _blocked_folder(
            folder, inbox, f"the folder cannot be read: {error.strerror or error}"
        )
        return
    if entries and depth > _DEEPEST:
        yield _blocked_folder(
            folder, inbox, f"more than {_DEEPEST} folders deep: move its content to a higher folder"
        )
        return
    for entry in entries:
        path = folder / entry.name
        if entry.is_dir(follow_symlinks=False):
            yield from _files(path, inbox, depth + 1)
            continue
        try:
            status = os.lstat(path)
        except OSError:
            continue
        relative = path.relative_to(inbox)
        vehicle = relative.parts[0] if len(relative.parts) > 1 else ""
        state: State = "copying" if stat.S_ISREG(status.st_mode) else "refused"
        kind = "a symbolic link" if stat.S_ISLNK(status.st_mode) else "not a regular file"
        reason = "" if state == "copying" else f"{kind}: copy the log itself into the inbox"
        times = (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
        yield InboxFile(path, relative.as_posix(), vehicle, *times, state, reason)


def _blocked_folder(folder: Path, inbox: Path, reason: str) -> InboxFile:
    relative = folder.relative_to(inbox)
    return InboxFile(
        folder, relative.as_posix(), next(iter(relative.parts), ""), 0, 0, 0, 0, "blocked", reason
    )


def _judged(entry: InboxFile, vehicles: Collection[str], settle: float, now: int) -> InboxFile:
    if entry.state in ("refused", "blocked"):
        return entry
    if not entry.vehicle and len(vehicles) == 1:
        entry = replace(entry, vehicle=next(iter(vehicles)))
    if entry.vehicle not in vehicles:
        remedy = (
            f"move it to inbox/{'|'.join(sorted(vehicles)[:6])}/"
            if vehicles
            else "add a vehicle first: aerodb vehicle add FILE.toml"
        )
        problem = (
            f"unknown vehicle '{plain_text(entry.vehicle)[:60]}'"
            if entry.vehicle
            else "not in the folder of a vehicle"
        )
        return replace(entry, state="blocked", reason=f"{problem}: {remedy}")
    if named_unfinished(entry.path.name):
        return replace(entry, reason="its name marks it as unfinished")
    age = (now - max(entry.mtime_ns, entry.ctime_ns)) / 1e9
    # A negative age means that the clock was set back; only `rescan_inbox` can decide then.
    if not age >= settle:
        return replace(entry, reason="changed a moment ago")
    return (
        replace(entry, state="ready")
        if _closed(entry.path)
        else replace(entry, reason="a process has it open for writing")
    )


def named_unfinished(name: str) -> bool:
    """Return whether a file's name says that it is not complete."""
    return name.startswith(".") or name.endswith("~") or name.lower().endswith(UNFINISHED)


def _closed(path: Path) -> bool:
    """Return whether no process has a file open for writing, where the system can tell (Linux
    grants a read lease only then)."""
    if not hasattr(fcntl, "F_SETLEASE"):
        return True
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return True  # reading it reports the error
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_RDLCK)
        fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_UNLCK)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without leases
    finally:
        os.close(descriptor)
    return True


def archived_path(workspace: Workspace, entry: InboxFile, sha256: str) -> Path:
    """Return the path at which a log is archived in the store. A log that is archived under another
    suffix keeps its path."""
    target = workspace.log_path(sha256, entry.path.suffix.lower())
    held = next(
        (
            path
            for path in sorted(target.parent.glob(f"{sha256}*"))
            if path.stat().st_size == entry.size
        ),
        None,
    )
    return held or target


def archive_log(entry: InboxFile, archived: Path, sha256: str) -> None:
    """Move an ingested log from the inbox to its path in the store, `archived`.

    If the same bytes are archived already, the copy in the inbox is deleted. A damaged file at
    `archived` is replaced. Raises OSError, or StoreError where the inbox is on another file system
    and the disk is full.
    """
    if has_sha256(archived, sha256):
        entry.path.unlink(missing_ok=True)
    else:
        _move(entry.path, archived, sha256)


def unreadable_key(entry: InboxFile) -> str:
    """Return the name of the quarantine folder of an entry that has no readable content to hash:
    `key_of` its path, inode and time [ns]."""
    return key_of([plain_text(entry.relative), str(entry.inode), str(entry.mtime_ns)])


def quarantine_unreadable(workspace: Workspace, entry: InboxFile, reason: str) -> Path:
    """Move an entry that is not a regular file (link, pipe), or cannot be read, into quarantine;
    returns its folder.

    The entry is moved and never opened; the target of a link is not touched. StoreError on a full
    disk; see `Workspace.write_reason`.
    """
    folder = workspace.root / "quarantine" / unreadable_key(entry)
    folder.mkdir(exist_ok=True)
    workspace.write_reason(folder, entry.path.name, entry.size, reason, entry.vehicle)
    _move(entry.path, folder / "aside", "")
    return folder


def move_into_inbox(source: Path, target: Path) -> None:
    """Move a regular file into the inbox without overwriting; FileExistsError if `target`
    exists."""
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        whole = target.with_name(f".{target.name[:80]}.{os.getpid()}.part")  # ignored by sweeps
        try:
            write_atomically(whole, lambda temporary: _copied(source, temporary, ""))
            os.link(whole, target)
        finally:
            whole.unlink(missing_ok=True)
    source.unlink()


def _move(source: Path, target: Path, sha256: str) -> None:
    """Move an entry and check its `sha256`, where that is known. Only regular files are opened."""
    try:
        os.replace(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:  # the inbox may be on another file system
            raise
        mode = os.lstat(source).st_mode
        if stat.S_ISREG(mode):
            write_atomically(target, lambda temporary: _copied(source, temporary, sha256))
        else:
            target.unlink(missing_ok=True)  # from an interrupted move
            if stat.S_ISLNK(mode):
                os.symlink(os.readlink(source), target)
            else:
                os.mkfifo(target)  # replaces a socket or a device too: these have no content
        source.unlink(missing_ok=True)


def _copied(source: Path, target: Path, sha256: str) -> None:
    """Copy a file; OSError when its bytes do not have the hash `sha256`, where that is given."""
    digest = hashlib.sha256()
    with source.open("rb") as incoming, target.open("wb") as outgoing:
        while block := incoming.read(_BLOCK):
            digest.update(block)
            outgoing.write(block)
    if sha256 and digest.hexdigest() != sha256:
        raise OSError(f"{source.name!r} changed while it was moved")
