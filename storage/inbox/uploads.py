"""Logs that come into the inbox from elsewhere: from quarantine, or over the network.

A log that is still being received has a name that sweeps take as unfinished. Names are users' own:
one that is not plain is replaced.
"""

import hashlib
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

from aerodb.errors import InputError, StoreError
from aerodb.storage.disk_errors import require_space, translated_disk_errors
from aerodb.storage.inbox.folders import move_into_inbox, named_unfinished
from aerodb.storage.limits import Limits
from aerodb.storage.workspace import Workspace

#: Names that can be used in the inbox; other files are named by the start of their key.
_PLAIN: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ ()-]{0,120}")


def put_into_inbox(workspace: Workspace, source: Path, vehicle: str, name: str, key: str) -> Path:
    """Move a regular file into the inbox of a vehicle, and return its path there.

    No file is overwritten (FileExistsError leads to another name); the inbox may be on another file
    system. key : names the file where its own `name` cannot.
    """
    plain = name if _PLAIN.fullmatch(name) else f"{key[:12]}{source.suffix}"
    folder = _folder(workspace, vehicle)
    target, number = folder / plain, 0
    while True:
        try:
            move_into_inbox(source, target)
            return target
        except FileExistsError:  # another log has this name now
            number += 1
            target = folder / f"{key[:12]}-{number}-{plain}"


def _folder(workspace: Workspace, vehicle: str | None) -> Path:
    """Return the folder of a vehicle in the inbox, made if it is not there; StoreError where it is
    a link, behind which a sweep does not look."""
    folder = workspace.inbox if vehicle is None else workspace.inbox / vehicle
    if folder.is_symlink():
        raise StoreError("a link is in place of this folder", str(folder), "remove the link")
    folder.mkdir(exist_ok=True)
    return folder


class Upload:
    """A log that is being received: its bytes as they come, their hash and number.

    Raises InputError from `take` when the log exceeds the size limit, StoreError when the disk has
    no room for it.
    """

    def __init__(self, path: Path, file: BinaryIO, name: str, limits: Limits) -> None:
        self._path, self._file, self._name, self._limits = path, file, name, limits
        self._hash, self._size = hashlib.sha256(), 0

    def take(self, part: bytes) -> None:
        """Write the bytes that follow. InputError where the log is larger than `Limits` allow
        [bytes], StoreError on a full disk."""
        self._size += len(part)
        self._limits.check_size(self._size, self._name)
        self._hash.update(part)
        with translated_disk_errors(self._path):
            self._file.write(part)

    def whole(self) -> Path:
        """Return the path of the whole log, until the end of `receiving`; InputError if it is
        empty."""
        if not self._size:
            raise InputError("the file is empty", self._name, "choose a log")
        self._file.close()
        return self._path

    def finish(self, workspace: Workspace, vehicle: str) -> tuple[Path, str]:
        """Put the whole log into the inbox; return its path there and its sha256. InputError if it
        is empty; see `put_into_inbox`."""
        self.whole()
        key = self._hash.hexdigest()
        return put_into_inbox(workspace, self._path, vehicle, self._name, key), key


@contextmanager
def receiving(
    workspace: Workspace, vehicle: str | None, name: str, size: int, limits: Limits
) -> Iterator[Upload]:
    """Context manager to receive a log of about `size` bytes; nothing is left of one that is not
    finished. vehicle : None for a log that is only looked at.

    Raises InputError if the log is too large or its name marks it as unfinished, StoreError if the
    disk has no room for it.
    """
    if named_unfinished(name):
        raise InputError("its name marks it as unfinished", name, "rename it, or choose the log")
    limits.check_size(size, name)
    require_space(workspace.root, size, limits.reserve)
    folder = _folder(workspace, vehicle)
    suffix = Path(name).suffix.lower()
    kept = suffix if re.fullmatch(r"\.[a-z0-9]{1,8}", suffix) else ""
    path = folder / f".upload-{secrets.token_hex(8)}{kept}"  # sweeps leave it: a leading dot
    try:
        with translated_disk_errors(path), path.open("xb") as file:
            yield Upload(path, file, name, limits)
    finally:
        path.unlink(missing_ok=True)
