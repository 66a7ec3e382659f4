"""The inbox: a folder per vehicle, in which logs wait until a run has dealt with them. Nothing here
reads what is in a log.

Names in the inbox are whatever somebody chose: they never become part of another path, and no link
is ever followed.
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

#: What programs put at the end of names of files that they have not finished; a leading dot or a
#: trailing ~ says the same.
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
    tell whether it changed.

    state : ``ready``; ``copying`` while it may still grow; ``refused`` for what is no plain file;
    ``blocked`` where something else must be done first, which `reason` says.
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
        """What tells this file from a later one of the same name, as the catalogue writes it."""
        return plain_text(self.relative), self.size, self.mtime_ns

    def unchanged(self) -> bool:
        """Whether the same file still stands there as it was when it was looked at."""
        try:
            found = os.lstat(self.path)
        except OSError:
            return False
        now = (found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)
        return now == (self.size, self.mtime_ns, self.ctime_ns, self.inode)


def scan_inbox(inbox: Path, vehicles: Collection[str], settle: float) -> list[InboxFile]:
    """Everything in the inbox, by path; ready is what stood still for `settle` [s] and nobody has
    open for writing.

    vehicles : names of those that there are. A file beside their folders belongs to the only
    vehicle, where there is one.
    """
    now = time.time_ns()
    return [
        _judged(entry, vehicles, settle, now)
        for entry in sorted(_files(inbox, inbox, 0), key=lambda each: each.relative)
    ]


def refuse_oversized(entry: InboxFile, limits: Limits) -> InboxFile:
    """`entry`, refused by its size alone where it is too large: not one byte of it is read."""
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
    """A log, open for reading. What lies in the inbox is the file itself: neither it nor a folder
    above it may be a link that somebody has put there since it was looked at. OSError where it
    cannot be opened, or is none."""
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
            raise OSError(errno.ELOOP, "is no file of the inbox (any more)")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def may_settle(entry: InboxFile) -> bool:
    """Whether waiting a moment can make a file ready."""
    return entry.state == "copying" and not _unfinished(entry.path)


def rescan_inbox(seen: list[InboxFile], waited: float, settle: float) -> list[InboxFile]:
    """`seen` after `waited` [s]: what did not change meanwhile is ready, whatever the clock says of
    its times."""
    return [
        replace(entry, state="ready", reason="")
        if may_settle(entry) and waited >= settle and entry.unchanged() and _closed(entry.path)
        else entry
        for entry in seen
    ]


def _files(folder: Path, inbox: Path, depth: int) -> Iterator[InboxFile]:
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except FileNotFoundError:
        return  # went away meanwhile
    except OSError as error:
        yield _blocked_folder(folder, inbox, f"cannot be read: {error.strerror or error}")
        return
    if entries and depth > _DEEPEST:
        yield _blocked_folder(
            folder, inbox, f"more than {_DEEPEST} folders deep: put what is in it further up"
        )
        return
    for entry in entries:
        path = folder / entry.name
        if entry.is_dir(follow_symlinks=False):
            yield from _files(path, inbox, depth + 1)
            continue
        try:
            found = os.lstat(path)
        except OSError:
            continue
        relative = path.relative_to(inbox)
        vehicle = relative.parts[0] if len(relative.parts) > 1 else ""
        state: State = "copying" if stat.S_ISREG(found.st_mode) else "refused"
        kind = "a symbolic link" if stat.S_ISLNK(found.st_mode) else "no plain file"
        reason = "" if state == "copying" else f"{kind}: copy the log itself into the inbox"
        times = (found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)
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
            f"put it into inbox/{'|'.join(sorted(vehicles)[:6])}/"
            if vehicles
            else "aerodb vehicle add FILE.toml"
        )
        said = (
            f"no vehicle '{plain_text(entry.vehicle)[:60]}'"
            if entry.vehicle
            else "in no folder of a vehicle"
        )
        return replace(entry, state="blocked", reason=f"{said}: {remedy}")
    if _unfinished(entry.path):
        return replace(entry, reason="its name says that it is not finished")
    age = (now - max(entry.mtime_ns, entry.ctime_ns)) / 1e9
    # An age below zero: the clock was set back, and only `rescan_inbox` can tell.
    if not age >= settle:
        return replace(entry, reason="changed a moment ago")
    return (
        replace(entry, state="ready")
        if _closed(entry.path)
        else replace(entry, reason="somebody has it open for writing")
    )


def _unfinished(path: Path) -> bool:
    name = path.name.lower()
    return name.startswith(".") or name.endswith("~") or name.endswith(UNFINISHED)


def _closed(path: Path) -> bool:
    """Whether nobody has a file open for writing, where the system can tell (Linux: it grants no
    read lease then)."""
    if not hasattr(fcntl, "F_SETLEASE"):
        return True
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return True  # what cannot be read is told by who reads it
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_RDLCK)
        fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_UNLCK)
    except BlockingIOError:
        return False
    except OSError:
        return True  # not a file system that knows leases
    finally:
        os.close(descriptor)
    return True


def archived_path(workspace: Workspace, entry: InboxFile, sha256: str) -> Path:
    """Where the bytes of a log are kept, or will be: one that came before under another suffix
    stays where it is."""
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


def archive_log(entry: InboxFile, kept: Path, sha256: str) -> None:
    """Takes a log whose flight is stored out of the inbox to where it is `kept`.

    A copy of what is there goes away; what is there and does not have the log's bytes (any more) is
    replaced.
    """
    if has_sha256(kept, sha256):
        entry.path.unlink(missing_ok=True)
    else:
        _move(entry.path, kept, sha256)


def unreadable_key(entry: InboxFile) -> str:
    """The name of the folder in quarantine of what has no content that could name it."""
    return key_of([plain_text(entry.relative), str(entry.inode), str(entry.mtime_ns)])


def quarantine_unreadable(workspace: Workspace, entry: InboxFile, reason: str) -> Path:
    """Moves what is no plain file (a link, a pipe), or cannot be read at all, into quarantine;
    returns its folder.

    The entry itself is moved and never opened: of a link, what it points at stays untouched.
    """
    folder = workspace.root / "quarantine" / unreadable_key(entry)
    folder.mkdir(exist_ok=True)
    workspace.write_reason(folder, entry.path.name, entry.size, reason, entry.vehicle)
    _move(entry.path, folder / "aside", "")
    return folder


def move_into_inbox(source: Path, target: Path) -> None:
    """Moves a plain file into the inbox without ever taking another's place there: FileExistsError
    instead."""
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        whole = target.with_name(f".{target.name[:80]}.{os.getpid()}.part")  # no sweep takes it
        try:
            write_atomically(whole, lambda temporary: _copied(source, temporary, ""))
            os.link(whole, target)
        finally:
            whole.unlink(missing_ok=True)
    source.unlink()


def _move(source: Path, target: Path, sha256: str) -> None:
    """Moves an entry, checked against its `sha256` where that is known; what is no plain file is
    never opened."""
    try:
        os.replace(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:  # the inbox may be a file system of its own
            raise
        mode = os.lstat(source).st_mode
        if stat.S_ISREG(mode):
            write_atomically(target, lambda temporary: _copied(source, temporary, sha256))
        else:
            target.unlink(missing_ok=True)  # made by who was interrupted here
            if stat.S_ISLNK(mode):
                os.symlink(os.readlink(source), target)
            else:
                os.mkfifo(
                    target
                )  # a pipe stands for a socket or a device, too: there is nothing in it
        source.unlink(missing_ok=True)


def _copied(source: Path, target: Path, sha256: str) -> None:
    """Copies bytes; OSError when they are not those of `sha256`, where that is given."""
    digest = hashlib.sha256()
    with source.open("rb") as incoming, target.open("wb") as outgoing:
        while block := incoming.read(_BLOCK):
            digest.update(block)
            outgoing.write(block)
    if sha256 and digest.hexdigest() != sha256:
        raise OSError(f"{source.name!r} changed while it was moved")
