"""Access to a workspace: the folder, the catalogue, and the vehicles, databases and files in
them."""

import json
import os
from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodb.errors import InputError
from aerodb.storage import files
from aerodb.storage.catalogue import Catalogue, FlightRow, StoredFile, catalogue_location, measured
from aerodb.storage.workspace import Workspace
from aerodb.tasks.result_versions import NAMES

# What reads files, settings and vehicles is imported where it is used: queries need none of it.
if TYPE_CHECKING:
    from aerodb.physics import VortexPair
    from aerodb.tables import AeroDatabase
    from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class WorkspaceAccess:
    """The workspace folder and its catalogue."""

    workspace: Workspace
    catalogue: Catalogue

    def vehicle(self, name: str) -> tuple["Vehicle", str]:
        """Return a vehicle, with the accuracy limits of the settings, and the sha256 of its file's
        text (docs/reference/conventions.md, section "Vehicle file"). UnknownNameError where it is
        not known, InputError where its file is wrong."""
        row = self.catalogue.vehicle(name)
        described, limits = _vehicle(row.text, f"vehicle {name}"), self.accuracy(name)
        if limits:
            described = described.model_copy(
                update={"accuracy": described.accuracy.model_copy(update=limits)}
            )
        return described, row.sha256

    def accuracy(self, name: str) -> dict[str, float]:
        """Return the accuracy limits, in SI units, that the settings (`AccuracySettings`) give a
        vehicle.

        They are part of the key of every result that depends on them.
        """
        from aerodb.storage.workspace_settings import load_settings

        return load_settings(self.workspace.root).of(name).accuracy.given

    def name_of(self, row: FlightRow) -> str:
        """Name a flight and the file that it came from."""
        log = self.catalogue.log(row.log_sha256)
        return f"flight {row.label}" if log is None else f"flight {row.label} ({log.name})"

    def database(self, version: str) -> "AeroDatabase":
        """Return the database, in SI units, of a version (its full id); UnknownNameError where
        there is none."""
        return database_from(self.catalogue.version_documents(version).content)

    def flown_database(self, version: str, beside: str = "") -> "AeroDatabase":
        """Return the database, in SI units, that a version (its id) flies and rolls with.

        beside : id of a version of the other line, legs beside aerodynamics or the reverse; empty
        for a version that has both, or that only flies. Raises InputError where both are of one
        line, and for legs without aerodynamics.
        """
        from aerodb.exchange import on_legs

        database = self.database(version)
        if not beside:
            if database.line:
                what = "a wake" if database.line == "wake" else "legs"
                raise InputError(
                    f"a version of {what} alone has no aerodynamics",
                    self._named_version(version),
                    "name a version that has: --with VERSION",
                )
            return database
        other = self.database(beside)
        if "wake" in (database.line, other.line):
            raise InputError(
                "a wake is no part of what is compared or estimated",
                f"{self._named_version(version)} --with {self._named_version(beside)}",
                "fly through it: aerodb version fly VERSION --manoeuvre FILE --with WAKE",
            )
        if database.line == other.line:
            what = "both are legs alone" if other.line else "none is of legs alone"
            raise InputError(
                f"of two versions {what}",
                f"{self._named_version(version)} --with {self._named_version(beside)}",
                "one is the aerodynamics, the other legs with their friction",
            )
        air, legs = (other, database) if database.line else (database, other)
        return on_legs(air, legs)

    def wake(self, version: str) -> "VortexPair | None":
        """Return the vortex pair [SI] of a version (its id) of a wake, its place from where a run
        begins; None for any other version and for ''."""
        from aerodb.exchange import vortex_pair_of

        if not version or self.database(version).line != "wake":
            return None
        return vortex_pair_of(self.database(version))

    def line_name(self, name: str, version: str) -> str:
        """Return the name ``released`` or ``candidate`` as it is in the line of a version (its id):
        those of friction and wakes have their own; any other name as it is."""
        if name not in NAMES[""]:
            return name
        return NAMES[self.database(version).line][name]

    def _named_version(self, version: str) -> str:
        return f"version {self.catalogue.version_of_id(version).label}"

    def named(self, vehicle: str, name: str) -> str | None:
        """Return the id of the version that a name such as ``released`` points at; None if at none.
        InputError for a name that is not allowed."""
        event = self.catalogue.named(vehicle, name)
        return event.version if event is not None else None

    def path_of(self, key: str) -> Path | None:
        """Return the file of the result stored under `key`; None if there is none or it was lost.

        The caller computes a lost result again. StoreError where the object store cannot be asked.
        """
        row = self.catalogue.result(key)
        path = None if row is None else self.file_of(row.path)
        return path if path is not None and path.is_file() else None

    def has(self, key: str) -> bool:
        """Return whether the file of the result under `key` exists, here or remotely; does not
        fetch it. StoreError where the object store cannot be asked."""
        row = self.catalogue.result(key)
        return row is not None and files.is_available(self.workspace, self.catalogue, row.path)

    def file_of(self, path: str) -> Path:
        """Return the file of the store at `path` (relative), fetched from the object store if
        needed. ValueError for a path outside the workspace, StoreError where it cannot be
        fetched."""
        return files.local(self.workspace, self.catalogue, path)

    def topics_of(self, log_sha256: str) -> Path:
        """Return the folder of a log's topics, fetched from the object store if needed
        (`local_recording`). StoreError where it cannot be fetched."""
        return files.local_recording(self.workspace, self.catalogue, log_sha256)

    def keep_result(
        self, key: str, path: Path, stored: StoredFile | None = None, **row: Any
    ) -> None:
        """Add the result whose file is at `path`, with the file's hash; `row` as in
        `Catalogue.add_result`.

        stored : the file's entry in the object store, if it was uploaded already: slow work does
        not belong in a transaction. StoreError where it cannot be uploaded.
        """
        stored = stored or files.put(self.workspace, path)
        with self.catalogue.transaction():
            self.keep_file(path, stored)
            self.catalogue.add_result(key, path=self.workspace.relative(path), **row)

    def keep_file(self, path: Path, stored: StoredFile | None) -> None:
        """Record hash (sha256) and size [bytes] of a file of the store; the file is in the object
        store, if there is one. StoreError where it cannot be read or uploaded; see
        `Catalogue.add_file`."""
        with (
            self.catalogue.transaction()
        ):  # who writes the same file at the same time notes it before or after, not between
            sha256, size = measured(path)
            if stored is not None and stored.sha256 != sha256:  # it was written again since
                files.put(self.workspace, path, sha256=sha256)
            self.catalogue.add_file(self.workspace.relative(path), sha256, size)


@lru_cache(maxsize=32)
def _vehicle(text: str, where: str) -> "Vehicle":
    from aerodb.vehicle import parse_vehicle

    return parse_vehicle(text, where)


@lru_cache(maxsize=4)
def database_from(content: str) -> "AeroDatabase":
    """Return the database, in SI units, of a version's content, JSON text (`from_document`);
    InputError for another document."""
    from aerodb.exchange import (
        from_document,
    )  # a second of imports that a look at what waits does not need

    return from_document(json.loads(content))


def access_workspace(workspace: str) -> WorkspaceAccess:
    """Return the access to the workspace folder `workspace`; a process opens each catalogue once.
    InputError where the folder cannot be a workspace, StoreError where its catalogue cannot be
    opened."""
    folder = Workspace.open(Path(workspace))
    place = catalogue_location(folder.catalogue)
    if not place.begun:
        Catalogue.open(folder.catalogue).close()
    return WorkspaceAccess(folder, _catalogue(folder.catalogue, place.identity, os.getpid()))


@lru_cache(maxsize=8)
def _catalogue(path: Path, _identity: Hashable, _process: int) -> Catalogue:
    """Open one connection per database and process.

    Another database may later be at the same path, and a connection must not be shared with a
    forked process.
    """
    return Catalogue.open(path)
