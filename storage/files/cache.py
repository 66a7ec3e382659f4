"""The files of the store wherever they are: in the workspace's folder, or in its object store,
whose cache the folder then is.

Who writes a file writes it into the folder, puts it (`put`, `put_recording`), then adds its row:
what has a row is in the object store. Who reads a file asks for it by `local`. Without an object
store nothing here does anything.
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

#: Objects that are on their way at once.
_TOGETHER: Final = 8
Item = TypeVar("Item")


def local(workspace: Workspace, catalogue: Catalogue, path: str) -> Path:
    """The file of the store at `path` (relative), fetched when it is not here; where it is nowhere,
    nothing is at that place.

    Raises StoreError as `Objects.fetch`.
    """
    place = workspace.resolve(path)
    objects = _objects(workspace, place.exists())
    if objects is None:
        return place
    if place.exists():
        _used(place)
    # What was here may have left the cache just before it was used; from now on it stays for a
    # while.
    if not place.exists() and (stored := catalogue.stored_file(path)) is not None:
        objects.fetch(stored, place)
    return place


def local_recording(workspace: Workspace, catalogue: Catalogue, sha256: str) -> Path:
    """The folder of the topics of a log (its sha256), as `local`: all of them, or none.

    Raises InputError for a topic that the object store has lost.
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
            "this part of a recording is gone", objects.address(stored), "ingest the log again"
        )


def is_available(workspace: Workspace, catalogue: Catalogue, path: str) -> bool:
    """Whether a file of the store is here, or in the object store."""
    place = workspace.resolve(path)
    here = place.is_file()
    objects = _objects(workspace, here)
    if here or objects is None:
        return here
    stored = catalogue.stored_file(path)
    return stored is not None and objects.has(stored)


def is_recording_available(workspace: Workspace, catalogue: Catalogue, sha256: str) -> bool:
    """Whether the topics of a log (its sha256) are here, or in the object store: their index, and
    all that it names."""
    path = workspace.recording_path(sha256) / INDEX
    here = path.is_file()
    objects = _objects(workspace, here)
    if here or objects is None:
        return here
    index = catalogue.stored_file(workspace.relative(path))
    return index is not None and is_recording_uploaded(objects, index)


def is_recording_uploaded(objects: Objects, index: StoredFile) -> bool:
    """Whether the index of a recording is in the object store, sound, and all topics that it names,
    whole."""
    there = {file for file, _ in objects.below(index.path.removesuffix(f"/{INDEX}")).values()}
    try:
        blocks = (
            objects.blocks(index) if index in there else None
        )  # not the one here: reading it would count as a use
        return blocks is not None and there.issuperset(topics_of(index, b"".join(blocks)))
    except DamagedObject:
        return False


def topics_of(index: StoredFile, text: bytes) -> list[StoredFile]:
    """The files of the topics that an index names, `text` being its bytes; without a hash where it
    holds none: an old one."""
    folder = index.path.removesuffix(INDEX)
    return [
        StoredFile(folder + name, sha256, size)
        for name, (sha256, size) in files_in(json.loads(text)).items()
    ]


def put(
    workspace: Workspace, path: Path, place: Path | None = None, sha256: str = ""
) -> StoredFile | None:
    """Puts the file at `path` into the object store as that at `place` (itself, unless given); None
    where there is none.

    It comes before the file's row. Raises InputError for another `sha256`, StoreError as
    `Objects.put`.
    """
    objects = objects_of(workspace.root)
    return None if objects is None else objects.put(path, workspace.relative(place or path), sha256)


def put_recording(workspace: Workspace, folder: Path) -> StoredFile | None:
    """Puts the topics in `folder`, and last the index that names them; None where there is no
    object store.

    Raises InputError for a recording of a time when the hashes of topics were not kept yet.
    """
    objects = objects_of(workspace.root)
    if objects is None:
        return None
    index = StoredFile(workspace.relative(folder / INDEX), *measured(folder / INDEX))
    there = [file for file, _ in objects.below(workspace.relative(folder)).values()]
    absent = [file for file in topics_of(index, (folder / INDEX).read_bytes()) if file not in there]
    if not all(file.sha256 for file in absent):
        raise InputError(
            "no hash of its topics is known",
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
    """The object store; None also where its settings cannot be read, for what is `here` anyway."""
    try:
        return objects_of(workspace.root)
    except SettingsError:
        if here:
            return None
        raise


def _used(place: Path) -> None:
    """Notes that a file or folder is used now: what was not for longest leaves the cache first."""
    with suppress(
        OSError
    ):  # a disk that is read-only, or another's file: then the system's own note must do
        descriptor = os.open(place, os.O_RDONLY)
        try:
            os.utime(descriptor, ns=(time.time_ns(), os.fstat(descriptor).st_mtime_ns))
        finally:
            os.close(descriptor)


def concurrently(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Does `work` on all items, some at once; raises what the first that failed raised, after those
    under way."""
    with ThreadPoolExecutor(_TOGETHER) as pool:
        done = [pool.submit(work, item) for item in items]
        try:
            for each in done:
                each.result()
        finally:
            for each in done:
                each.cancel()
