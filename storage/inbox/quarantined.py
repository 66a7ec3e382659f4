"""Quarantine: one folder per entry with the log and the reason, and the way back to the inbox."""

import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from aerodb.errors import InputError
from aerodb.storage.inbox.uploads import put_into_inbox
from aerodb.storage.workspace import Workspace

REASON: Final = "reason.json"


@dataclass(frozen=True)
class Quarantined:
    """An entry of the quarantine: `key` is the name of its folder; `vehicle` is empty if
    unknown; `what` is the reason without the path where the log was."""

    key: str
    name: str
    vehicle: str
    reason: str
    what: str
    at_utc: str
    size: int
    file: Path

    @property
    def can_return(self) -> bool:
        """Whether the entry is a regular file; links and pipes cannot return to the inbox."""
        return self.file.is_file() and not self.file.is_symlink()


def count_quarantined(workspace: Workspace) -> int:
    """Number of entries in quarantine."""
    return sum(1 for _ in _folders(workspace))


def newest_quarantined(workspace: Workspace, limit: int | None = None) -> list[Quarantined]:
    """Entries in quarantine, newest first, at most `limit`."""
    folders = sorted(
        _folders(workspace), key=lambda folder: (-folder.stat().st_mtime_ns, folder.name)
    )
    return [entry for entry in map(_entry, folders[:limit]) if entry is not None]


def _folders(workspace: Workspace) -> Iterator[Path]:
    with os.scandir(workspace.root / "quarantine") as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield Path(entry.path)


def _entry(folder: Path) -> Quarantined | None:
    held = next(
        (
            path
            for path in sorted(folder.iterdir())
            if path.name == "aside" or path.name.startswith("log")
        ),
        None,
    )
    if held is None:
        return None  # from an interrupted return to the inbox
    try:
        reason = folder / REASON
        note = {} if reason.is_symlink() else json.loads(reason.read_text(encoding="ascii"))
    except (OSError, ValueError):
        note = {}
    note.setdefault("what", note.get("reason", ""))
    text = {n: str(note.get(n, "")) for n in ("name", "vehicle", "reason", "what", "at_utc")}
    return Quarantined(folder.name, size=int(note.get("size", 0)), file=held, **text)


def return_to_inbox(workspace: Workspace, entry: Quarantined, vehicle: str) -> Path:
    """Move an entry back to the inbox of a vehicle, where the next sweep tries it again; returns
    its path there.

    No file is overwritten; the inbox may be on another file system. Raises InputError when the
    entry is not a regular file (`Quarantined.can_return`), StoreError on a full disk.
    """
    if not entry.can_return:
        raise InputError("not a regular file", entry.name, "copy the log itself into the inbox")
    target = put_into_inbox(workspace, entry.file, vehicle, entry.name, entry.key)
    shutil.rmtree(entry.file.parent)
    return target
