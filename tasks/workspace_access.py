"""What every task starts with: the workspace's stores, and the vehicle, flight or database that it
is about."""

import json
import os
from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodb.storage.catalogue import Catalogue, StoredFile, catalogue_location, measured
from aerodb.storage.files import is_available, local, local_recording, put
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import load_settings
from aerodb.vehicle import Vehicle, parse_vehicle

if TYPE_CHECKING:
    from aerodb.tables import AeroDatabase


@dataclass(frozen=True)
class WorkspaceAccess:
    """The workspace folder and its catalogue."""

    workspace: Workspace
    catalogue: Catalogue

    def vehicle(self, name: str) -> tuple[Vehicle, str]:
        """A vehicle, with the accuracy limits that the settings give it, and the sha256 of the text
        that describes it."""
        row = self.catalogue.vehicle(name)
        described, limits = _vehicle(row.text, f"vehicle {name}"), self.accuracy(name)
        if limits:
            described = described.model_copy(
                update={"accuracy": described.accuracy.model_copy(update=limits)}
            )
        return described, row.sha256

    def accuracy(self, name: str) -> dict[str, float]:
        """The accuracy limits that the settings give a vehicle: part of the key of whatever they
        decide."""
        return load_settings(self.workspace.root).of(name).accuracy.given

    def database(self, version: str) -> "AeroDatabase":
        """The database of a version, by its full id."""
        return _database(self.catalogue.version_documents(version).content)

    def named(self, vehicle: str, name: str) -> str | None:
        """The id of the version that a name such as ``released`` points at, None while it points
        nowhere."""
        event = self.catalogue.named(vehicle, name)
        return event.version if event is not None else None

    def path_of(self, key: str) -> Path | None:
        """The file of the result stored under `key`, when it is there: one that was lost is made
        again by whoever asks."""
        row = self.catalogue.result(key)
        path = None if row is None else self.file_of(row.path)
        return path if path is not None and path.is_file() else None

    def has(self, key: str) -> bool:
        """Whether the file of the result stored under `key` is there, wherever: it is not
        fetched."""
        row = self.catalogue.result(key)
        return row is not None and is_available(self.workspace, self.catalogue, row.path)

    def file_of(self, path: str) -> Path:
        """The file of the store at `path` (relative), from the object store where it is not
        here."""
        return local(self.workspace, self.catalogue, path)

    def topics_of(self, log_sha256: str) -> Path:
        """The folder of the topics of a log, from the object store where it is not here."""
        return local_recording(self.workspace, self.catalogue, log_sha256)

    def keep_result(
        self, key: str, path: Path, stored: StoredFile | None = None, **row: Any
    ) -> None:
        """Adds the result whose file stands at `path`, and the hash of that file; `row` as of
        `Catalogue.add_result`.

        stored : that file in the object store, where it was put there already: what takes long has
        no place in a transaction.
        """
        stored = stored or put(self.workspace, path)
        with self.catalogue.transaction():
            self.keep_file(path, stored)
            self.catalogue.add_result(key, path=self.workspace.relative(path), **row)

    def keep_file(self, path: Path, stored: StoredFile | None) -> None:
        """Notes the hash of a file of the store, which is in the object store, if there is one."""
        with (
            self.catalogue.transaction()
        ):  # who writes the same file at the same time notes it before or after, not between
            sha256, size = measured(path)
            if stored is not None and stored.sha256 != sha256:  # it was written again since
                put(self.workspace, path, sha256=sha256)
            self.catalogue.add_file(self.workspace.relative(path), sha256, size)


@lru_cache(maxsize=32)
def _vehicle(text: str, where: str) -> Vehicle:
    return parse_vehicle(text, where)


@lru_cache(maxsize=4)
def _database(content: str) -> "AeroDatabase":
    from aerodb.exchange import (
        from_document,
    )  # a second of imports that a look at what waits does not need

    return from_document(json.loads(content))


def access_workspace(workspace: str) -> WorkspaceAccess:
    """The stores of the workspace folder `workspace`; a process opens them once."""
    folder = Workspace.open(Path(workspace))
    place = catalogue_location(folder.catalogue)
    if not place.begun:
        Catalogue.open(folder.catalogue).close()
    return WorkspaceAccess(folder, _catalogue(folder.catalogue, place.identity, os.getpid()))


@lru_cache(maxsize=8)
def _catalogue(path: Path, _identity: Hashable, _process: int) -> Catalogue:
    """One per database and process: another may stand at its place later, and a connection is not
    to be shared with a process that was forked from this one."""
    return Catalogue.open(path)
