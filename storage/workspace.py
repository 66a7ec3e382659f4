"""The workspace: one folder with the catalogue, the flight store, the inbox, the quarantine and the reports.

Names that come from logs never become paths here: files are called by the sha256 of their content or by a result's key.
"""

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from aerodb.errors import InputError

_FOLDERS = ("flights", "results", "inbox", "quarantine", "reports", "prefect")
_HEX = re.compile(r"[0-9a-f]{64}")
_SUFFIX = re.compile(r"\.[a-z0-9]{1,8}")
_CHUNK = 1 << 20


def write_atomically(path: Path, write: Callable[[Path], None], keep: bool = False) -> None:
    """Lets `write` make a file or a folder under a temporary name beside `path`, then puts it at `path` in one step.

    The bytes are on the disk (fsync) before the name appears, so that neither an exception nor a power cut ever shows
    half a file. What stood at `path` is replaced. When `write` raises, `path` is as before and nothing is left behind.
    keep : a folder that stands at `path` by then stays instead: another writer of the same was quicker.
    """
    temporary = path.parent / f".{secrets.token_hex(8)}.tmp"
    try:
        write(temporary)
        _flush(temporary)
        if temporary.is_dir() and path.exists() and not keep:
            _swap_folder(temporary, path)
        else:
            os.replace(temporary, path)
    except BaseException as error:
        _remove(temporary)
        if not (keep and isinstance(error, OSError) and path.exists()):
            raise
    _flush_entry(path.parent)


def _swap_folder(new: Path, path: Path) -> None:
    # A folder that is not empty cannot be replaced by a rename: the old one steps aside first.
    old = path.parent / f".{secrets.token_hex(8)}.tmp"
    os.replace(path, old)
    os.replace(new, path)
    _remove(old)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


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
    """`text` when it is a sha256 in 64 hexadecimal digits, lower case; ValueError otherwise."""
    if not _HEX.fullmatch(text):
        raise ValueError(f"not a sha256 in hexadecimal digits: {text[:80]!r}")
    return text


@dataclass(frozen=True)
class Workspace:
    """One folder that holds everything; paths inside it are stored relative to `root`, so that it can be moved."""

    root: Path

    @classmethod
    def open(cls, root: Path, create: bool = True) -> "Workspace":
        """The workspace at `root`; made when absent and `create`, else InputError."""
        workspace = cls(root.absolute())
        if not create and not workspace.catalogue.is_file():
            remedy = "name an existing one with --workspace or $AERODB_WORKSPACE"
            raise InputError("no workspace here", str(root), remedy)
        try:
            for name in _FOLDERS:
                (workspace.root / name).mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError, PermissionError) as error:
            raise InputError(
                f"cannot be a workspace: {error.strerror}", str(root), "choose a folder that you may write to"
            ) from error
        return workspace

    @property
    def catalogue(self) -> Path:
        """The SQLite file of the catalogue."""
        return self.root / "catalogue.sqlite"

    @property
    def inbox(self) -> Path:
        """Logs put here wait until a run has dealt with them."""
        return self.root / "inbox"

    @property
    def reports(self) -> Path:
        """Reports made for people."""
        return self.root / "reports"

    @property
    def prefect(self) -> Path:
        """The orchestrator's own files."""
        return self.root / "prefect"

    def flight_path(self, key: str) -> Path:
        """Where the flight stored under `key` (a result's key) stands; the folder is made."""
        return self._place("flights", key, ".parquet")

    def recording_path(self, key: str) -> Path:
        """Folder of the raw topics stored under `key` (a log's sha256)."""
        return self._place("flights", key, ".topics")

    def result_path(self, key: str, suffix: str = ".parquet") -> Path:
        """Where the result stored under `key` stands; the folder is made."""
        if not _SUFFIX.fullmatch(suffix):
            raise ValueError(f"not a file suffix: {suffix!r}")
        return self._place("results", key, suffix)

    def _place(self, folder: str, key: str, suffix: str) -> Path:
        # Two digits of fan-out keep a folder small when a million flights are stored.
        parent = self.root / folder / checked_sha256(key)[:2]
        parent.mkdir(exist_ok=True)
        return parent / f"{key}{suffix}"

    def relative(self, path: Path) -> str:
        """`path` as the catalogue stores it: relative to the workspace, with forward slashes."""
        return path.absolute().relative_to(self.root).as_posix()

    def resolve(self, relative: str) -> Path:
        """The file of a stored relative path; ValueError for one that would leave the workspace."""
        parts = PurePosixPath(relative)
        if parts.is_absolute() or ".." in parts.parts or not parts.parts:
            raise ValueError(f"not a path inside the workspace: {relative[:80]!r}")
        return self.root / parts

    def quarantine(self, path: Path, sha256: str, reason: str) -> Path:
        """Puts the log into quarantine with its reason beside it; returns the quarantined file.

        The bytes are copied to ``quarantine/<sha256>/log<suffix>``, the reason (with the log's own name, size and time)
        to ``reason.json`` there. The user's file stays where it is, unless it lies in the inbox. Doing it again keeps
        the bytes and renews the reason. InputError when the file's bytes no longer have this sha256.
        """
        folder = self.root / "quarantine" / checked_sha256(sha256)
        folder.mkdir(exist_ok=True)
        suffix = path.suffix.lower() if _SUFFIX.fullmatch(path.suffix.lower()) else ""
        held = next(iter(sorted(folder.glob("log*"))), None)
        target = held or folder / f"log{suffix}"
        if held is None:
            write_atomically(target, lambda temporary: _copy_checked(path, temporary, sha256))
        note = {
            "name": path.name,
            "sha256": sha256,
            "size": target.stat().st_size,
            "reason": reason,
            "at_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        write_atomically(folder / "reason.json", lambda temporary: _write_json(temporary, note))
        if path.parent.resolve().is_relative_to(self.inbox.resolve()):
            path.unlink(missing_ok=True)
        return target


def _copy_checked(source: Path, target: Path, sha256: str) -> None:
    digest = hashlib.sha256()
    with source.open("rb") as incoming, target.open("wb") as outgoing:
        while block := incoming.read(_CHUNK):
            digest.update(block)
            outgoing.write(block)
    if digest.hexdigest() != sha256:
        raise InputError("the file changed while it was read", str(source), "wait until it is completely written, then try again")


def _write_json(path: Path, value: Any) -> None:
    # ASCII only: a log's name may hold characters that UTF-8 cannot write.
    path.write_text(json.dumps(value, indent=2, sort_keys=True) + "\n", encoding="ascii")


def write_for_user(workspace: Workspace, target: Path, data: bytes) -> Path:
    """Writes a file where a user asked for it, atomically; returns its path.

    Raises InputError for a folder, a folder that is not there, and any place inside the workspace but its reports: what
    stands there is the catalogue's, and links are followed before that is judged.
    """
    try:
        path = target.resolve()
        inside = path.is_relative_to(workspace.root.resolve()) and not path.is_relative_to(workspace.reports.resolve())
        if inside:
            raise InputError("inside the workspace only its own files stand", str(target), "choose another folder")
        if path.is_dir() or not path.parent.is_dir():
            what = "is a folder" if path.is_dir() else "its folder does not exist"
            raise InputError(what, str(target), "name a file in a folder that is there")
        write_atomically(path, lambda temporary: _write_bytes(temporary, data))
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be written: {error}", str(target)[:200], "choose another place") from error
    return path


def _write_bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)
