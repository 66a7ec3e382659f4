"""``aerodb nightly``, ``status`` and ``retry`` as people call them: what waits, failed and why, and
that trying again works."""

import hashlib
import shutil
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.errors import GateRefusal
from aerodb.flows.cli.main import app
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.release import promote
from aerodb.tasks.workspace_access import access_workspace
from tests.support.command import asked, document
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, VEHICLE

SETTINGS = '[inbox]\nsettle = "0.1 s"\n[loop]\nrun = []\n'


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Workspace:
    made = shared.prepared(tmp_path / "w")
    (made.root / "settings.toml").write_text(SETTINGS, encoding="utf-8")
    (made.inbox / NAME).mkdir()
    return made


def _called(workspace: Workspace, *arguments: str) -> tuple[int, Any]:
    """Exit code and document of a command that may refuse."""
    done = CliRunner().invoke(app, ["--workspace", str(workspace.root), "--json", *arguments])
    return done.exit_code, document(done.stdout)


def test_nothing_to_say_of_a_quiet_workspace(workspace: Workspace) -> None:
    said = asked(workspace.root, "status")
    assert (said["waiting"], said["running"], said["failed"], said["todo"]) == ([], [], [], [])
    assert said["serve"] == {"running": False, "schedule": "cron 0 2 * * * (UTC)"}
    assert said["quarantined"] == {"count": 0, "newest": []}
    assert said["vehicles"] == [
        {"vehicle": NAME, "released": "v0001", "candidate": None, "loops": [], "rejected": []}
    ]


def test_what_waits_is_said_with_what_to_do(workspace: Workspace, logs: list[Path]) -> None:
    shutil.copy(logs[0], workspace.inbox / NAME / "b.csv.part")
    (workspace.inbox / "nobody").mkdir()
    shutil.copy(logs[1], workspace.inbox / "nobody")
    said = asked(workspace.root, "status")
    states = {entry["file"]: (entry["state"], entry["reason"]) for entry in said["waiting"]}
    assert states[f"{NAME}/b.csv.part"] == ("copying", "its name marks it as unfinished")
    assert states["nobody/flight2.csv"] == (
        "blocked",
        f"unknown vehicle 'nobody': move it to inbox/{NAME}/",
    )
    assert said["todo"] == [
        f"nobody/flight2.csv: unknown vehicle 'nobody': move it to inbox/{NAME}/"
    ]
    night = asked(workspace.root, "nightly", "--direct")
    assert (night["files"], len(night["waiting"])) == ([], 2)


def test_a_log_that_was_refused_is_stored_once_its_cause_is_mended(
    workspace: Workspace, logs: list[Path]
) -> None:
    """Its fields are called otherwise: no mapping fits. With one in the settings, retrying it is
    all that is needed."""
    text = (
        logs[0]
        .read_text()
        .replace("alpha [rad]", "AOA [rad]", 1)
        .replace("qbar [Pa]", "QQ [Pa]", 1)
    )
    text = text.replace("time [s]", "clock [s]", 1)
    (workspace.inbox / NAME / "odd.csv").write_text(text)
    night = asked(workspace.root, "nightly", "--direct")
    assert [entry["kind"] for entry in night["files"]] == ["quarantined"]
    said = asked(workspace.root, "status")
    (entry,) = said["quarantined"]["newest"]
    assert (entry["name"], entry["vehicle"]) == ("odd.csv", NAME)
    assert "no mapping fits" in entry["reason"]
    assert "1 logs are in quarantine" in said["todo"][0]
    code, again = _called(workspace, "retry", "odd.csv", "--direct")
    assert (code, [e["outcome"] for e in again]) == (3, ["quarantined"]), "nothing is mended yet"
    mapping = _mapping(workspace)
    (workspace.root / "settings.toml").write_text(
        f'{SETTINGS}[vehicles.{NAME}]\nmapping = "{mapping}"\n', encoding="utf-8"
    )
    code, again = _called(workspace, "retry", entry["key"][:12], "--direct")
    assert (code, [e["outcome"] for e in again]) == (0, ["stored"])
    assert asked(workspace.root, "status")["quarantined"]["count"] == 0
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [(log.name, log.status) for log in catalogue.logs()] == [("odd.csv", "stored")]
        assert len(catalogue.flights(NAME)) == 1
    kept = (workspace.root / "logs").rglob("*.csv")
    assert [path.read_text() for path in kept] == [text]


def _mapping(workspace: Workspace) -> Path:
    from importlib.resources import files

    text = (files("aerodb.storage.mappings") / "canonical.toml").read_text(encoding="utf-8")
    renamed = text.replace('field = "alpha"', 'field = "AOA"').replace(
        'field = "qbar"', 'field = "QQ"'
    )
    renamed = renamed.replace('name = "canonical"', 'name = "odd"').replace('"time"', '"clock"')
    path = workspace.root.parent / "odd.toml"
    path.write_text(renamed, encoding="utf-8")
    assert renamed != text
    return path


def test_a_run_that_failed_is_listed_until_it_is_made_good(
    workspace: Workspace, logs: list[Path]
) -> None:
    """The database file was away; with it back, retrying the run does what it should have done."""
    file = workspace.root.parent / "second.toml"
    parameters = {"file": str(file), "vehicle": NAME, "bindings": {}}
    from aerodb.flows.importing import import_flow

    with pytest.raises(FileNotFoundError):
        run_flow(import_flow, parameters, workspace, "direct")
    said = asked(workspace.root, "status")
    (failed,) = said["failed"]
    assert (failed["flow"], failed["state"]) == ("import_flow", "failed")
    assert "No such file" in failed["error"]
    assert f"aerodb retry {failed['run'][:12]}" in said["todo"][0]
    code, again = _called(workspace, "retry", failed["run"][:12], "--direct")
    assert (code, again[0]["outcome"]) == (1, "failed")
    text = (logs[0].parent / "database.toml").read_text()
    file.write_text(text.replace('name = "handbook"', 'name = "second"'), encoding="utf-8")
    code, again = _called(workspace, "retry", "all", "--direct")
    assert {entry["outcome"] for entry in again if entry["kind"] == "run"} == {"completed"}
    assert (code, asked(workspace.root, "status")["failed"]) == (0, [])
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [row.label for row in catalogue.versions(NAME)] == ["v0001", "v0002"]


def test_what_was_made_good_hides_no_other_failure_and_a_month_is_enough(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One failure, then sixty of another flow that a later run has made good: they once filled the
    list of fifty."""
    with Catalogue.open(workspace.catalogue) as catalogue:

        def ended(flow: str, state: Any) -> str:
            run = catalogue.start_run(flow, how="direct", parameters={"vehicle": NAME}).id
            catalogue.end_run(run, state, error="" if state == "completed" else "no")
            return run

        first = ended("update_flow", "failed")
        for _ in range(60):
            ended("close_loop_flow", "failed")
        ended("close_loop_flow", "completed")
        assert [run.id for run in catalogue.unresolved_runs()] == [first]
        last = [ended("import_flow", "failed") for _ in range(3)]
        assert [run.id for run in catalogue.unresolved_runs(2)] == last[:0:-1]
        monkeypatch.setattr("aerodb.storage.catalogue.run_queries._MAXIMUM_AGE", timedelta(0))
        assert catalogue.unresolved_runs() == ()


def test_retrying_all_leaves_out_what_cannot_go_back_yet(
    workspace: Workspace, logs: list[Path]
) -> None:
    """A log of whom nobody knows who flew it, in a workspace with two vehicles, once stopped it
    all."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("other-glider", VEHICLE.replace(NAME, "other-glider"))
    for log, vehicle in ((logs[0], ""), (logs[1], NAME)):
        workspace.quarantine(
            log, hashlib.sha256(log.read_bytes()).hexdigest(), "wrong mapping", vehicle
        )
    code, done = _called(workspace, "retry", "all", "--direct")
    assert code == 3
    assert {entry["what"]: entry["outcome"] for entry in done} == {
        "flight1.csv": "quarantined",
        f"{NAME}/flight2.csv": "stored",
    }
    assert (
        f"--vehicle {NAME} or other-glider" in done[0]["reason"]
        or f"--vehicle other-glider or {NAME}" in done[0]["reason"]
    )
    assert asked(workspace.root, "status")["quarantined"]["count"] == 1
    code, done = _called(workspace, "retry", "flight1.csv", "--direct", "--vehicle", NAME)
    assert (code, [entry["outcome"] for entry in done]) == (0, ["stored"])


def test_a_run_that_lost_its_process_counts_as_failed(workspace: Workspace) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        run = catalogue.start_run("nightly_flow", how="server", parameters={"vehicle": None}).id
    said = asked(workspace.root, "status")
    assert [(entry["run"], entry["error"]) for entry in said["failed"]] == [
        (run, "its process ended without a message")
    ]
    assert said["running"] == []
    night = asked(workspace.root, "nightly", "--direct")
    assert [entry["run"] for entry in night["crashed"]] == [run]
    assert asked(workspace.root, "status")["failed"] == [], "the night has made it good"
    with Catalogue.open(workspace.catalogue) as catalogue:
        run = catalogue.start_run("nightly_flow", how="server", parameters={}).id
    assert [entry["run"] for entry in asked(workspace.root, "status")["failed"]] == [run]
    code, done = _called(workspace, "retry", run[:12], "--direct")
    assert (code, [(entry["what"], entry["kind"]) for entry in done]) == (0, [(run, "run")])
    assert asked(workspace.root, "status")["failed"] == []


def test_a_disk_without_room_is_something_to_do(workspace: Workspace) -> None:
    settings = workspace.root / "settings.toml"
    written = settings.read_text(encoding="utf-8") if settings.exists() else ""
    settings.write_text(f"{written}[limits]\nreserve = {10**15}\n", encoding="utf-8")
    (said,) = [item for item in asked(workspace.root, "status")["todo"] if "disk" in item]
    assert "MB are left, and no log is ingested below 1000000000 MB" in said


def test_what_a_flight_lacks_is_made_again(workspace: Workspace, logs: list[Path]) -> None:
    """A result's file is lost: the flight's steps find it so, and make it as it was."""
    shutil.copy(logs[0], workspace.inbox / NAME)
    asked(workspace.root, "nightly", "--direct")
    (flight,) = asked(workspace.root, "flight", "list")
    with Catalogue.open(workspace.catalogue) as catalogue:
        steps = ("consistency", "coefficients", "compare")
        paths = [row.path for step in steps for row in catalogue.results_of(flight["flight"], step)]
    before = {path: (workspace.root / path).read_bytes() for path in paths}
    assert len(before) == 3
    for path in before:
        (workspace.root / path).unlink()
    code, again = _called(workspace, "retry", flight["flight"][:12], "--direct")
    assert (code, again[0]["outcome"]) == (0, "completed")
    assert {path: (workspace.root / path).read_bytes() for path in paths} == before


def test_what_is_nothing_is_said(workspace: Workspace) -> None:
    done = CliRunner().invoke(app, ["--workspace", str(workspace.root), "retry", "zzzz"])
    assert "neither a log in quarantine, nor a failed run, nor a flight" in str(done.exception)
    assert asked(workspace.root, "retry", "all", "--direct") == []


def test_settings_with_a_fault_are_said_and_stop_the_night(workspace: Workspace) -> None:
    (workspace.root / "settings.toml").write_text("[inbox]\nsetle = 3\n", encoding="utf-8")
    said = asked(workspace.root, "status")
    assert "unknown key 'inbox.setle'" in said["settings"]
    assert said["todo"][0].startswith("fix the settings")
    done = CliRunner().invoke(app, ["--workspace", str(workspace.root), "nightly", "--direct"])
    assert "did you mean 'settle'?" in str(done.exception)


def test_the_gate_asks_for_the_flights_that_the_settings_ask_for(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace, document = shared.updated(tmp_path / "w")
    candidate = document["candidate"]
    path = workspace.root / "settings.toml"
    path.write_text(
        f"{SETTINGS}[vehicles.{NAME}.gate]\nidentified = 5\nheld_out = 2\n", encoding="utf-8"
    )
    where = {"workspace": str(workspace.root), "run": "", "name": "released", "reason": "proved"}
    with pytest.raises(GateRefusal, match="4 flights identified, the settings require 5"):
        promote(candidate, **where)
    path.write_text(
        f"{SETTINGS}[vehicles.{NAME}.gate]\nidentified = 4\nheld_out = 2\n", encoding="utf-8"
    )
    done = promote(candidate, **where)
    assert (done["moved"], done["checks"][-1]) == (True, "as many flights as the settings require")


def test_accuracy_limits_of_the_settings_reach_the_verdict_and_belong_to_the_key(
    workspace: Workspace, logs: list[Path]
) -> None:
    """They stand in place of the vehicle file's; a verdict under others is another result, and the
    first one comes back."""
    shutil.copy(logs[0], workspace.inbox / NAME)
    (entry,) = asked(workspace.root, "nightly", "--direct")["files"]
    path, keys = workspace.root / "settings.toml", []
    access = access_workspace(str(workspace.root))
    default = access.vehicle(NAME)[0].accuracy
    for more in ("", f'[vehicles.{NAME}.accuracy]\nattitude = "1 deg"\n', ""):
        path.write_text(SETTINGS + more, encoding="utf-8")
        asked(workspace.root, "retry", entry["flight"][:12], "--direct")
        keys.append(
            {row.key for row in access.catalogue.results_of(entry["flight"], "consistency")}
        )
        limits = access.vehicle(NAME)[0].accuracy
        assert limits.attitude == pytest.approx(np.deg2rad(1.0) if more else default.attitude)
        assert limits.flow_angle == default.flow_angle
    assert [len(each) for each in keys] == [1, 2, 2]
    path.write_text(SETTINGS + f'[vehicles.{NAME}.accuracy]\nattitude = "300 deg"\n', "utf-8")
    again = asked(workspace.root, "flight", "ingest", str(logs[0]), "--vehicle", NAME, "--direct")
    assert "attitude 1e+03 times" in again[0]["consistency"]["reasons"][-1]
