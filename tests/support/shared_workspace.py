"""Workspaces of the small glider with which many test files begin: each kind is built once per test
session, also where several processes share the session, and everybody works on copies."""

import json
import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.locks import holding
from aerodb.storage.workspace import Workspace
from tests.support import glider_runs
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.paths import ROOT
from tests.support.small_glider import write_files

#: Builds a workspace in a folder that does not exist yet; returns a JSON document about it.
Build = Callable[[Path], Any]


class SharedWorkspaces:
    """Copies of workspaces that are built when they are first asked for.

    Under pytest-xdist each process has a folder of its own below the session's; what is shared is
    beside these. A lock lets one process build while the others wait. Only a complete workspace
    gets its final name, so one whose building failed is built again by whoever asks next. Nobody
    opens the shared workspace itself: its catalogue is in one file, without a write-ahead log.
    """

    def __init__(self, factory: pytest.TempPathFactory) -> None:
        base = factory.getbasetemp()
        self._folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
        self._factory = factory

    @property
    def logs(self) -> list[Path]:
        """The six logs in the order flown, beside the files of vehicle, database and model; not to
        be changed."""
        folder = self._built("glider-files", write_files)
        return [folder / f"flight{k + 1}.csv" for k in range(6)]

    def prepared(self, root: Path) -> Workspace:
        """A workspace in `root` with the vehicle and its handbook database."""
        return self.copy("glider-prepared", self._prepare, root)[0]

    def ingested(self, root: Path) -> Workspace:
        """The same with all six flights."""
        return self.copy("glider-ingested", self._ingest, root)[0]

    def updated(self, root: Path, flights: int = 6) -> tuple[Workspace, dict[str, Any]]:
        """The same with the first flights and an update that made a candidate, and the update's
        document."""
        return self.copy(
            f"glider-updated-{flights}", lambda place: self._update(place, flights), root
        )

    @property
    def undisturbed(self) -> Path:
        """What runs end as that nobody kills or disturbs (`tests.faults.killing.Undisturbed`); not
        to be changed."""
        return self._built("undisturbed", _run_undisturbed)

    @property
    def phoenix_flights(self) -> Path:
        """The folder with the bank of flights of `tests.support.tracing_flights`, whose simulation
        takes 20 seconds of processor time; not to be changed."""
        return self._built("phoenix-flights", _fly_phoenix)

    @property
    def guide(self) -> Path:
        """The folder with vehicle (``my-glider.toml``), handbook and one PX4 log (``flight-1.ulg``)
        of the guide "PX4 without vanes"; not to be changed."""
        return self._built("guide-flight", _fly_guide)

    def copy(self, name: str, build: Build, root: Path) -> tuple[Workspace, Any]:
        """A copy in `root` of the workspace of this name, and its document; paths in it are those
        of the copy."""

        def make(place: Path) -> None:
            original = self._factory.mktemp(name) / "w"
            document = build(original)
            shutil.copytree(
                original, place / "w", ignore=shutil.ignore_patterns("catalogue.sqlite*")
            )
            with (
                closing(sqlite3.connect(original / "catalogue.sqlite")) as source,
                closing(sqlite3.connect(place / "w" / "catalogue.sqlite")) as target,
            ):
                source.backup(target)
            (place / "document.json").write_text(
                json.dumps([str(original), document]), encoding="utf-8"
            )

        folder = self._built(name, make)
        shutil.copytree(folder / "w", root, dirs_exist_ok=True)
        text = (folder / "document.json").read_text(encoding="utf-8")
        original, copied = (json.dumps(path)[1:-1] for path in (json.loads(text)[0], str(root)))
        return Workspace.open(root), json.loads(text.replace(original, copied))[1]

    def _built(self, name: str, make: Callable[[Path], Any]) -> Path:
        """The shared folder of this name, made by the first that asks for it."""
        folder, unfinished = self._folder / name, self._folder / f"{name}.unfinished"
        with holding(self._folder / f"{name}.lock"):
            if not folder.exists():
                shutil.rmtree(unfinished, ignore_errors=True)
                unfinished.mkdir()
                make(unfinished)
                unfinished.rename(folder)
        return folder

    def _prepare(self, place: Path) -> None:
        glider_runs.prepared(place, self.logs[0].parent)

    def _ingest(self, place: Path) -> list[str]:
        return glider_runs.ingest(self.prepared(place), self.logs)

    def _update(self, place: Path, flights: int) -> dict[str, Any]:
        if flights == len(self.logs):
            workspace, ids = self.copy("glider-ingested", self._ingest, place)
        else:
            workspace = self.prepared(place)
            ids = glider_runs.ingest(workspace, self.logs[:flights])
        return glider_runs.update(workspace, ids)


def _fly_phoenix(place: Path) -> None:
    from tests.support.tracing_flights import (
        write_bank,
    )  # imports effects and simulation, for which other tests need not wait

    write_bank(place)


def _fly_guide(place: Path) -> None:
    from tests.support.guide_flights import write_flights  # imports the simulation, as above
    from tests.support.vaneless_flights import guide_files

    files = guide_files()
    for name, text in files.items():
        (place / name).write_text(text, encoding="utf-8")
    write_flights(place, files["my-glider.toml"], files["handbook.toml"], 1)


def _run_undisturbed(place: Path) -> None:
    code = "import pathlib, sys; from tests.faults.killing import make_undisturbed;"
    code += " make_undisturbed(pathlib.Path(sys.argv[1]))"
    run_forked([str(place)], environment(), ROOT, code=code).check_returncode()
