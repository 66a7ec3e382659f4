"""Results that are one file of the store: their key, their file and their row in the catalogue."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from aerodb.storage.catalogue import StoredFile
from aerodb.storage.files import put
from aerodb.support import result_key
from aerodb.tasks.provenance import code_version
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.workspace_access import WorkspaceAccess


@dataclass(frozen=True)
class StoredResult:
    """The result of a step on its inputs under its settings: one file, found by the hash of all
    three.

    step : name of the step in `RESULT_VERSION`. kind : what the file contains. inputs : name ->
    hash or id. flight : id of the flight, None if the result is about several. suffix : of the
    file. folder : folder of the store.
    """

    access: WorkspaceAccess
    step: str
    kind: str
    inputs: Mapping[str, str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    flight: str | None = None
    suffix: str = ".parquet"
    folder: Literal["results", "flights"] = "results"

    @cached_property
    def key(self) -> str:
        """Hash (sha256) of inputs, settings, step and version: the name of the result
        (docs/reference/conventions.md, section "Names and identities"); KeyError for a step without
        `RESULT_VERSION`."""
        return result_key(
            dict(self.inputs), dict(self.settings), self.step, RESULT_VERSION[self.step]
        )

    @property
    def path(self) -> Path:
        """Path of the file, by its `key`; StoreError where its folder cannot be made."""
        workspace = self.access.workspace
        return (
            workspace.flight_path(self.key)
            if self.folder == "flights"
            else workspace.result_path(self.key, self.suffix)
        )

    def stored(self) -> Path | None:
        """Return the file, fetched from the object store if needed; None if there is none or it was
        lost (`WorkspaceAccess.path_of`). StoreError where the object store cannot be asked."""
        return self.access.path_of(self.key)

    def is_stored(self) -> bool:
        """Return whether the file exists, here or in the object store; does not fetch it
        (`WorkspaceAccess.has`). StoreError where the object store cannot be asked."""
        return self.access.has(self.key)

    def write(self, write: Callable[[Path], object]) -> StoredFile | None:
        """Write the file, and return its entry in the object store, if any.

        The result is invisible until its row is added (`add`). StoreError on a full disk.
        """
        write(self.path)
        return put(self.access.workspace, self.path)

    def add(
        self,
        run: str,
        stored: StoredFile | None = None,
        *,
        inputs: Iterable[str] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """Add the row of a result whose file was written.

        inputs, settings : values of the row, if they differ from those of the key. Raises
        UnknownNameError for an unknown flight or run; see `Catalogue.add_result`.
        """
        self.access.keep_result(
            self.key,
            self.path,
            stored,
            step=self.step,
            kind=self.kind,
            flight=self.flight,
            settings=self.settings if settings is None else settings,
            result_version=RESULT_VERSION[self.step],
            code_version=code_version(),
            inputs=self.inputs.values() if inputs is None else inputs,
            run=run,
        )

    def keep(self, run: str, write: Callable[[Path], object], **row: Any) -> None:
        """Write the file and add the row; `row` as in `add`. StoreError on a full disk."""
        self.add(run, self.write(write), **row)
