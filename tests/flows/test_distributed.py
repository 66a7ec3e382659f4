"""Per-flight steps on the workers of a real Dask cluster: the same is stored, and a worker that is
killed costs a retry."""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import AeroError, InputError, StoreBusyError
from aerodb.flows.executors import RunSite, executor_of, run_on_worker
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import Steps, requires, run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import SettingsError
from tests.faults.killing import HARMLESS
from tests.support.clusters import Running, cluster, end, noting, slow
from tests.support.end_to_end import by_commands, same_as_direct
from tests.support.glider_runs import stored, ways
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, state_of

pytest.importorskip("distributed", reason="Dask is not installed (aerodb[dask])")


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with cluster(tmp_path_factory.mktemp("dask")) as running:
        yield running


@pytest.fixture(scope="module")
def direct(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document of the run without the cluster."""
    return shared.updated(tmp_path_factory.mktemp("direct"))


def _made(root: Path, shared: SharedWorkspaces, dask: Running) -> Workspace:
    workspace = shared.prepared(root)
    (root / "settings.toml").write_text(dask.settings(), encoding="utf-8")
    return workspace


@requires("ingest")
def mapped(
    steps: Steps, *, workspace: str, run: str, items: list[Any], **keywords: Any
) -> list[int]:
    """A flow of one step, mapped."""
    return steps.map(noting, items, workspace=workspace, run=run, **keywords)


@requires("ingest")
def slowly(steps: Steps, *, workspace: str, run: str, items: list[float]) -> list[None]:
    """A flow of one step that takes its time."""
    return steps.map(slow, items, workspace=workspace, run=run)


def _begun(workspace: Workspace) -> list[int]:
    return sorted(int(line) for line in (workspace.root / "begun.txt").read_text().split())


@pytest.mark.campaign
def test_from_logs_to_proof_by_commands_all_is_the_same(
    tmp_path: Path,
    logs: list[Path],
    shared: SharedWorkspaces,
    direct: tuple[Workspace, dict[str, Any]],
    dask: Running,
) -> None:
    """Under Prefect, whose ephemeral server the workers need not know."""
    workspace = _made(tmp_path / "w", shared, dask)
    done = by_commands(workspace.root, logs[0].parent, logs[::-1])
    same_as_direct(workspace, done, direct)
    assert {how for flow, how, _ in ways(workspace) if flow != "import_flow"} == {"ephemeral"}
    for folder in ("flights/", "results/"):
        assert _files(workspace, folder) == _files(direct[0], folder)


def test_steps_are_done_by_the_workers_and_in_order(
    tmp_path: Path, shared: SharedWorkspaces, dask: Running
) -> None:
    workspace = _made(tmp_path / "w", shared, dask)
    done_by = run_flow(mapped, {"items": list(range(8))}, workspace, "direct")
    assert set(done_by) <= set(dask.at_work())
    assert os.getpid() not in done_by
    assert _begun(workspace) == list(range(8))


def test_a_worker_that_is_killed_costs_one_step_again(
    tmp_path: Path, shared: SharedWorkspaces, dask: Running
) -> None:
    workspace = _made(tmp_path / "w", shared, dask)
    done_by = run_flow(mapped, {"items": [0, 1, 2, 3], "fatal": 0}, workspace, "direct")
    assert len(done_by) == 4
    assert _begun(workspace) == [0, 0, 1, 2, 3]


@pytest.mark.campaign
def test_a_worker_killed_amid_flights_changes_nothing(
    tmp_path: Path,
    logs: list[Path],
    shared: SharedWorkspaces,
    direct: tuple[Workspace, dict[str, Any]],
    dask: Running,
) -> None:
    """kill -9 as soon as the first flight is stored: the same ids, keys and files as undisturbed,
    and beside them at most what the killed one was writing."""
    workspace = _made(tmp_path / "w", shared, dask)
    with dask.one_killed(
        when=lambda: any((workspace.root / "flights").glob("*/*.parquet"))
    ) as killed:
        outcomes = run_flow(
            flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, workspace, "direct"
        )
    assert killed
    # What was stored when its worker died is found stored by whoever does it again.
    assert {outcome["status"] for outcome in outcomes} <= {"stored", "duplicate"}
    wanted, found = stored(direct[0]), stored(workspace)
    of_flights = {  # without what the update adds
        id: [result for result in results if result[0] != "gram"]
        for id, results in wanted["results"].items()
    }
    assert (found["flights"], found["results"]) == (wanted["flights"], of_flights)
    assert _files(workspace, "flights/") == _files(direct[0], "flights/")
    assert _files(workspace, "results/").items() <= _files(direct[0], "results/").items()
    with Catalogue.open(workspace.catalogue) as catalogue:
        left = {problem.kind for problem in verify(workspace, catalogue).problems}
    assert left <= HARMLESS  # what a writer that is killed leaves beside the files


def _until(condition: Callable[[], bool]) -> bool:
    """Waits until a condition holds; whether it came to hold in five minutes."""
    until = time.monotonic() + 300
    while not condition() and time.monotonic() < until:
        time.sleep(0.02)
    return condition()


def _files(workspace: Workspace, folder: str) -> dict[str, str]:
    return {
        name: sha256 for name, sha256 in state_of(workspace.root).items() if name.startswith(folder)
    }


def test_a_refusal_comes_back_as_it_was_raised(
    tmp_path: Path, shared: SharedWorkspaces, dask: Running
) -> None:
    workspace = _made(tmp_path / "w", shared, dask)
    with pytest.raises(InputError) as caught:
        run_flow(mapped, {"items": [0, 1], "bad": 1}, workspace, "direct")
    assert (caught.value.what, caught.value.where, caught.value.remedy) == (
        "cannot be read",
        "log 1",
        "fly it again",
    )


def test_what_ends_every_worker_is_given_up_by_name(
    tmp_path: Path, shared: SharedWorkspaces, dask: Running
) -> None:
    workspace = _made(tmp_path / "w", shared, dask)
    with pytest.raises(InputError, match="several worker processes ended"):
        run_flow(mapped, {"items": [7], "fatal": 7, "always": True}, workspace, "direct")
    assert _begun(workspace) == [7, 7]


def test_what_is_not_there_is_said_in_seconds(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scheduler that nobody started: the run is noted as failed, nothing is held against the log,
    and here it works."""
    workspace = shared.prepared(tmp_path / "w")
    monkeypatch.setenv("DASK_CONFIG", str(tmp_path))
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        monkeypatch.setenv("SCHEDULER", f"tcp://127.0.0.1:{closed.getsockname()[1]}")
        (workspace.root / "settings.toml").write_text(
            '[work]\nengine = "dask"\naddress = "$SCHEDULER"\n', encoding="utf-8"
        )
        begun = time.monotonic()
        with pytest.raises(StoreBusyError, match="no Dask scheduler answers at tcp://127"):
            run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": NAME}, workspace, "direct")
        assert time.monotonic() - begun < 120.0
    assert ("flight_flow", "direct", "failed") in ways(workspace)
    (workspace.root / "settings.toml").unlink()
    (outcome,) = run_flow(
        flight_flow, {"logs": [str(logs[0])], "vehicle": NAME}, workspace, "direct"
    )
    assert outcome["status"] == "stored"


@pytest.mark.campaign
def test_a_cluster_that_goes_away_is_said_and_the_same_run_works_afterwards(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """First its scheduler (kill -9) amid a step that would take an hour, then its worker before the
    run."""
    with cluster(tmp_path, workers=1) as gone:
        workspace = _made(tmp_path / "w", shared, gone)
        killer = threading.Thread(
            target=lambda: _until((workspace.root / "begun.txt").exists) and end(gone.scheduler)
        )
        killer.start()
        begun = time.monotonic()
        with pytest.raises(StoreBusyError, match="was lost during this step"):
            run_flow(slowly, {"items": [3600.0]}, workspace, "direct")
        assert time.monotonic() - begun < 600.0
        killer.join()
    with cluster(tmp_path, workers=1) as idle:
        (workspace.root / "settings.toml").write_text(idle.settings(), encoding="utf-8")
        end(idle.workers)
        assert _until(lambda: "Remove worker" in idle.log.read_text()), "the scheduler has seen it"
        with pytest.raises(StoreBusyError, match="has no worker"):
            run_flow(mapped, {"items": [1]}, workspace, "direct")
    (workspace.root / "settings.toml").unlink()
    assert run_flow(mapped, {"items": [1]}, workspace, "direct") == [os.getpid()]


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ('engine = "dask"', "requires the address"),
        ('engine = "dask"\naddress = "127.0.0.1:8786"', "as tcp://"),
        ('engine = "dask"\naddress = "tcp://192.0.2.7:8786"', "can run any code on its workers"),
        ('engine = "dask"\naddress = "$NOT_SET"', "NOT_SET does not contain an address"),
        ('engine = "dask"\naddress = "$FAR"', "can run any code on its workers"),
    ],
)
def test_addresses_that_cannot_be_or_must_not_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, section: str, said: str
) -> None:
    monkeypatch.setenv("FAR", "tcp://192.0.2.7:8786")
    monkeypatch.delenv("NOT_SET", raising=False)
    (tmp_path / "settings.toml").write_text(f"[work]\n{section}\n", encoding="utf-8")
    with pytest.raises(SettingsError, match=said):
        executor_of(tmp_path)


def test_a_worker_that_has_not_the_same_in_common_does_nothing(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """Another machine beside a catalogue in a file, another version, a workspace that it does not
    see."""
    workspace = shared.prepared(tmp_path / "w")
    given: dict[str, Any] = {"workspace": str(workspace.root), "run": "r"}
    workspace.lock("run-r").touch()
    site = RunSite.of(given, remote=False)
    assert run_on_worker(site, noting, 1, (), given) == os.getpid()
    wrong = {
        "is not on the run's machine": RunSite("elsewhere", site.code, site.lock, False),
        "another version": RunSite(site.machine, "0.0.1 {}", site.lock, False),
        "does not see the workspace": RunSite(
            "elsewhere", site.code, str(tmp_path / "none" / "locks" / "run-r"), True
        ),
    }
    for said, other in wrong.items():
        with pytest.raises(SettingsError, match=said) as caught:
            run_on_worker(other, noting, 2, (), given)
        assert isinstance(caught.value, AeroError)
        assert caught.value.remedy
    assert _begun(workspace) == [1]
