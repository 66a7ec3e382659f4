"""Steps whose result is one file of the store: under which key it stands, and how file and row come
to be there."""

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
    """What a step makes of its inputs under settings: one file, found by the hash of all of them.

    step : name of the step in `RESULT_VERSION`. kind : of what is in the file. inputs : name ->
    hash or id. flight : id of the flight that it is about, None where it is about several. suffix :
    of the file. folder : of the store where the file stands.
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
        """The hash under which it is kept."""
        return result_key(
            dict(self.inputs), dict(self.settings), self.step, RESULT_VERSION[self.step]
        )

    @property
    def path(self) -> Path:
        """Where its file belongs."""
        workspace = self.access.workspace
        return (
            workspace.flight_path(self.key)
            if self.folder == "flights"
            else workspace.result_path(self.key, self.suffix)
        )

    def stored(self) -> Path | None:
        """Its file, fetched from the object store where it is not here; None where there is none,
        or it was lost."""
        return self.access.path_of(self.key)

    def is_stored(self) -> bool:
        """Whether its file is kept, here or in the object store: it is not fetched."""
        return self.access.has(self.key)

    def write(self, write: Callable[[Path], object]) -> StoredFile | None:
        """Writes the file; returns what is in the object store of it. Nobody can see it until its
        row is added."""
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
        """Adds the row of the result whose file was written. inputs, settings : as the row names
        them, where that differs from what the key is made of."""
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
        """Writes the file and adds the row; `row` as of `add`."""
        self.add(run, self.write(write), **row)
