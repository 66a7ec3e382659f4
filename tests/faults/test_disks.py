"""Full and read-only disks and locked catalogues: reported with a remedy, stored data remain
readable, and the same run works later."""

import os
import shutil
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError, StoreError
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import requires, run_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.sqlite import open_sqlite
from aerodb.storage.disk_errors import require_space
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace, write_atomically
from tests.support.command import aerodb
from tests.support.glider_runs import prepared, stored
from tests.support.paths import ROOT
from tests.support.small_glider import MODEL, NAME, state_of, write_files

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no mounts, no limits")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A small file system of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(folder)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("may not mount a file system here")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def _update(workspace: Workspace) -> dict[str, Any]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        baseline, flights = (
            catalogue.version(NAME, "released").id,
            sorted(row.id for row in catalogue.flights(NAME)),
        )
    given = {"vehicle": NAME, "baseline": baseline, "flights": flights, "model": MODEL}
    document: dict[str, Any] = run_flow(update_flow, given, workspace, "direct")
    return document


@pytest.fixture(scope="module")
def two_flights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Workspace, list[Path]]:
    """Two flights, and a third log beside them; no room is kept in reserve."""
    logs = write_files(tmp_path_factory.mktemp("files"), 3)
    workspace = prepared(tmp_path_factory.mktemp("w"), logs[0].parent)
    (workspace.root / "settings.toml").write_text("[limits]\nreserve = 0\n")
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs[:2]], "vehicle": NAME}, workspace, "direct"
    )
    return workspace, logs


@pytest.fixture
def flown(disk: Path, two_flights: tuple[Workspace, list[Path]]) -> tuple[Workspace, list[Path]]:
    """The same on the small disk, where nobody holds it open."""
    workspace = Workspace.open(Path(shutil.copytree(two_flights[0].root, disk / "w")))
    with closing(
        sqlite3.connect(workspace.catalogue)
    ) as catalogue:  # nobody else has this one open
        catalogue.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    return workspace, two_flights[1]


def _fill(disk: Path, leave: int) -> Path:
    """A file that takes all room but `leave` bytes."""
    filler = disk / "filler"
    state = os.statvfs(disk)
    with filler.open("wb") as file:
        file.write(bytes(max(state.f_bavail * state.f_frsize - leave, 0)))
    return filler


def _sound(workspace: Workspace) -> None:
    with Catalogue.open(workspace.catalogue, create=False) as catalogue:
        assert verify(workspace, catalogue).problems == []


@pytest.mark.parametrize(
    "leave", [40_960, *(pytest.param(n, marks=pytest.mark.campaign) for n in (0, 98_304))]
)
def test_a_full_disk_is_said_and_all_stays_readable(
    flown: tuple[Workspace, list[Path]], disk: Path, leave: int
) -> None:
    """In the middle of an update, wherever the room runs out."""
    workspace, _ = flown
    kept, files = (
        stored(workspace),
        {name: sha for name, sha in state_of(workspace.root).items() if "results/" in name},
    )
    filler = _fill(disk, leave)
    with pytest.raises(StoreError, match="full") as caught:
        _update(workspace)
    assert "free disk space" in caught.value.remedy
    now = stored(workspace)
    assert now["flights"] == kept["flights"]
    assert now["versions"][:1] == kept["versions"], "and a second one is there whole or not at all"
    assert {name: state_of(workspace.root)[name] for name in files} == files
    _sound(workspace)
    listed = aerodb(workspace.root, "flight", "list")
    assert (listed.returncode, listed.stdout.count(NAME)) == (0, 2), listed.stderr
    filler.unlink()
    assert _update(workspace)["label"] == "v0002"
    _sound(workspace)


def test_a_log_for_which_there_is_no_room_is_not_begun(
    flown: tuple[Workspace, list[Path]], disk: Path
) -> None:
    workspace, logs = flown
    before = {
        name: sha for name, sha in state_of(workspace.root).items() if not name.startswith("locks")
    }
    filler = _fill(disk, 2 * logs[2].stat().st_size)
    done = aerodb(workspace.root, "flight", "ingest", str(logs[2]), "--vehicle", NAME, "--direct")
    assert done.returncode == 1
    what, remedy = done.stderr.strip().splitlines()
    assert "MB are free, this log needs about" in what
    assert remedy.startswith("free disk space")
    assert {
        name: sha for name, sha in state_of(workspace.root).items() if not name.startswith("locks")
    } == before
    filler.unlink()
    assert (
        aerodb(
            workspace.root, "flight", "ingest", str(logs[2]), "--vehicle", NAME, "--direct"
        ).returncode
        == 0
    )
    with pytest.raises(StoreError, match="needs about"):
        require_space(disk, 0, reserve=10**12)


def test_a_store_that_is_read_only_for_a_while(
    flown: tuple[Workspace, list[Path]], disk: Path
) -> None:
    workspace, logs = flown
    kept = stored(workspace)
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    try:
        ingest = aerodb(
            workspace.root, "flight", "ingest", str(logs[2]), "--vehicle", NAME, "--direct"
        )
        what, remedy = ingest.stderr.strip().splitlines()
        assert "read-only" in what
        assert "then run again" in remedy
        assert (
            aerodb(
                workspace.root, "version", "evaluate", "released", "--at", "alpha=4deg"
            ).returncode
            == 0
        )
        assert stored(workspace) == kept
        _sound(workspace)
    finally:
        subprocess.run(["mount", "-o", "remount,rw", str(disk)], check=True)
    assert (
        aerodb(
            workspace.root, "flight", "ingest", str(logs[2]), "--vehicle", NAME, "--direct"
        ).returncode
        == 0
    )
    assert len(stored(workspace)["flights"]) == 3


@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_backup_can_be_made_of_a_disk_that_takes_nothing(
    flown: tuple[Workspace, list[Path]], disk: Path, tmp_path: Path, state: str
) -> None:
    """That is when it is needed: a disk with errors becomes read-only."""
    workspace, _ = flown
    kept = stored(workspace)
    with closing(sqlite3.connect(workspace.catalogue)) as catalogue:
        catalogue.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    if state == "full":
        _fill(disk, 0)
    else:
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    done = aerodb(workspace.root, "backup", str(tmp_path / "backup"))
    assert done.returncode == 0, done.stderr
    restored = aerodb(
        tmp_path, "restore", str(tmp_path / "backup"), "--workspace", str(tmp_path / "again")
    )
    assert restored.returncode == 0, restored.stderr
    assert stored(Workspace.open(tmp_path / "again")) == kept


_LIMITED = """
import resource, sys
from pathlib import Path
from aerodb.errors import StoreError
from aerodb.storage.workspace import write_atomically
import signal
import sqlite3
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_atomically(Path(sys.argv[1]), lambda temporary: temporary.write_bytes(bytes(5000)) and None)
except StoreError as error:
    print(error.what, "|", error.remedy)
"""


def test_a_limit_of_the_system_is_said_too_and_the_old_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "f"
    write_atomically(path, lambda temporary: temporary.write_bytes(b"old") and None)
    command = [sys.executable, "-c", _LIMITED, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.startswith(
        "the file exceeds the maximum size of this file system | free disk space"
    ), done.stderr
    assert ([entry.name for entry in tmp_path.iterdir()], path.read_bytes()) == (["f"], b"old")


# What is tried again


def _locked_for_a_while(item: str, *, workspace: str, run: str) -> int:
    """A step that writes to the catalogue, which is held when it is tried first; says how often it
    was tried."""
    TRIED.append(item)
    if len(TRIED) > 1:
        LET_GO.wait(300)
    database = open_sqlite(Path(workspace) / "catalogue.sqlite")
    with database.reading() as connection:
        connection.exec_driver_sql("PRAGMA busy_timeout = 50")
    try:
        with database.writing():
            return len(TRIED)
    finally:
        database.close()
        REFUSED.set()


def _refused(item: str, *, workspace: str, run: str) -> int:
    TRIED.append(item)
    raise InputError("it is not valid", item, "mend it")


def _endless(item: str, *, workspace: str, run: str) -> None:
    while True:
        time.sleep(0.05)


TRIED: list[str] = []
REFUSED, LET_GO = threading.Event(), threading.Event()


@pytest.mark.campaign
def test_a_lock_is_waited_for_and_what_is_wrong_is_not_tried_again(tmp_path: Path) -> None:
    """Under Prefect: a step meets a catalogue that another process holds, a refusal, and a step
    that never ends."""
    workspace = Workspace.open(tmp_path / "w")
    Catalogue.open(workspace.catalogue).close()

    @requires("ingest")
    def held_flow(steps: Any, *, workspace: str, run: str) -> int:
        holder = sqlite3.connect(
            Path(workspace) / "catalogue.sqlite", isolation_level=None, check_same_thread=False
        )
        holder.execute("BEGIN IMMEDIATE")

        def let_go() -> None:
            REFUSED.wait(300)
            holder.rollback()
            holder.close()
            LET_GO.set()

        threading.Thread(target=let_go).start()
        answer: int = steps(_locked_for_a_while, "a", workspace=workspace, run=run)
        return answer

    @requires("ingest")
    def refused_flow(steps: Any, *, workspace: str, run: str) -> None:
        steps(_refused, "b", workspace=workspace, run=run)

    @requires("ingest")
    def endless_flow(steps: Any, *, workspace: str, run: str) -> None:
        steps(_endless, "c", workspace=workspace, run=run)

    assert run_flow(held_flow, {}, workspace) == 2
    with pytest.raises(InputError, match="not valid"):
        run_flow(refused_flow, {}, workspace)
    assert TRIED == ["a", "a", "b"]
    (workspace.root / "settings.toml").write_text('[limits]\nstep = "2 s"\n')
    with pytest.raises(Exception, match=r"2(\.0)? second"):
        run_flow(endless_flow, {}, workspace)
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert sorted(row.state for row in catalogue.runs()) == ["completed", "failed", "failed"]
