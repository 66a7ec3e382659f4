"""Transfers of the whole store between the workspace folder and its object store: upload, download,
and trimming of the cache."""

import hashlib
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from aerodb.errors import InputError
from aerodb.storage.catalogue import Catalogue, StoredFile, measured
from aerodb.storage.disk_errors import is_abandoned, is_temporary, remove, temporary_beside
from aerodb.storage.files.cache import (
    concurrently,
    is_recording_uploaded,
    local,
    local_recording,
    topics_of,
)
from aerodb.storage.files.flights import INDEX
from aerodb.storage.files.objects import DamagedObject, Objects, objects_of
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import FILE, load_settings

#: Folders whose files are listed in the catalogue.
STORE: Final = ("flights", "results", "logs")
#: Files used less than this ago [s] may still be in use and stay in the cache.
_IN_USE: Final = 600.0


@dataclass(frozen=True)
class Part:
    """One folder of the fan-out.

    Files that the catalogue names (topics included); objects in the object store by address, with
    their upload times [s since 1970]; and folders of recordings whose index is missing everywhere
    or damaged, so that their topics are not among the files.
    """

    files: tuple[StoredFile, ...]
    objects: Mapping[str, tuple[StoredFile, float]]
    unread: tuple[str, ...]

    def has(self, address: str, file: StoredFile) -> bool:
        """Return whether the object of a file is there, whole: by its size [bytes], as `StoredFile`
        states it."""
        return address in self.objects and self.objects[address][0].size == file.size


@dataclass(frozen=True)
class TransferReport:
    """Number of files and bytes that were uploaded, downloaded or removed, and the paths `left`:
    files that could not be, because they are damaged, missing or in use."""

    files: int
    bytes: int
    left: tuple[str, ...]


def required_objects(workspace: Workspace) -> Objects:
    """Return the object store of a workspace (setting `store.url`); InputError when it has none."""
    objects = objects_of(workspace.root)
    if objects is None:
        raise InputError(
            "this workspace has no object store",
            str(workspace.root),
            f'set [store] url = "s3://..." in its {FILE}',
        )
    return objects


def parts(workspace: Workspace, catalogue: Catalogue, objects: Objects) -> Iterator[Part]:
    """Yield the whole store, folder by folder, so that memory use does not grow with it; StoreError
    where `Objects` cannot be asked."""
    for folder in STORE:
        there = set(objects.folders(folder))
        for place in sorted({*there, *(f"{folder}/{number:02x}" for number in range(256))}):
            # Rows first: a file with a row is already uploaded, so a later list contains it, even
            # if others write meanwhile.
            rows = catalogue.stored_files(f"{place}/", f"{place}0")  # '0' follows '/'
            present = objects.below(place) if rows or place in there else {}
            if rows or present:
                yield _part(workspace, objects, rows, present)


def _part(
    workspace: Workspace,
    objects: Objects,
    rows: Mapping[str, StoredFile],
    present: Mapping[str, tuple[StoredFile, float]],
) -> Part:
    files, unread = list(rows.values()), []
    for row in rows.values():
        if row.path.endswith(f"/{INDEX}"):
            text = _index(workspace, objects, row, present)
            if text is None:
                unread.append(row.path.removesuffix(INDEX))
            else:
                files += topics_of(row, text)
    return Part(tuple(files), present, tuple(unread))


def _index(
    workspace: Workspace, objects: Objects, row: StoredFile, present: Mapping[str, object]
) -> bytes | None:
    """The text of an index from the place where it is intact; None if there is none: verification
    reports this."""
    with suppress(OSError):  # it is not here, or leaves the cache just now
        text = workspace.resolve(row.path).read_bytes()
        if hashlib.sha256(text).hexdigest() == row.sha256:
            return text
    try:
        blocks = objects.blocks(row) if objects.address(row) in present else None
        return b"".join(blocks) if blocks is not None else None
    except DamagedObject:
        return None


def is_sound(workspace: Workspace, file: StoredFile) -> bool:
    """Return whether a file is in the folder with the bytes that were stored (`measured`); an
    OSError means False."""
    try:
        return measured(workspace.resolve(file.path)) == (file.sha256, file.size)
    except OSError:
        return False


def push(workspace: Workspace, catalogue: Catalogue) -> TransferReport:
    """Upload files that are in the folder but not in the object store: all files of a workspace
    with a new object store, or lost objects. Sizes in the report are in [bytes]; InputError without
    an object store, StoreError where it fails."""
    objects, moved, left = required_objects(workspace), [], []

    def move(file: StoredFile) -> None:
        if is_sound(workspace, file):
            objects.put(workspace.resolve(file.path), file.path, file.sha256, is_new=True)
            moved.append(file.size)
        else:
            left.append(file.path)

    for part in parts(workspace, catalogue, objects):
        absent = [file for file in part.files if not part.has(objects.address(file), file)]
        # The index is transferred after all its topics, because readers of the index rely on them.
        concurrently(move, [file for file in absent if not file.path.endswith(f"/{INDEX}")])
        lost = {f"{path.rpartition('/')[0]}/{INDEX}" for path in left}
        left.extend(file.path for file in absent if file.path in lost)
        concurrently(
            move,
            [file for file in absent if file.path.endswith(f"/{INDEX}") and file.path not in lost],
        )
    return TransferReport(len(moved), sum(moved), tuple(sorted(left)))


def pull(workspace: Workspace, catalogue: Catalogue) -> TransferReport:
    """Download files that are not in the folder, recordings as a whole: used before a workspace
    gives up its object store. Sizes in the report are in [bytes]; InputError without an object
    store, StoreError where it fails."""
    required_objects(workspace)
    moved, left = [], []

    def move(file: StoredFile) -> None:
        try:
            is_index = file.path.endswith(f"/{INDEX}")
            place = (
                _recording(workspace, catalogue, file)
                if is_index
                else local(workspace, catalogue, file.path)
            )
        except (DamagedObject, InputError):
            left.append(file.path)
            return
        if place.exists():
            moved.append(_bytes(place))
        else:
            left.append(file.path)

    # In batches, because all rows may not fit into memory.
    portion: list[StoredFile] = []
    for file in catalogue.every_stored_file():
        if not workspace.resolve(file.path).exists():
            portion.append(file)
        if len(portion) >= 1000:
            concurrently(move, portion)
            portion.clear()
    concurrently(move, portion)
    return TransferReport(len(moved), sum(moved), tuple(sorted(left)))


def _recording(workspace: Workspace, catalogue: Catalogue, index: StoredFile) -> Path:
    return local_recording(workspace, catalogue, Path(index.path).parent.name.partition(".")[0])


def _bytes(place: Path) -> int:
    return (
        sum(entry.stat().st_size for entry in place.iterdir())
        if place.is_dir()
        else place.stat().st_size
    )


def trim(workspace: Workspace, catalogue: Catalogue, size: int | None = None) -> TransferReport:
    """Remove the least recently used files from the folder until at most `size` [bytes] remain;
    without `size`, the limit of the settings, or no limit if they set none.

    Files that are not in the object store, or were used in the last ten minutes, stay; `left` lists
    them if the folder is still larger than `size`. What a killed process left unfinished goes too.
    """
    objects = required_objects(workspace)
    remove_abandoned(workspace)
    size = load_settings(workspace.root).store.cache or None if size is None else size
    here = sorted(_cached(workspace)) if size is not None else []
    over = sum(entry[1] for entry in here) - (size or 0)
    gone, left = [], []
    for _, held, place in here:
        if over <= 0:
            break
        try:
            is_free = _is_put(workspace, catalogue, objects, place) and _is_idle(place)
            if is_free:
                aside = temporary_beside(place)
                os.replace(place, aside)  # a folder goes as a whole
                remove(aside)
                gone.append(held)
        except FileNotFoundError:  # another has removed it meanwhile
            is_free = True
        if is_free:
            over -= held
        else:
            left.append(workspace.relative(place))
    return TransferReport(len(gone), sum(gone), tuple(left) if over > 0 else ())


def remove_abandoned(workspace: Workspace) -> None:
    """Remove temporary files of processes that have ended: nobody may write those paths again."""
    for folder in STORE:
        for place in (workspace.root / folder).glob("??/.*.tmp"):
            if is_abandoned(place):
                with suppress(OSError):  # another removes it too
                    remove(place)


def _cached(workspace: Workspace) -> Iterator[tuple[float, int, Path]]:
    """Time of last use of each file or recording in the folder, its size in bytes, and its path."""
    for folder in STORE:
        for place in (workspace.root / folder).glob("??/*"):
            if not is_temporary(place):
                with suppress(FileNotFoundError):
                    yield _last_used(place), _bytes(place), place


def _is_idle(place: Path) -> bool:
    return abs(time.time() - _last_used(place)) > _IN_USE


def _last_used(place: Path) -> float:
    status = os.stat(place / INDEX if place.is_dir() else place)
    return max(status.st_atime, status.st_mtime)


def _is_put(workspace: Workspace, catalogue: Catalogue, objects: Objects, place: Path) -> bool:
    """Return whether a file, or all files of a recording, are in the object store."""
    stored = catalogue.stored_file(workspace.relative(place / INDEX if place.is_dir() else place))
    if stored is None:
        return False
    return is_recording_uploaded(objects, stored) if place.is_dir() else objects.has(stored)
