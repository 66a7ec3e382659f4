"""Machine faults during a per-flight run, a closed loop, an update and a promotion, followed by the
same run again: every log is stored once, verification finds nothing, and all ids, keys, name moves
and files equal those of an undisturbed run.

Faults: the disk is full, a disk error makes it read-only, the clock is set back. Kills are tested
in `test_kill.py`, cut connections in `test_postgresql_workspace.py`, the orchestrator in
`test_serve.py` and `test_serve_faults.py`.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.flows.update import update_flow
from aerodb.storage import encoding
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import LoopSettings
from aerodb.tasks.steps.advance import due
from aerodb.tasks.workspace_access import access_workspace
from tests.support.glider_runs import ingest_and_update, prepared
from tests.support.paths import ROOT
from tests.support.set_clock import Clock, can_be_set
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, write_files

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="mounts and clocks of Linux")

STAGES = {"per_flight", "close_loop", "update", "promotion"}
FAULTS = ["full", "read_only", "set_back"]


@pytest.fixture(scope="module")
def told(
    tmp_path_factory: pytest.TempPathFactory,
    shared: SharedWorkspaces,
) -> list[dict[str, Any]]:
    """What became of each disturbed run."""
    number, folder = 60, tmp_path_factory.mktemp("faults")
    clock = Clock(folder / "clock").environment if can_be_set() else {}
    command = [
        sys.executable,
        "-m",
        "tests.faults.faulting",
        str(shared.undisturbed),
        str(folder),
        "7",
        str(number),
        *FAULTS,
    ]
    given = {
        "capture_output": True,
        "text": True,
        "timeout": 600 + 120 * number,
        "env": {**os.environ, **clock},
    }
    done = subprocess.run(command, cwd=ROOT, **given)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.campaign
@pytest.mark.parametrize("fault", FAULTS)
def test_the_same_run_again_ends_as_if_nothing_had_happened(
    fault: str, told: list[dict[str, Any]]
) -> None:
    mine = [entry for entry in told if entry["fault"] == fault]
    if "cannot" in mine[0]:
        pytest.skip(mine[0]["cannot"])
    counts = Counter(entry["stage"] for entry in mine)
    assert counts.keys() <= STAGES
    assert set(counts.values()) == {max(1, len(mine) // len(STAGES))}
    for entry in mine:
        assert entry["code"] in (0, 1), (
            f"it ended well, or in a sentence that says what to do: {entry}"
        )
        kinds = {kind for kind, *_ in entry["bad"]}
        assert kinds <= ({"not now"} if fault == "read_only" else set()), (
            f"it can be read meanwhile, or it says why not: {entry}"
        )
        assert (entry["again"], entry["wrong"], entry["differs"]) == (0, [], []), entry
    if fault == "set_back":
        assert {entry["code"] for entry in mine} == {0}, "no run needs the clock"


@pytest.mark.parametrize(
    "kept_in", ["sqlite", pytest.param("postgresql", marks=pytest.mark.campaign)], indirect=True
)
def test_a_clock_that_is_set_back_reorders_nothing(
    tmp_path: Path,
    kept_in: str,
    monkeypatch: pytest.MonkeyPatch,
    shared: SharedWorkspaces,
    logs: list[Path],
) -> None:
    """By a day, between two nights: what is due, what failed, lists, names and what was known when
    follow the order of events."""
    loop = LoopSettings(after=2, newest=2, run=("update",), model="m.toml")
    if kept_in == "sqlite":
        workspace, first = shared.updated(tmp_path, flights=3)
    else:
        workspace = prepared(tmp_path, logs[0].parent)
        first = ingest_and_update(workspace, logs[:3])
    _release(workspace, first["candidate"])
    monkeypatch.setattr(encoding, "now", lambda before=encoding.now: before() - timedelta(days=1))
    taken_in = run_flow(
        flight_flow, {"logs": list(map(str, logs[3:5])), "vehicle": NAME}, workspace, "direct"
    )
    new = {outcome["flight"] for outcome in taken_in}
    asked = due(access_workspace(str(workspace.root)), NAME, loop, "update")
    assert (set(asked.flights), asked.new, asked.is_due, asked.baseline) == (
        new,
        2,
        True,
        first["candidate"],
    )
    given = {"vehicle": NAME, "baseline": asked.baseline, "flights": list(asked.flights)}
    with pytest.raises(InputError):
        run_flow(update_flow, {**given, "model": "no model"}, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [run.flow for run in catalogue.unresolved_runs()] == ["update_flow"], (
            "one that ended well came before it"
        )
    second = run_flow(update_flow, {**given, "model": MODEL}, workspace, "direct")
    assert due(access_workspace(str(workspace.root)), NAME, loop, "update").new == 0
    for version in (second["candidate"], first["candidate"]):
        _release(workspace, version)
    _in_order(workspace)


def test_a_last_run_that_names_no_flights_has_used_none(tmp_path: Path) -> None:
    """One that was noted by another version, or by hand: what is due is told all the same."""
    workspace = prepared(tmp_path / "w", write_files(tmp_path / "logs", flights=1)[0].parent)
    with Catalogue.open(workspace.catalogue) as catalogue:
        run = catalogue.start_run("update_flow", how="direct", parameters={"vehicle": NAME})
        catalogue.end_run(run.id, "completed")
    asked = due(
        access_workspace(str(workspace.root)),
        NAME,
        LoopSettings(after=1, run=("update",), model="m.toml"),
        "update",
    )
    assert (asked.new, asked.flights, asked.is_due) == (0, (), False)


def _release(workspace: Workspace, version: str) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        before = catalogue.names(NAME)["released"]
        catalogue.move_name(
            NAME, "released", version, user="a person", reason="flown", expected=before
        )


def _in_order(workspace: Workspace) -> None:
    """The times that are stored are those of the order in which it happened."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert catalogue.unresolved_runs() == ()
        runs = list(reversed(catalogue.runs()))
        history, versions = catalogue.name_history(NAME), catalogue.versions(NAME)
        was = [
            catalogue.version(NAME, "released", as_of=event.at_utc).id
            for event in history
            if event.name == "released"
        ]
    flows = ["import", "flight", "update", "flight", "update", "update"]
    assert [run.flow.removesuffix("_flow") for run in runs] == flows
    assert all(run.ended_utc is not None and run.ended_utc >= run.started_utc for run in runs)
    assert was == [event.version for event in history if event.name == "released"]
    for times in ([run.started_utc for run in runs], [row.created_utc for row in versions]):
        assert times == sorted(set(times))


def test_the_newest_result_of_a_flight_is_the_one_that_was_made_last(
    tmp_path: Path, kept_in: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the clock was set back between the two: what comes after them builds on it."""
    workspace = prepared(tmp_path, write_files(tmp_path / "logs", flights=1)[0].parent)
    (outcome,) = run_flow(
        flight_flow,
        {"logs": [str(tmp_path / "logs/flight1.csv")], "vehicle": NAME},
        workspace,
        "direct",
    )
    monkeypatch.setattr(encoding, "now", lambda before=encoding.now: before() - timedelta(days=1))
    with Catalogue.open(workspace.catalogue) as catalogue:
        given = {
            "step": "ingest",
            "kind": "flight",
            "result_version": 1,
            "flight": outcome["flight"],
        }
        for key in ("f" * 64, "0" * 64):
            catalogue.add_result(key, path=f"results/{key[:2]}/{key}.parquet", **given)
        assert [row.key for row in catalogue.results_of(outcome["flight"], "ingest")][-2:] == [
            "f" * 64,
            "0" * 64,
        ]
