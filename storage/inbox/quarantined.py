"""What lies in quarantine: a folder each, with the log and the reason; and the way back into the
inbox."""

import json
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from aerodb.errors import InputError
from aerodb.storage.inbox.folders import move_into_inbox
from aerodb.storage.workspace import Workspace

REASON: Final = "reason.json"
#: A name that may become one in the inbox again. Anything else gets the beginning of its key
#: instead.
_PLAIN: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ ()-]{0,120}")


@dataclass(frozen=True)
class Quarantined:
    """One entry: its folder's name is its `key`; `vehicle` is empty where it is not known for whom
    it came."""

    key: str
    name: str
    vehicle: str
    reason: str
    at_utc: str
    size: int
    file: Path

    @property
    def can_return(self) -> bool:
        """Whether it is a file that could be read as a log; a link or a pipe is not."""
        return self.file.is_file() and not self.file.is_symlink()


def count_quarantined(workspace: Workspace) -> int:
    """How many entries there are."""
    return sum(1 for _ in _folders(workspace))


def newest_quarantined(workspace: Workspace, limit: int | None = None) -> list[Quarantined]:
    """The entries, newest first, at most `limit`."""
    found = sorted(
        _folders(workspace), key=lambda folder: (-folder.stat().st_mtime_ns, folder.name)
    )
    return [entry for entry in map(_entry, found[:limit]) if entry is not None]


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
        return None  # taken back, and whoever did so was interrupted
    try:
        note = json.loads((folder / REASON).read_text(encoding="ascii"))
    except (OSError, ValueError):
        note = {}
    text = {name: str(note.get(name, "")) for name in ("name", "vehicle", "reason", "at_utc")}
    return Quarantined(folder.name, size=int(note.get("size", 0)), file=held, **text)


def return_to_inbox(workspace: Workspace, entry: Quarantined, vehicle: str) -> Path:
    """Moves an entry back into the inbox of a vehicle, where the next sweep tries it again; returns
    its place there.

    It takes no other file's place, and the inbox may be a file system of its own.
    Raises InputError for what is no file.
    """
    if not entry.can_return:
        raise InputError(
            "is no file that could be read", entry.name, "copy the log itself into the inbox"
        )
    name = entry.name if _PLAIN.fullmatch(entry.name) else f"{entry.key[:12]}{entry.file.suffix}"
    folder = workspace.inbox / vehicle
    folder.mkdir(exist_ok=True)
    target, number = folder / name, 0
    while True:
        try:
            move_into_inbox(entry.file, target)
            break
        except FileExistsError:  # another log came under this name meanwhile
            number += 1
            target = folder / f"{entry.key[:12]}-{number}-{name}"
    shutil.rmtree(entry.file.parent)
    return target
