"""The folder of one trial, and the processes that work in it."""

import atexit
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.campaigns.kills.writes import processes_in
from tests.support.end_to_end import environment
from tests.support.forking import Forked, run_forked
from tests.support.object_service import ObjectService, object_service
from tests.support.paths import ROOT
from tests.support.small_glider import NAME

#: Seconds that anything may take: a trial that waits longer has failed.
LONGEST: Final = 300.0
#: A process group of its own, as a shell gives to each command.
_CODE: Final = (
    "import os; os.setsid()\n"
    "from tests.campaigns.kills.writes import arm; arm(command=True)\n"
    "from aerodb.flows.cli import main; main()"
)
#: Children of a command watch their writes too.
_PATHS: Final = os.pathsep.join([str(ROOT / "tests/campaigns/kills/everywhere"), str(ROOT)])


@dataclass
class Place:
    """Folder of one trial: ``w`` is the workspace, and the commands run in the folder itself.

    files : the logs and the files of vehicle, database and model. more : environment variables of
    its commands.
    """

    here: Path
    files: Path
    more: dict[str, str] = field(default_factory=dict)

    @property
    def workspace(self) -> Workspace:
        return Workspace.open(self.here / "w")

    @property
    def has_catalogue(self) -> bool:
        return (self.here / "w" / "catalogue.sqlite").is_file()

    def filled(self, given: Iterable[str]) -> list[str]:
        """Arguments with what stands for files, folder, port and ids put in. The catalogue is only
        opened for ids: that might mend it."""
        given = tuple(given)
        port = self.more.get("KILLS_PORT", "")
        known = {"files": str(self.files), "here": str(self.here), "port": port}
        if any("{flight}" in part or "{candidate}" in part for part in given):
            with Catalogue.open(self.here / "w" / "catalogue.sqlite") as catalogue:
                known["flight"] = min(row.id for row in catalogue.flights(NAME))
                known["candidate"] = catalogue.names(NAME).get("candidate", "")
        return [part.format(**known) for part in given]

    def arguments(self, given: Iterable[str]) -> list[str]:
        """The arguments of the command line."""
        return ["--workspace", str(self.here / "w"), *self.filled(given)]

    def run(self, *given: str) -> tuple[int, str, str]:
        """Exit code, output and errors of a command that nobody kills."""
        done = run_forked(self.arguments(given), environment(**self.more), self.here)
        return done.returncode, done.stdout, done.stderr

    @contextmanager
    def begun(
        self, given: Iterable[str], said_to: str = "said", **watched: str
    ) -> Iterator[Forked]:
        """A command that has begun; with variables of `tests.campaigns.kills.writes` its writes are
        watched."""
        more = {**self.more, **watched}
        if watched:
            more |= {"KILLS_FOLDER": str(self.here), "PYTHONPATH": _PATHS}
        with (
            (self.here.parent / f"{said_to}.txt").open("wb") as said,
            Forked(
                self.arguments(given), environment(**more), said, said, self.here, _CODE
            ) as process,
        ):
            try:
                yield process
            finally:
                if not ended(process):
                    process.kill()
                    process.wait(60)

    def said(self) -> str:
        return (self.here.parent / "said.txt").read_text(errors="replace")[-3000:]

    def left(self) -> list[str]:
        """Processes that still run in the folder a minute after its last command."""
        until = time.monotonic() + 60
        while found := processes_in(str(self.here)):
            if time.monotonic() > until:
                return [f"{process} {said}" for process, said in found.items()]
            time.sleep(0.05)
        return []


def copied(base: Path, files: Path, folder: Path) -> Place:
    """A copy of a folder for one trial, in place of that of the last one."""
    here = folder / "trial"
    cleared(here)
    shutil.copytree(base, here)
    return Place(here, files)


def cleared(folder: Path) -> None:
    """Remove a folder; a process that has just been killed may still be at its last file there."""
    until = time.monotonic() + 60
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def ended(process: Forked) -> bool:
    if process.returncode is None:
        with suppress(Exception):
            process.wait(0.0001)
    return process.returncode is not None


def until(condition: Callable[[], Any]) -> bool:
    """Wait for something; false if it has not come after `LONGEST`."""
    limit = time.monotonic() + LONGEST
    while not condition():
        if time.monotonic() > limit:
            return False
        time.sleep(0.001)
    return True


def snapshot(place: Place) -> dict[str, tuple[int, int]]:
    """Size and time of each file that a command changes when it has begun to write.

    Not the files by which SQLite reads, no locks but those of runs, and not what a console and
    Prefect write for themselves.
    """
    found = {}
    for folder, _, names in os.walk(place.here):
        for name in names:
            path = os.path.join(folder, name)
            inside = path.removeprefix(str(place.here / "w") + os.sep)
            if inside.startswith("prefect" + os.sep) or inside == "access.log":
                continue
            if inside.startswith("locks" + os.sep) and not name.startswith("run-"):
                continue
            with suppress(OSError):
                status = os.stat(path)
                if not name.endswith(("-shm", "-wal")) or (status.st_size and name[-1] == "l"):
                    found[path] = (status.st_size, status.st_mtime_ns)
    return found


@cache
def stores() -> ObjectService:
    """A real S3 service, until this process ends."""
    held = ExitStack()
    atexit.register(held.close)
    return held.enter_context(object_service())
