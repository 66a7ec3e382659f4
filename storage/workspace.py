"""The workspace: one folder with catalogue, stored files, inbox, quarantine and reports.

Names that come from logs never become paths: files are named by the sha256 of their content or by
the key of a result.
"""

import hashlib
import json
import os
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any, Final

from aerodb.errors import InputError, StoreError
from aerodb.storage.catalogue import catalogue_location
from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors

_FOLDERS = (
    "flights",
    "results",
    "inbox",
    "logs",
    "quarantine",
    "reports",
    "outbox",
    "locks",
    "prefect",
)
#: Version of the layout of the workspace's files, which `_FORMAT_FILE` records.
STORE_FORMAT: Final = 1
_FORMAT_FILE: Final = "store_format"
_HEX = re.compile(r"[0-9a-f]{64}")
_SUFFIX = re.compile(r"\.[a-z0-9]{1,8}")
_CHUNK = 1 << 20


def write_atomically(path: Path, write: Callable[[Path], object], keep: bool = False) -> None:
    """Call `write` with a temporary path in the folder of `path`, then rename the file or folder to
    `path`.

    The bytes are on the disk (fsync) before the name appears, so an exception or a power cut never
    leaves half a file. An existing file at `path` is replaced. When `write` raises, `path` is
    unchanged and nothing is left behind; temporary files of a killed process are removed by the
    next write. keep : leave a folder that exists at `path` by then, because another writer of the
    same content was faster. Raises StoreError when the disk is full, read-only or refuses the write
    otherwise.
    """
    with translated_disk_errors(path):
        temporary = temporary_beside(path)
        try:
            write(temporary)
            put_in_place(temporary, path, keep)
        except BaseException:
            remove(temporary)
            raise


def put_in_place(temporary: Path, path: Path, keep: bool = False) -> None:
    """Rename a finished temporary file or folder to `path`; `keep` as in `write_atomically`.
    StoreError on a full or read-only disk."""
    with translated_disk_errors(path):
        _flush(temporary)
        if temporary.is_dir() and path.exists():
            if keep:
                remove(temporary)
                return
            _swap_folder(temporary, path)
        else:
            try:
                os.replace(temporary, path)
            except OSError:
                if not (keep and path.exists()):
                    raise
                remove(temporary)
        _flush_entry(path.parent)


def _swap_folder(new: Path, path: Path) -> None:
    # A rename cannot replace a folder that is not empty: the old one is moved away first.
    old = temporary_beside(path)
    os.replace(path, old)
    os.replace(new, path)
    remove(old)


def _flush(path: Path) -> None:
    if path.is_dir():
        for entry in path.iterdir():
            _flush(entry)
    _flush_entry(path)


def _flush_entry(path: Path) -> None:
    if os.name == "nt" and path.is_dir():  # Windows has no handle on a folder to flush
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def checked_sha256(text: str) -> str:
    """`text` if it is a sha256 (64 hexadecimal digits, lower case); otherwise ValueError."""
    if not _HEX.fullmatch(text):
        raise ValueError(f"not a sha256 in hexadecimal digits: {text[:80]!r}")
    return text


@dataclass(frozen=True)
class Workspace:
    """A workspace folder. Paths inside it are stored relative to `root`, so it can be moved."""

    root: Path

    @classmethod
    def open(cls, root: Path, create: bool = True) -> "Workspace":
        """Open the workspace at `root`. If it does not exist, create it, or raise InputError
        without `create`."""
        workspace = cls(root.absolute())
        if not create and not catalogue_location(workspace.catalogue).begun:
            remedy = (
                "name an existing workspace with --workspace or $AERODB_WORKSPACE, or make one:"
                " aerodb demo, or aerodb vehicle init"
            )
            raise InputError("there is no workspace here", str(root), remedy)
        try:
            for name in _FOLDERS:
                (workspace.root / name).mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError, PermissionError) as error:
            raise InputError(
                f"the folder cannot be used as a workspace: {error.strerror}",
                str(root),
                "choose a folder that you can write to",
            ) from error
        workspace._check_format()
        return workspace

    def _check_format(self) -> None:
        """Record the format of the store, or raise InputError where a newer version wrote it."""
        path = self.root / _FORMAT_FILE
        try:
            written = path.read_text(encoding="ascii", errors="replace").strip()
        except FileNotFoundError:
            with suppress(OSError):  # a full or read-only disk can still be read
                write_atomically(path, lambda new: new.write_text(f"{STORE_FORMAT}\n"))
            return
        except OSError:
            return
        if written != str(STORE_FORMAT):
            raise InputError(
                f"the store has format {written[:20]!r}, this version of aerodb reads"
                f" {STORE_FORMAT}",
                str(path),
                "use the version of aerodb that wrote it, or restore this file from a backup",
            )

    @property
    def catalogue(self) -> Path:
        """Path of the catalogue's SQLite file; not used when the settings name a database (see
        `aerodb.storage.catalogue.location`)."""
        return self.root / "catalogue.sqlite"

    @property
    def inbox(self) -> Path:
        """Folder of logs that wait to be ingested."""
        return self.root / "inbox"

    @property
    def outbox(self) -> Path:
        """Folder of notifications that are not delivered yet."""
        return self.root / "outbox"

    def lock(self, name: str) -> Path:
        """Path of a lock file: ``serve``, ``inbox``, or ``run-<id>``."""
        return self.root / "locks" / name

    @property
    def access_log(self) -> Path:
        """File of what was asked of the console; older lines are in files next to it."""
        return self.root / "access.log"

    @property
    def reports(self) -> Path:
        """Folder of reports."""
        return self.root / "reports"

    @property
    def prefect(self) -> Path:
        """Folder of the orchestrator's own files."""
        return self.root / "prefect"

    def flight_path(self, key: str) -> Path:
        """Path of the flight stored under `key` (a result's key); its folder is created (StoreError
        where that fails). Form: docs/reference/conventions.md, section "Stored files"."""
        return self._place("flights", key, ".parquet")

    def recording_path(self, key: str) -> Path:
        """Folder of the raw topics stored under `key` (a log's sha256); StoreError where it cannot
        be made. Form: docs/reference/conventions.md, section "Stored files"."""
        return self._place("flights", key, ".topics")

    def log_path(self, sha256: str, suffix: str) -> Path:
        """Path of the original bytes of a log that came through the inbox; its folder is created
        (StoreError where that fails). Name: its sha256, see docs/reference/conventions.md, section
        "Names and identities"."""
        return self._place("logs", sha256, suffix if _SUFFIX.fullmatch(suffix) else "")

    def result_path(self, key: str, suffix: str = ".parquet") -> Path:
        """Path of the result stored under `key`; its folder is created. ValueError for what is no
        suffix."""
        if not _SUFFIX.fullmatch(suffix):
            raise ValueError(f"not a file suffix: {suffix!r}")
        return self._place("results", key, suffix)

    def _place(self, folder: str, key: str, suffix: str) -> Path:
        # Fan-out by the first two digits keeps folders small with a million flights.
        parent = self.root / folder / checked_sha256(key)[:2]
        with translated_disk_errors(parent):
            parent.mkdir(exist_ok=True)
        return parent / f"{key}{suffix}"

    def relative(self, path: Path) -> str:
        """`path` as the catalogue stores it: relative to the workspace, with forward slashes.
        ValueError if it is outside the workspace."""
        return path.absolute().relative_to(self.root).as_posix()

    def resolve(self, relative: str) -> Path:
        """Return the file at a stored path, as `relative` gives it; ValueError if it is outside the
        workspace."""
        parts = PurePosixPath(relative)
        if parts.is_absolute() or ".." in parts.parts or not parts.parts:
            raise ValueError(f"not a path inside the workspace: {relative[:80]!r}")
        return self.root / parts

    def quarantine(
        self, path: Path, sha256: str, reason: str, vehicle: str = "", what: str = ""
    ) -> Path:
        """Put the log at `path` into quarantine, with its reason; returns the quarantined file.

        The bytes are copied to ``quarantine/<sha256>/log<suffix>``; the reason (with the log's
        name, size and time, and its `vehicle`) is written to ``reason.json`` there. The file at
        `path` is removed only if it is in the inbox and has the quarantined bytes. Calling it again
        keeps the bytes and updates the reason. Raises InputError when no bytes are in quarantine
        yet and the file at `path` no longer has this sha256. what : the reason without the path,
        where it names the path.
        """
        identity = _identity(path)
        folder = self.root / "quarantine" / checked_sha256(sha256)
        with translated_disk_errors(folder):
            folder.mkdir(exist_ok=True)
        suffix = path.suffix.lower() if _SUFFIX.fullmatch(path.suffix.lower()) else ""
        held = next(iter(sorted(folder.glob("log*"))), None)
        target = held or folder / f"log{suffix}"
        is_held = held is not None and has_sha256(held, sha256)
        if not is_held:
            write_atomically(target, lambda temporary: _copy_checked(path, temporary, sha256))
        self.write_reason(folder, path.name, target.stat().st_size, reason, vehicle, sha256, what)
        in_inbox = path.parent.resolve().is_relative_to(self.inbox.resolve())
        if in_inbox and (not is_held or has_sha256(path, sha256)) and _identity(path) == identity:
            path.unlink(missing_ok=True)
        return target

    def write_reason(
        self,
        folder: Path,
        name: str,
        size: int,
        reason: str,
        vehicle: str,
        sha256: str = "",
        what: str = "",
    ) -> None:
        """Write ``reason.json`` of a quarantine entry: original name, size [bytes], vehicle and
        reason. StoreError on a full disk."""
        at = datetime.now(UTC).isoformat(timespec="seconds")
        note = {
            "name": name,
            "sha256": sha256,
            "size": size,
            "reason": reason,
            "what": what or reason,
            "vehicle": vehicle,
            "at_utc": at,
        }
        write_atomically(folder / "reason.json", lambda temporary: _write_json(temporary, note))


def _identity(path: Path) -> tuple[int, int, int] | None:
    """Inode, size and time of the file at `path`, without following links; a replaced file has
    others."""
    try:
        status = path.lstat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def has_link(path: Path, root: Path) -> bool:
    """Return whether `path`, or a folder between it and `root`, is a symbolic link; ValueError for
    a path outside."""
    return any(
        each.is_symlink() for each in (path, *path.parents)[: len(path.relative_to(root).parts)]
    )


def has_sha256(path: Path, sha256: str) -> bool:
    """Return whether `path` is a readable file whose bytes have this hash; an OSError means
    False."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == sha256
    except OSError:
        return False


def _copy_checked(source: Path, target: Path, sha256: str) -> None:
    digest = hashlib.sha256()
    with source.open("rb") as incoming, target.open("wb") as outgoing:
        while block := incoming.read(_CHUNK):
            digest.update(block)
            outgoing.write(block)
    if digest.hexdigest() != sha256:
        raise InputError(
            "the file changed while it was read",
            str(source),
            "wait until it is written completely, then try again",
        )


def _write_json(path: Path, value: Any) -> None:
    # ASCII only: the name of a log may contain characters that UTF-8 cannot encode.
    path.write_text(json.dumps(value, indent=2, sort_keys=True) + "\n", encoding="ascii")


def write_for_user(workspace: Workspace | None, target: Path, data: bytes) -> Path:
    """Write a file to a path chosen by the user, atomically (`write_atomically`); returns its path.
    workspace : None where there is none to protect.

    Raises InputError when the path is a folder, when its folder does not exist, or when it is
    inside the workspace but not among the reports, because those files belong to the catalogue.
    Links are followed before this check.
    """
    try:
        path = target.resolve()
        if (
            workspace is not None
            and path.is_relative_to(workspace.root.resolve())
            and not path.is_relative_to(workspace.reports.resolve())
        ):
            raise InputError(
                "files cannot be written into the workspace, except to its reports",
                str(target),
                "choose another folder",
            )
        if path.is_dir() or not path.parent.is_dir():
            what = "this is a folder" if path.is_dir() else "its folder does not exist"
            raise InputError(what, str(target), "name a file in an existing folder")
        write_atomically(path, lambda temporary: temporary.write_bytes(data))
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        what = error.what if isinstance(error, StoreError) else str(error)
        raise InputError(
            f"the file cannot be written: {what}", str(target)[:200], "choose another path"
        ) from error
    return path
