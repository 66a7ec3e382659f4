"""Backup and restore: consistent while others write, interrupted backups refused, incremental,
damaged files excluded."""

import hashlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aerodb.errors import InputError
from aerodb.flows.cli.main import app
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.file_identity import measured
from aerodb.storage.files.flights import INDEX
from aerodb.storage.upkeep.backup import back_up, manifest_of, restore
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.glider_runs import stored
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, state_of


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Path, list[Path]]:
    """A workspace with three flights, an update, and a log in quarantine; and the logs."""
    workspace, _ = shared.updated(tmp_path_factory.mktemp("w"), flights=3)
    bad = tmp_path_factory.mktemp("bad") / "bad.csv"
    bad.write_text("no numbers\n")
    ingest(workspace, bad)
    (workspace.root / "settings.toml").write_text("[limits]\nreserve = 1000\n")
    return workspace.root, shared.logs


@pytest.fixture
def workspace(made: tuple[Path, list[Path]], tmp_path: Path) -> Workspace:
    return Workspace.open(Path(shutil.copytree(made[0], tmp_path / "w")))


def ingest(workspace: Workspace, *logs: Path) -> None:
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, workspace, "direct"
    )


def files(root: Path) -> dict[str, str]:
    return state_of(root, ("catalogue", "prefect", "reports", "locks"))


def test_a_restored_workspace_is_the_one_that_was_backed_up(
    workspace: Workspace, tmp_path: Path
) -> None:
    back_up(workspace, tmp_path / "b")
    restore(tmp_path / "b", tmp_path / "new")
    new = Workspace.open(tmp_path / "new")
    assert files(new.root) == files(workspace.root)
    assert stored(new) == stored(workspace)
    rows = []
    for root in (workspace.root, new.root):
        raw = sqlite3.connect(root / "catalogue.sqlite")
        rows.append(list(raw.iterdump()))
        raw.close()
    assert rows[0] == rows[1]


def test_a_second_backup_copies_only_what_is_new(
    workspace: Workspace, made: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    first = back_up(workspace, tmp_path / "b")
    assert first.copied == first.files > 20
    assert back_up(workspace, tmp_path / "b").copied == 0
    before = files(workspace.root)
    ingest(workspace, made[1][3])
    second = back_up(workspace, tmp_path / "b")
    assert (
        second.copied == len(files(workspace.root)) - len(before) == second.files - first.files > 0
    )
    restore(tmp_path / "b", tmp_path / "new")
    assert stored(Workspace.open(tmp_path / "new")) == stored(workspace)


_KILLED = """
import os, signal, sys
from pathlib import Path
import aerodb.storage.upkeep.backup as backup
from aerodb.storage.workspace import Workspace
copy, left = backup._copy, int(sys.argv[3])
def counted(source, target):
    global left
    left -= 1
    if left < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    copy(source, target)
backup._copy = counted
backup.back_up(Workspace.open(Path(sys.argv[1])), Path(sys.argv[2]))
"""


def _killed_backup(workspace: Workspace, target: Path, after: int) -> None:
    """A backup whose process is killed when it is about to copy one more file than `after`."""
    given = [str(workspace.root), str(target), str(after)]
    killed = run_forked(given, environment(), ROOT, code=_KILLED)
    assert killed.returncode == -signal.SIGKILL, killed.stderr


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
def test_an_interrupted_backup_is_refused_and_can_be_taken_up(
    workspace: Workspace, made: Any, tmp_path: Path
) -> None:
    target = tmp_path / "b"
    _killed_backup(workspace, target, 7)
    with pytest.raises(InputError, match="this backup was interrupted"):
        restore(target, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    again = back_up(workspace, target)
    assert again.copied == again.files - 7
    kept = stored(workspace)
    ingest(workspace, made[1][3])
    _killed_backup(workspace, target, 2)
    restore(target, tmp_path / "new")
    assert stored(Workspace.open(tmp_path / "new")) == kept, (
        "the backup before the interrupted one is still whole"
    )


_WRITER = """
import sys
from pathlib import Path
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.workspace import Workspace
workspace = Workspace.open(Path(sys.argv[1]))
print("ready", flush=True)
for log in sys.argv[3:]:
    sys.stdin.readline()
    run_flow(flight_flow, {"logs": [log], "vehicle": sys.argv[2]}, workspace, "direct")
    print("taken in", flush=True)
"""


def beside_a_writer(
    workspace: Workspace, logs: list[Path], backup: Callable[[int], int]
) -> list[int]:
    """What `backup` says, which is called (with 0, 1...) whenever another process has begun to take
    in one of the `logs`: at once with the first, later with each further one."""
    command = [sys.executable, "-c", _WRITER, str(workspace.root), NAME, *map(str, logs)]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    numbers = []
    with subprocess.Popen(command, cwd=ROOT, **pipes) as writer:
        for k, before in enumerate(["ready\n", *["taken in\n"] * (len(logs) - 1)]):
            assert writer.stdout.readline() == before
            writer.stdin.write("\n")
            writer.stdin.flush()
            time.sleep(0.1 * k)
            numbers.append(backup(k))
        assert writer.stdout.readline() == "taken in\n"
    assert writer.returncode == 0
    return numbers


def test_backups_while_another_process_takes_logs_in(
    tmp_path: Path, shared: SharedWorkspaces, logs: list[Path]
) -> None:
    """Each backup holds whole flights only, and later ones never fewer."""
    workspace = shared.prepared(tmp_path / "w")
    ingest(workspace, logs[0])

    def backup(k: int) -> int:
        place = tmp_path / f"new{k}"
        back_up(workspace, tmp_path / "b")
        restore(tmp_path / "b", place)
        with Catalogue.open(place / "catalogue.sqlite") as catalogue:
            return len(catalogue.flights())

    numbers = beside_a_writer(workspace, logs[1:], backup)
    # The one that is just taken in is there or not; those before it are.
    assert [k + 1 for k in range(5) if numbers[k] not in (k + 1, k + 2)] == [], numbers


def test_damage_in_the_store_is_told_and_does_not_replace_the_good_copy(
    workspace: Workspace, tmp_path: Path
) -> None:
    back_up(workspace, tmp_path / "b")
    path = next((workspace.root / "results").rglob("*.parquet"))
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    result = CliRunner().invoke(
        app, ["--workspace", str(workspace.root), "--json", "backup", str(tmp_path / "b")]
    )
    assert result.exit_code == 1
    (problem,) = json.loads(result.stdout)["problems"]
    assert problem["where"] == workspace.relative(path)
    restore(tmp_path / "b", tmp_path / "new")
    new = Workspace.open(tmp_path / "new")
    with Catalogue.open(new.catalogue) as catalogue:
        assert verify(new, catalogue).problems == []


@pytest.mark.parametrize("what", ["file", "missing", "catalogue", "quarantined", "no reason"])
def test_a_damaged_backup_is_refused_and_leaves_nothing(
    workspace: Workspace, tmp_path: Path, what: str
) -> None:
    back_up(workspace, tmp_path / "b")
    stored_file = next((tmp_path / "b" / "flights").rglob("*.parquet"))
    places = {
        "catalogue": next((tmp_path / "b").glob("catalogue-*")),
        "quarantined": next((tmp_path / "b" / "quarantine").glob("*/log.csv")),
        "no reason": next((tmp_path / "b" / "quarantine").glob("*/reason.json")),
    }
    path = places.get(what, stored_file)
    if what in ("missing", "no reason"):
        path.unlink()
    else:
        data = path.read_bytes()
        path.write_bytes(
            data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 1]) + data[len(data) // 2 + 1 :]
        )
    (tmp_path / "place").mkdir()
    with pytest.raises(InputError) as refusal:
        restore(tmp_path / "b", tmp_path / "place" / "new")
    assert refusal.value.remedy
    assert list((tmp_path / "place").iterdir()) == []


def test_a_manifest_with_any_bit_flipped_is_refused(workspace: Workspace, tmp_path: Path) -> None:
    """A flip in its middle once made another key of "name", and a KeyError of the restore."""
    back_up(workspace, tmp_path / "b")
    manifest = tmp_path / "b" / "backup.json"
    written, rng = manifest.read_bytes(), random.Random(5)
    flips = [(k, rng.randrange(8)) for k in range(len(written))]
    named = written.index(b'"name"')
    for position, bit in [*flips, *[(k, bit) for k in range(named, named + 6) for bit in range(8)]]:
        manifest.write_bytes(
            written[:position] + bytes([written[position] ^ 1 << bit]) + written[position + 1 :]
        )
        with pytest.raises(InputError) as refusal:
            restore(tmp_path / "b", tmp_path / "new")
        assert refusal.value.remedy
    for other in (
        b"",
        b"[]\n",
        b"7\n",
        b"{}\n",
        written[:-1],
        written + b" ",
        written[: len(written) // 2],
    ):
        manifest.write_bytes(other)
        with pytest.raises(InputError, match="differs from the one that was written"):
            manifest_of(tmp_path / "b")
    assert not (tmp_path / "new").exists()
    assert back_up(workspace, tmp_path / "b").copied == 0
    restore(tmp_path / "b", tmp_path / "new")


def _lack(workspace: Workspace) -> list[Path]:
    """Damage of each kind; returns where `verify` sees it."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        flight = catalogue.flights(NAME)[0].id
        gone = workspace.resolve(catalogue.results_of(flight, "coefficients")[0].path)
    gone.unlink()
    topics = sorted((workspace.root / "flights").glob("*/*.topics"))
    (topics[0] / "0000.parquet").write_bytes(b"damaged")
    (topics[1] / INDEX).write_bytes(
        (topics[1] / INDEX).read_bytes().replace(b"topics", b"tropic", 1)
    )
    quarantined = next((workspace.root / "quarantine").glob("*/log.csv"))
    quarantined.unlink()
    return sorted([gone, topics[0] / "0000.parquet", topics[1] / INDEX, quarantined.parent])


def _wheres(workspace: Workspace) -> list[Path]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return sorted(
            workspace.resolve(problem.where) for problem in verify(workspace, catalogue).problems
        )


def test_what_lacked_at_the_backup_does_not_keep_the_rest_from_being_restored(
    workspace: Workspace, made: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    sound = stored(workspace)
    damaged = _lack(workspace)
    assert _wheres(workspace) == damaged
    assert len(back_up(workspace, tmp_path / "b").problems) == 4
    result = CliRunner().invoke(
        app, ["--json", "restore", str(tmp_path / "b"), "--workspace", str(tmp_path / "new")]
    )
    assert result.exit_code == 1
    new = Workspace.open(tmp_path / "new")
    told = sorted(
        new.resolve(problem["where"]) for problem in json.loads(result.stdout)["problems"]
    )
    assert told == _wheres(new) == [new.root / path.relative_to(workspace.root) for path in damaged]
    assert files(new.root).items() <= files(workspace.root).items()
    assert stored(new) == sound
    # The repair works as it does in the workspace itself.
    for folder in {
        path.parent for path in told if path.parent.suffix == ".topics" and path.parent.exists()
    }:
        shutil.rmtree(folder)
    ingest(new, *made[1][:3])
    assert [path.parent.name for path in _wheres(new)] == ["quarantine"]
    # What was sound at the backup, and is not in it any more, is another matter.
    next((tmp_path / "b" / "results").rglob("*.parquet")).unlink()
    with pytest.raises(InputError, match="missing"):
        restore(tmp_path / "b", tmp_path / "another")


def test_an_earlier_copy_that_is_damaged_since_is_not_restored(
    workspace: Workspace, tmp_path: Path
) -> None:
    back_up(workspace, tmp_path / "b")
    path = next((workspace.root / "results").rglob("*.parquet"))
    path.unlink()
    back_up(workspace, tmp_path / "b")
    (tmp_path / "b" / workspace.relative(path)).write_bytes(b"damaged, too")
    (problem,) = restore(tmp_path / "b", tmp_path / "new")["problems"]
    assert problem["where"] == workspace.relative(path)
    assert not (tmp_path / "new" / workspace.relative(path)).exists()


def test_every_folder_in_quarantine_is_in_a_backup_and_those_taken_back_are_not(
    workspace: Workspace, made: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    """Also a log that is stored for another vehicle, one that could not be read, and none of a
    link."""
    stored_log, sha256 = made[1][0], measured(made[1][0])[0]
    workspace.quarantine(stored_log, sha256, "another vehicle's", "other")
    with Catalogue.open(workspace.catalogue) as catalogue:
        log = catalogue.log(sha256)
    assert log is not None
    assert log.status == "stored"
    for name in ("plain", "link"):
        aside = workspace.root / "quarantine" / hashlib.sha256(name.encode()).hexdigest()
        aside.mkdir()
        workspace.write_reason(aside, name, 1, "could not be read", NAME)
        (aside / "aside").symlink_to(stored_log) if name == "link" else (
            aside / "aside"
        ).write_bytes(b"x")
    assert back_up(workspace, tmp_path / "b").problems == ()
    restore(tmp_path / "b", tmp_path / "new")
    expected = files(workspace.root)
    assert files(tmp_path / "new") == {
        path: sha for path, sha in expected.items() if aside.name not in path
    }
    assert (tmp_path / "new" / "quarantine" / sha256 / "log.csv").is_file()
    shutil.rmtree(workspace.root / "quarantine" / sha256)
    back_up(workspace, tmp_path / "b")
    restore(tmp_path / "b", tmp_path / "newer")
    assert not (tmp_path / "newer" / "quarantine" / sha256).exists()


def test_a_place_that_is_taken_is_not_touched(
    workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    back_up(workspace, tmp_path / "b")
    empty = tmp_path / "empty"
    empty.mkdir()
    before = empty.stat()
    with pytest.raises(InputError, match="already exists"):
        restore(tmp_path / "b", empty)
    assert (empty.stat().st_ino, empty.stat().st_ctime_ns) == (before.st_ino, before.st_ctime_ns)
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    with pytest.raises(InputError, match="already exists"):
        restore(tmp_path / "b", tmp_path / "dangling")

    def meanwhile(*arguments: Any) -> Any:
        (tmp_path / "late").mkdir()
        (tmp_path / "late" / "mine.txt").write_text("keep me")
        return verify(*arguments)

    monkeypatch.setattr("aerodb.storage.upkeep.backup.verify", meanwhile)
    with pytest.raises(InputError, match="already exists"):
        restore(tmp_path / "b", tmp_path / "late")
    assert [path.name for path in (tmp_path / "late").iterdir()] == ["mine.txt"]
    assert not list(tmp_path.glob(".late*"))


def test_places_that_are_taken_or_wrong_are_refused(workspace: Workspace, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "mine.txt").write_text("keep me")
    for target, what in (
        (other, "not a backup"),
        (workspace.root / "b", "inside"),
        (tmp_path, "inside"),
        (other / "mine.txt", "not a folder"),
    ):
        with pytest.raises(InputError, match=what):
            back_up(workspace, target)
    with pytest.raises(InputError, match="no backup here"):
        manifest_of(other)
    back_up(workspace, tmp_path / "b")
    with pytest.raises(InputError, match="already exists"):
        restore(tmp_path / "b", other)
    result = CliRunner().invoke(app, ["--workspace", str(tmp_path / "b"), "flight", "list"])
    assert "no workspace here" in str(result.exception), (
        "a backup is no workspace: nobody writes to it by mistake"
    )
    restored = CliRunner().invoke(
        app, ["restore", str(tmp_path / "b"), "--workspace", str(tmp_path / "new")]
    )
    assert restored.exit_code == 0
    assert "verified" in restored.stdout
