"""Access to stored files in the workspace folder or in the object store, for which the folder is
the cache.

To write a file, write it into the folder, upload it (`put`, `put_recording`), then add its row: a
file with a row is in the object store. To read a file, get its path from `local`. Without an object
store, these functions do nothing.
"""

import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Final, TypeVar

from aerodb.errors import InputError
from aerodb.storage.catalogue import Catalogue, StoredFile, measured
from aerodb.storage.files.flights import INDEX, files_in
from aerodb.storage.files.objects import DamagedObject, Objects, objects_of
from aerodb.storage.workspace import Workspace, write_atomically
from aerodb.storage.workspace_settings import SettingsError

#: Number of concurrent transfers.
_CONCURRENT: Final = 8
Item = TypeVar("Item")


def local(workspace: Workspace, catalogue: Catalogue, path: str) -> Path:
    """Local path of the stored file `path` (relative), downloaded if necessary. If the file exists
    nowhere, nothing is at the returned path.

    Raises StoreError as `Objects.fetch`.
    """
    place = workspace.resolve(path)
    objects = _objects(workspace, place.exists())
    if objects is None:
        return place
    if place.exists():
        _used(place)
    # The file may have left the cache just before it was marked as used; from now on it stays for
    # a while.
    if not place.exists() and (stored := catalogue.stored_file(path)) is not None:
        objects.fetch(stored, place)
    return place


def local_recording(workspace: Workspace, catalogue: Catalogue, sha256: str) -> Path:
    """Local folder of the topics of a log (its sha256), as `local`: all of them, or none.

    Raises InputError for a topic that is missing in the object store.
    """
    folder = workspace.recording_path(sha256)
    objects = _objects(workspace, folder.exists())
    if objects is None:
        return folder
    if folder.exists():
        _used(folder / INDEX)
    if not folder.exists():
        index = catalogue.stored_file(workspace.relative(folder / INDEX))
        if index is not None and objects.has(index):
            write_atomically(
                folder, lambda temporary: _fetch_recording(objects, index, temporary), keep=True
            )
    return folder


def _fetch_recording(objects: Objects, index: StoredFile, folder: Path) -> None:
    folder.mkdir()
    _fetch(objects, index, folder)
    concurrently(
        lambda topic: _fetch(objects, topic, folder),
        topics_of(index, (folder / INDEX).read_bytes()),
    )


def _fetch(objects: Objects, stored: StoredFile, folder: Path) -> None:
    if not objects.fetch(stored, folder / Path(stored.path).name):
        raise InputError(
            "this part of a recording is missing in the object store",
            objects.address(stored),
            "ingest the log again",
        )


def is_available(workspace: Workspace, catalogue: Catalogue, path: str) -> bool:
    """Return whether a stored file is in the folder or in the object store (`Objects.has`);
    StoreError where the store cannot be asked."""
    place = workspace.resolve(path)
    here = place.is_file()
    objects = _objects(workspace, here)
    if here or objects is None:
        return here
    stored = catalogue.stored_file(path)
    return stored is not None and objects.has(stored)


def is_recording_available(workspace: Workspace, catalogue: Catalogue, sha256: str) -> bool:
    """Return whether the topics of a log (its sha256) are in the folder or in the object store: the
    index and everything that it names (`topics_of`). StoreError where the store cannot be asked."""
    path = workspace.recording_path(sha256) / INDEX
    here = path.is_file()
    objects = _objects(workspace, here)
    if here or objects is None:
        return here
    index = catalogue.stored_file(workspace.relative(path))
    return index is not None and is_recording_uploaded(objects, index)


def is_recording_uploaded(objects: Objects, index: StoredFile) -> bool:
    """Return whether the object store has the undamaged index of a recording and all topics that it
    names. StoreError where it cannot be asked; see `topics_of`."""
    there = {file for file, _ in objects.below(index.path.removesuffix(f"/{INDEX}")).values()}
    try:
        blocks = (
            objects.blocks(index) if index in there else None
        )  # not the local index: reading it would count as a use
        return blocks is not None and there.issuperset(topics_of(index, b"".join(blocks)))
    except DamagedObject:
        return False


def topics_of(index: StoredFile, text: bytes) -> list[StoredFile]:
    """Return the topic files that an index names; `text` are the bytes of the index. Old indices
    have no hashes: these are empty then. ValueError for bytes that are no JSON."""
    folder = index.path.removesuffix(INDEX)
    return [
        StoredFile(folder + name, sha256, size)
        for name, (sha256, size) in files_in(json.loads(text)).items()
    ]


def put(
    workspace: Workspace, path: Path, place: Path | None = None, sha256: str = ""
) -> StoredFile | None:
    """Upload the file at `path` to the object store, as the stored file `place` (default: `path`).
    Returns None when there is no object store.

    Call it before adding the row of the file. Raises InputError when the file does not have the
    hash `sha256`, StoreError as `Objects.put`.
    """
    objects = objects_of(workspace.root)
    return None if objects is None else objects.put(path, workspace.relative(place or path), sha256)


def put_recording(workspace: Workspace, folder: Path) -> StoredFile | None:
    """Upload the topics in `folder`, and then the index that names them. Returns None when there is
    no object store.

    Raises InputError for a recording from a version that did not store hashes of topics.
    """
    objects = objects_of(workspace.root)
    if objects is None:
        return None
    index = StoredFile(workspace.relative(folder / INDEX), *measured(folder / INDEX))
    there = [file for file, _ in objects.below(workspace.relative(folder)).values()]
    absent = [file for file in topics_of(index, (folder / INDEX).read_bytes()) if file not in there]
    if not all(file.sha256 for file in absent):
        raise InputError(
            "no hash of its topics is recorded",
            index.path,
            "remove this folder and ingest the log again",
        )
    concurrently(
        lambda file: objects.put(workspace.resolve(file.path), file.path, file.sha256, is_new=True),
        absent,
    )
    if index not in there:
        objects.put(folder / INDEX, index.path, index.sha256, is_new=True)
    return index


def _objects(workspace: Workspace, here: bool) -> Objects | None:
    """The object store; None also if its settings cannot be read and the file is local (`here`)."""
    try:
        return objects_of(workspace.root)
    except SettingsError:
        if here:
            return None
        raise


def _used(place: Path) -> None:
    """Mark a file or folder as used now; the least recently used leave the cache first."""
    with suppress(
        OSError
    ):  # read-only disk, or a file of another user: the access time of the system must do
        descriptor = os.open(place, os.O_RDONLY)
        try:
            os.utime(descriptor, ns=(time.time_ns(), os.fstat(descriptor).st_mtime_ns))
        finally:
            os.close(descriptor)


def concurrently(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Call `work` on all items, several at a time. Raises the exception of the first failed item,
    after the calls in progress have ended."""
    with ThreadPoolExecutor(_CONCURRENT) as pool:
        done = [pool.submit(work, item) for item in items]
        try:
            for each in done:
                each.result()
        finally:
            for each in done:
                each.cancel()
