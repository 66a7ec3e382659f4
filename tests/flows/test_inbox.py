"""The inbox: each file ends exactly once and where it belongs, whatever it is called, is, or does
to who reads it.

Sweeps run without the orchestrator here; `test_serve.py` has them started by it.
"""

import os
import random
import shutil
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import StoreError
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.inbox.folders import rescan_inbox, scan_inbox
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, state_of, write_csv, write_parquet
from tests.support.sweeps import QUICK, events, kinds, left, swept


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Workspace:
    made = shared.prepared(tmp_path / "w")
    (made.root / "settings.toml").write_text(QUICK, encoding="utf-8")
    (made.inbox / NAME).mkdir()
    return made


@pytest.mark.campaign
def test_many_logs_at_once_end_where_they_belong(
    workspace: Workspace, tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    """5 % damaged, 5 % copies under other names; queries answer meanwhile, and a second sweep
    changes nothing."""
    number, box, rng = trials(40, 1000), workspace.inbox / NAME, random.Random(6)
    damaged, copied = (
        set(rng.sample(range(number), number // 20)),
        rng.sample(range(number), number // 20),
    )
    for k in range(number):
        log = write_parquet(box / f"flight{k}.parquet", channels(1000 + k, seconds=6.0))
        if k in damaged:
            log.write_bytes(log.read_bytes()[: rng.randrange(100, log.stat().st_size - 100)])
    for k in copied:
        shutil.copy(box / f"flight{k}.parquet", box / f"again {k}.parquet")
    contents = {path.read_bytes() for path in box.iterdir()}
    answered: list[int] = []
    unanswered: list[Exception] = []
    over = threading.Event()

    def ask() -> None:
        while True:
            last = over.wait(0.2)  # one more query when all is stored
            try:
                with Catalogue.open(workspace.catalogue) as catalogue:
                    answered.append(len(catalogue.flights(NAME)))
            except Exception as error:
                unanswered.append(error)
            if last:
                return

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        document = swept(workspace)
    finally:
        over.set()
        asking.join()
    counts = Counter(entry["kind"] for entry in document["files"])
    bad_copies = sum(k in damaged for k in copied)
    assert counts == Counter(
        stored=number - len(damaged),
        duplicate=len(copied) - bad_copies,
        quarantined=len(damaged) + bad_copies,
    )
    assert sorted(
        entry["file"] for entry in document["files"] if entry["kind"] == "quarantined"
    ) == sorted(
        [f"{NAME}/flight{k}.parquet" for k in damaged]
        + [f"{NAME}/again {k}.parquet" for k in copied if k in damaged]
    )
    assert left(workspace) == []
    assert unanswered == []
    assert answered == sorted(answered)
    assert answered[-1] == number - len(damaged)
    kept = [
        path
        for folder in ("logs", "quarantine")
        for path in (workspace.root / folder).rglob("*")
        if path.is_file()
    ]
    assert {path.read_bytes() for path in kept if path.name != "reason.json"} == contents, (
        "no byte of any log is lost"
    )
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
    before = state_of(workspace.root)
    assert swept(workspace)["files"] == []
    assert state_of(workspace.root) == before


HOSTILE = [
    "a'; DROP TABLE flights;--.csv",
    "<img src=x onerror=alert(1)>.csv",
    "line\nbreak\x1b[31m.csv",
    "-rf.csv",
    "$(touch pwned).csv",
    "a..csv",
    "x" * 240 + ".csv",
    b"not-utf8-\xff\xfe.csv",
    "right‮to‬left.csv",
]


def test_names_are_only_names(workspace: Workspace, logs: list[Path], tmp_path: Path) -> None:
    box, outside = workspace.inbox / NAME, tmp_path / "outside"
    outside.mkdir()
    (outside / "secret.csv").write_bytes(logs[3].read_bytes())
    for k, name in enumerate(HOSTILE):
        write_csv(box / "one.csv", channels(50 + k, seconds=6.0))
        os.rename(box / "one.csv", os.path.join(os.fsencode(box), os.fsencode(name)))
    before = state_of(outside, but=())
    document = swept(workspace)
    assert Counter(kinds(document).values()) == {"stored": len(HOSTILE)}
    assert left(workspace) == []
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert len(catalogue.flights(NAME)) == len(HOSTILE)
        named = {log.name for log in catalogue.logs()}
    assert {
        "a'; DROP TABLE flights;--.csv",
        "line\nbreak\x1b[31m.csv",
        "not-utf8-\\udcff\\udcfe.csv",
    } <= named
    kept = sorted(path.name for path in (workspace.root / "logs").rglob("*") if path.is_file())
    assert all(len(name) == 68 and name.endswith(".csv") for name in kept)
    assert state_of(outside, but=()) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "outside",
        "w",
    ], "nothing beside the workspace came into being"


def test_links_and_pipes_are_put_aside_unopened(
    workspace: Workspace, logs: list[Path], tmp_path: Path
) -> None:
    """A pipe once opened waits for ever, and what a link points at is not ours."""
    outside = tmp_path / "outside"
    outside.mkdir()
    shutil.copy(logs[0], outside / "log.csv")
    box = workspace.inbox / NAME
    (box / "file.csv").symlink_to(outside / "log.csv")
    (box / "folder").symlink_to(outside)
    (box / "nowhere.csv").symlink_to(tmp_path / "absent")
    (workspace.inbox / "whole").symlink_to(outside)
    os.mkfifo(box / "pipe.csv")
    before = state_of(outside, but=())
    document = swept(workspace)
    assert set(kinds(document).values()) == {"quarantined"}
    assert len(document["files"]) == 5
    assert left(workspace) == []
    assert state_of(outside, but=()) == before
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert catalogue.flights(NAME) == ()
    reasons = [path.read_text() for path in (workspace.root / "quarantine").glob("*/reason.json")]
    assert sum("a symbolic link" in text for text in reasons) == 4
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
    assert swept(workspace)["files"] == []


def test_a_file_that_is_still_copied_is_waited_for(workspace: Workspace, logs: list[Path]) -> None:
    """Also one whose writer takes a rest, where the system tells that it has it open; names of
    unfinished files wait, too."""
    box, whole = workspace.inbox / NAME, logs[0].read_bytes()
    for name in (".hidden.csv", "a.csv.part", "b.csv.tmp", "c.csv~"):
        (box / name).write_bytes(whole)
    with (box / "copying.csv").open("wb") as growing:
        growing.write(whole[:5000])
        growing.flush()
        time.sleep(0.3)
        first = swept(workspace)
        assert first["files"] == []
        assert {entry["state"] for entry in first["waiting"]} == {"copying"}
        assert len(first["waiting"]) == 5
        growing.write(whole[5000:])
    assert kinds(swept(workspace)) == {"copying.csv": "stored"}
    assert len(left(workspace)) == 4


def test_a_clock_that_was_set_back_stops_nothing(workspace: Workspace, logs: list[Path]) -> None:
    """The file's times lie in the future then: what stands still for a moment is ready all the
    same."""
    log = workspace.inbox / NAME / "a.csv"
    shutil.copy(logs[0], log)
    os.utime(log, (time.time() + 86_400,) * 2)
    (seen,) = scan_inbox(workspace.inbox, [NAME], 0.2)
    assert seen.state == "copying"
    assert rescan_inbox([seen], 0.2, 0.2)[0].state == "ready"
    log.write_bytes(b"more")
    assert rescan_inbox([seen], 0.2, 0.2)[0].state == "copying", "it changed meanwhile"


def test_what_belongs_to_no_vehicle_waits_and_says_so(
    workspace: Workspace, logs: list[Path]
) -> None:
    (workspace.inbox / "unknown" / "deep").mkdir(parents=True)
    shutil.copy(logs[0], workspace.inbox / "unknown" / "deep" / "a.csv")
    shutil.copy(logs[1], workspace.inbox / "beside.csv")
    document = swept(workspace)
    assert kinds(document) == {"beside.csv": "stored"}, (
        "there is only one vehicle that it can be of"
    )
    (entry,) = document["waiting"]
    assert entry["reason"] == f"unknown vehicle 'unknown': move it to inbox/{NAME}/"
    with Catalogue.open(workspace.catalogue) as catalogue:
        text = catalogue.vehicle(NAME).text.replace(NAME, "unknown")
        catalogue.add_vehicle("unknown", text)
    assert [e["kind"] for e in swept(workspace)["files"]] == ["stored"]


def test_what_lies_too_deep_is_said(workspace: Workspace, logs: list[Path]) -> None:
    folder = workspace.inbox / NAME / Path(*["deep"] * 10)
    folder.mkdir(parents=True)
    shutil.copy(logs[0], folder)
    too_deep = folder / Path(*["deeper"] * 30)
    too_deep.mkdir(parents=True)
    shutil.copy(logs[1], too_deep)
    document = swept(workspace)
    assert [entry["kind"] for entry in document["files"]] == ["stored"]
    assert ["more than 16 folders deep" in entry["reason"] for entry in document["waiting"]] == [
        True
    ]
    assert [path.name for path in workspace.inbox.rglob("*.csv")] == ["flight2.csv"]


def test_a_log_of_another_vehicle_is_quarantined_and_stays_stored(
    workspace: Workspace, logs: list[Path]
) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("other", catalogue.vehicle(NAME).text.replace(NAME, "other"))
    shutil.copy(logs[0], workspace.inbox / NAME / "a.csv")
    swept(workspace)
    (workspace.inbox / "other").mkdir()
    shutil.copy(logs[0], workspace.inbox / "other" / "a.csv")
    (entry,) = swept(workspace)["files"]
    assert (entry["kind"], "already stored for vehicle" in entry["reason"]) == ("quarantined", True)
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [log.status for log in catalogue.logs()] == ["stored"]


def test_one_that_ends_every_process_is_put_aside_and_stops_no_other(
    workspace: Workspace, logs: list[Path]
) -> None:
    """The process is killed, for real, whenever it comes to this file: after two times it is in
    quarantine, unread."""
    box = workspace.inbox / NAME
    (workspace.root / "settings.toml").write_text(
        QUICK.replace("[inbox]", "[inbox]\nattempts = 2"), encoding="utf-8"
    )
    for k, log in enumerate(logs[:2]):
        shutil.copy(log, box / f"{2 * k}.csv")
    shutil.copy(logs[3], box / "1-deadly.csv")
    code = (
        "import os, signal, sys; from pathlib import Path; import aerodb.flows.flight as flight;"
        " from aerodb.flows.run import run_flow;from aerodb.flows.inbox import sweep_flow; from"
        " aerodb.storage.workspace import Workspace;store = flight.store_log;\ndef deadly(log,"
        " **given):\n    if 'deadly' in log: os.kill(os.getpid(), signal.SIGKILL)\n    return"
        " store(log, **given)\nflight.store_log = deadly\nrun_flow(sweep_flow, {},"
        " Workspace.open(Path(sys.argv[1])), 'direct')\n"
    )
    ended = [
        run_forked([str(workspace.root)], environment(), ROOT, code=code).returncode
        for _ in range(3)
    ]
    assert ended == [-signal.SIGKILL] * 2 + [0]
    assert events(workspace, "quarantined") == [f"{NAME}/1-deadly.csv"]
    assert events(workspace, "stored") == [
        f"{NAME}/0.csv",
        f"{NAME}/2.csv",
    ], "each once, none as its own duplicate"
    assert events(workspace, "duplicate") == []
    (reason,) = (workspace.root / "quarantine").glob("*/reason.json")
    assert "tried 2 times" in reason.read_text()
    assert (reason.parent / "log.csv").read_bytes() == logs[3].read_bytes()
    assert left(workspace) == []


#: Replaces a function by one that is killed before or after it has done its work.
KILLED = """
import os, signal, sys
from importlib import import_module
from pathlib import Path
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.run import run_flow
from aerodb.storage.workspace import Workspace
owner, name, when = sys.argv[2:]
owner = Workspace if owner == "Workspace" else import_module(owner)
work = getattr(owner, name)
def killed(*given, **named):
    if when == "after":
        work(*given, **named)
    os.kill(os.getpid(), signal.SIGKILL)
setattr(owner, name, killed)
run_flow(sweep_flow, {}, Workspace.open(Path(sys.argv[1])), "direct")
"""

#: Is killed while it writes a file.
LATE = """
import os, signal, sys
from pathlib import Path
from aerodb.storage.disk_errors import temporary_beside
temporary_beside(Path(sys.argv[1])).write_bytes(b"half")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_kill_at_any_step_of_the_ending_loses_and_doubles_nothing(
    workspace: Workspace, logs: list[Path]
) -> None:
    """kill -9 before and after each step that takes a file out of the inbox; then one sweep, and
    all is as if undisturbed."""
    settings = QUICK.replace("[inbox]", "[inbox]\nattempts = 20")
    (workspace.root / "settings.toml").write_text(settings, encoding="utf-8")
    box = workspace.inbox / NAME
    shutil.copy(logs[0], box / "good.csv")
    (box / "bad.csv").write_text("time,nothing\n0,1\n")
    contents = {path.read_bytes() for path in box.iterdir()}
    for owner, name, when in (
        ("Workspace", "quarantine", "before"),
        ("Workspace", "quarantine", "after"),
        ("aerodb.tasks.steps.inbox", "archive_log", "before"),
        ("aerodb.tasks.steps.inbox", "archive_log", "after"),
    ):
        given = [str(workspace.root), owner, name, when]
        killed = run_forked(given, environment(), ROOT, code=KILLED)
        assert killed.returncode == -signal.SIGKILL, (owner, when, killed.stderr)
    (workspace.root / "results" / "00").mkdir(exist_ok=True)
    path = [str(workspace.root / "results" / "00" / "late.parquet")]
    ended = run_forked(path, environment(), ROOT, code=LATE)  # a worker that outlived its run
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    shutil.copy(logs[1], box / "next.csv")
    contents.add((box / "next.csv").read_bytes())
    assert kinds(swept(workspace)) == {"next.csv": "stored"}
    assert left(workspace) == []
    assert events(workspace, "stored") == [f"{NAME}/good.csv", f"{NAME}/next.csv"]
    assert events(workspace, "duplicate") == []
    kept = [
        path for part in ("logs", "quarantine") for path in (workspace.root / part).rglob("*.csv")
    ]
    assert {path.read_bytes() for path in kept} == contents
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert sorted((log.name, log.status) for log in catalogue.logs()) == [
            ("bad.csv", "quarantined"),
            ("good.csv", "stored"),
            ("next.csv", "stored"),
        ]
        assert verify(workspace, catalogue).problems == []


def test_what_is_not_the_files_fault_is_not_held_against_it(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk, five times: then there is room, and the log is stored as if nothing had been."""
    shutil.copy(logs[0], workspace.inbox / NAME / "a.csv")

    def full(*_: Any, **__: Any) -> Any:
        raise StoreError("the disk is full", "here", "make room")

    with monkeypatch.context() as patched:
        patched.setattr("aerodb.flows.inbox.flight_flow", full)
        for _ in range(5):
            with pytest.raises(StoreError):
                swept(workspace)
    assert kinds(swept(workspace)) == {"a.csv": "stored"}


def test_two_sweeps_at_once_take_each_file_once(workspace: Workspace, logs: list[Path]) -> None:
    for log in logs[:4]:
        shutil.copy(log, workspace.inbox / NAME)
    documents: list[dict[str, Any]] = []
    sweeps = [threading.Thread(target=lambda: documents.append(swept(workspace))) for _ in range(2)]
    for sweep in sweeps:
        sweep.start()
    for sweep in sweeps:
        sweep.join()
    assert (
        sorted(entry["kind"] for document in documents for entry in document["files"])
        == ["stored"] * 4
    )
    assert len(events(workspace, "stored")) == 4
