"""Faults in the inbox: a fault of space, time, settings or disk does not count against a log, and a
bad log does not stop others."""

import os
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError, StoreError
from aerodb.flows.flight import flight_flow
from aerodb.flows.nightly import nightly_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.disk_errors import GROWTH
from aerodb.storage.inbox.folders import move_into_inbox
from aerodb.storage.inbox.quarantined import newest_quarantined, return_to_inbox
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.ingest import store_log
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, channels, write_csv
from tests.support.sweeps import QUICK, events, kinds, left, swept


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Workspace:
    made = shared.prepared(tmp_path / "w")
    (made.root / "settings.toml").write_text(QUICK, encoding="utf-8")
    (made.inbox / NAME).mkdir()
    return made


def _disturbed(monkeypatch: pytest.MonkeyPatch, disturb: Callable[[str], None]) -> None:
    """Has `disturb` called with the path of each log before it is stored."""

    def store(log: str, **given: Any) -> dict[str, Any]:
        disturb(log)
        return store_log(log, **given)

    monkeypatch.setattr("aerodb.flows.flight.store_log", store)


def test_a_log_without_room_waits_and_the_others_are_stored(
    workspace: Workspace, logs: list[Path]
) -> None:
    """The reserve is such that the small ones fit and the large one does not."""
    box = workspace.inbox / NAME
    for k, log in enumerate(logs[:2]):
        shutil.copy(log, box / f"{k}.csv")
    large = write_csv(box / "large.csv", channels(77, seconds=60.0))
    smallest = max(path.stat().st_size for path in box.iterdir() if path != large)
    free = shutil.disk_usage(workspace.root).free
    between = GROWTH * (smallest + large.stat().st_size) / 2
    settings = workspace.root / "settings.toml"
    with pytest.MonkeyPatch.context() as patched:
        # The disk of this machine changes under the test: what is free is held still, the rest is
        # as in use.
        patched.setattr(
            "aerodb.storage.disk_errors.shutil.disk_usage",
            lambda _: shutil._ntuple_diskusage(free, 0, free),
        )  # type: ignore[attr-defined]
        settings.write_text(f"{QUICK}[limits]\nreserve = {int(free - between)}\n", encoding="utf-8")
        document = swept(workspace)
        assert kinds(document) == {"0.csv": "stored", "1.csv": "stored", "large.csv": "no_room"}
        (reason,) = [entry["reason"] for entry in document["files"] if entry["kind"] == "no_room"]
        assert "MB are free, this log needs about" in reason
        for _ in range(4):
            with pytest.raises(StoreError, match="MB are free"):
                swept(workspace)
    assert left(workspace) == [f"{NAME}/large.csv"]
    settings.write_text(QUICK, encoding="utf-8")
    assert kinds(swept(workspace)) == {"large.csv": "stored"}, "no try was held against it"


def test_a_log_without_room_keeps_no_database_from_going_on(
    workspace: Workspace, logs: list[Path]
) -> None:
    """The night takes the database further all the same, and says at its end that a log waits."""
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs[:3]], "vehicle": NAME}, workspace, "direct"
    )
    loop = '[loop]\nafter = 3\nrun = ["update"]\nmodel = "increments.toml"\n'
    settings = (
        QUICK.replace("[loop]\nrun = []\n", "")
        + loop
        + "[limits]\nreserve = 1_000_000_000_000_000_000\n"
    )
    (workspace.root / "settings.toml").write_text(settings, encoding="utf-8")
    (workspace.root / "increments.toml").write_text(MODEL, encoding="utf-8")
    shutil.copy(logs[3], workspace.inbox / NAME)
    with pytest.raises(StoreError, match="MB are free"):
        run_flow(nightly_flow, {}, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [row.label for row in catalogue.versions(NAME)] == ["v0001", "v0002"]
    assert left(workspace) == [f"{NAME}/flight4.csv"]


def test_a_log_that_is_too_large_is_refused_by_its_size_and_not_read(
    workspace: Workspace, logs: list[Path]
) -> None:
    """Terabytes of nothing, of which a hash would take hours; it can come back when the limit is
    another."""
    sparse = workspace.inbox / NAME / "sparse.ulg"
    sparse.touch()
    try:
        os.truncate(sparse, 8 << 40)
    except OSError:
        pytest.skip("this file system takes no sparse file of 8 TB")
    shutil.copy(logs[0], workspace.inbox / NAME)
    begun = time.monotonic()
    document = swept(workspace)
    assert time.monotonic() - begun < 600.0
    assert kinds(document) == {"sparse.ulg": "quarantined", "flight1.csv": "stored"}
    (entry,) = newest_quarantined(workspace)
    assert "its size is 8796093 MB, the limit is 20000 MB" in entry.reason
    assert (entry.can_return, entry.file.stat().st_size) == (True, 8 << 40)
    (workspace.root / "far.ulg").touch()
    os.truncate(workspace.root / "far.ulg", 8 << 40)
    outcome = store_log(
        str(workspace.root / "far.ulg"), workspace=str(workspace.root), run="r", vehicle=NAME
    )
    assert (outcome["status"], outcome["sha256"]) == ("refused", "")
    assert "the limit is 20000 MB" in outcome["what"]


@pytest.mark.parametrize("what", ["file", "folder"])
def test_a_link_put_in_a_logs_place_after_the_look_is_not_followed(
    workspace: Workspace,
    logs: list[Path],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    what: str,
) -> None:
    """Whoever may write to the inbox once had any file read, and what could not be read copied into
    the quarantine."""
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "flight1.csv").write_text("password: sesame\n")
    folder = workspace.inbox / NAME / "day"
    folder.mkdir()
    log = folder / "flight1.csv"
    shutil.copy(logs[0], log)

    def swap(_: str) -> None:
        if not folder.is_symlink() and not log.is_symlink():
            shutil.rmtree(folder) if what == "folder" else log.unlink()
            folder.symlink_to(secret) if what == "folder" else log.symlink_to(
                secret / "flight1.csv"
            )

    _disturbed(monkeypatch, swap)
    swept(workspace)
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert catalogue.flights(NAME) == ()
        assert catalogue.logs() == ()
    held = [
        path
        for path in workspace.root.rglob("*")
        if path.is_file() and not path.is_symlink() and path.stat().st_size < 1e6
    ]
    assert not [
        path
        for path in held
        if b"sesame" in path.read_bytes() and workspace.inbox not in path.parents
    ]
    assert (secret / "flight1.csv").read_text() == "password: sesame\n"
    monkeypatch.undo()
    assert "sesame" not in str(swept(workspace))


def test_a_step_that_takes_too_long_is_held_against_its_file_alone(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The orchestrator's own error, as its tasks raise it."""
    from prefect.task_engine import TaskRunTimeoutError

    for name, log in zip(("0.csv", "slow.csv", "2.csv"), logs, strict=False):
        shutil.copy(log, workspace.inbox / NAME / name)

    def slow(log: str) -> None:
        if "slow" in log:
            raise TaskRunTimeoutError("Scope timed out after 7200.0 second(s).")

    _disturbed(monkeypatch, slow)
    assert kinds(swept(workspace)) == {"0.csv": "stored", "slow.csv": "failed", "2.csv": "stored"}
    assert [kinds(swept(workspace)) for _ in range(3)] == [
        {"slow.csv": k} for k in ("failed", "failed", "quarantined")
    ]
    (reason,) = (workspace.root / "quarantine").glob("*/reason.json")
    assert "tried 3 times: TaskRunTimeoutError: Scope timed out" in reason.read_text()


def test_settings_that_are_half_written_are_held_against_no_log(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody saves settings.toml while a log is read, five times over: then it is whole, and all
    are stored."""
    for log in logs[:2]:
        shutil.copy(log, workspace.inbox / NAME)
    settings = workspace.root / "settings.toml"

    def half_written(_: str) -> None:
        settings.write_text("[inbox]\nsettle = ", encoding="utf-8")

    with monkeypatch.context() as patched:
        _disturbed(patched, half_written)
        for _ in range(5):
            settings.write_text(QUICK, encoding="utf-8")
            with pytest.raises(InputError, match="not valid TOML"):
                swept(workspace)
    assert len(left(workspace)) == 2
    settings.write_text(QUICK, encoding="utf-8")
    assert set(kinds(swept(workspace)).values()) == {"stored"}


def test_a_mapping_with_a_fault_is_held_against_no_log_and_stops_no_other_vehicle(
    workspace: Workspace, logs: list[Path]
) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("another", catalogue.vehicle(NAME).text.replace(NAME, "another"))
    (workspace.inbox / "another").mkdir()
    shutil.copy(logs[0], workspace.inbox / "another" / "a.csv")
    shutil.copy(logs[1], workspace.inbox / NAME / "b.csv")
    mapping = workspace.root / "odd.toml"
    mapping.write_text("name = ", encoding="utf-8")
    settings = f'{QUICK}[vehicles.another]\nmapping = "{mapping}"\n'
    (workspace.root / "settings.toml").write_text(settings, encoding="utf-8")
    for _ in range(4):
        with pytest.raises(InputError, match=r"odd\.toml"):
            swept(workspace)
    assert events(workspace, "stored") == [f"{NAME}/b.csv"]
    assert left(workspace) == ["another/a.csv"]
    (workspace.root / "settings.toml").write_text(QUICK, encoding="utf-8")
    assert [entry["kind"] for entry in swept(workspace)["files"]] == ["stored"]


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[Path]:
    """A folder on another file system than the tests' own."""
    memory = Path("/dev/shm")
    if not memory.is_dir() or memory.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("there is no second file system here")
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        yield Path(folder)


def test_an_inbox_on_another_file_system(
    workspace: Workspace, logs: list[Path], elsewhere: Path
) -> None:
    """Links and pipes are put aside, logs kept, and what is taken back out of quarantine takes
    nobody's place."""
    shutil.rmtree(workspace.inbox)
    workspace.inbox.symlink_to(elsewhere)
    box = workspace.inbox / NAME
    box.mkdir()
    (box / "link.csv").symlink_to(logs[0])
    (box / "nowhere.csv").symlink_to("absent")
    os.mkfifo(box / "pipe.csv")
    (box / "bad.csv").write_text("time,nothing\n0,1\n")
    shutil.copy(logs[1], box / "good.csv")
    assert Counter(kinds(swept(workspace)).values()) == {"quarantined": 4, "stored": 1}
    assert left(workspace) == []
    aside = [folder / "aside" for folder in (workspace.root / "quarantine").iterdir()]
    links = [path for path in aside if path.is_symlink()]
    assert sorted(os.readlink(path) for path in links) == sorted(["absent", str(logs[0])])
    (entry,) = [entry for entry in newest_quarantined(workspace) if entry.can_return]
    assert return_to_inbox(workspace, entry, NAME).read_text() == "time,nothing\n0,1\n"
    assert left(workspace) == [f"{NAME}/bad.csv"]
    assert not entry.file.parent.exists()


def test_what_comes_back_takes_nobodys_place(workspace: Workspace) -> None:
    """Another log of the same name, and one that comes between the look and the move."""
    box = workspace.inbox / NAME
    (box / "bad.csv").write_text("time,nothing\n0,1\n")
    swept(workspace)
    (entry,) = newest_quarantined(workspace)
    (box / "bad.csv").write_text("another")
    (box / f"{entry.key[:12]}-1-bad.csv").write_text("and another")
    with pytest.raises(FileExistsError):
        move_into_inbox(entry.file, box / "bad.csv")
    assert return_to_inbox(workspace, entry, NAME).read_text() == "time,nothing\n0,1\n"
    assert sorted(path.read_text() for path in box.iterdir()) == [
        "and another",
        "another",
        "time,nothing\n0,1\n",
    ]
