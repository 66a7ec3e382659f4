"""Flows: the same keys whichever way they run, nothing twice, and one bad log stops no other.

A Prefect server is a process of its own here, on a free port with its home in the test's folder; so
is every flow that runs under Prefect, because Prefect reads its settings when it is first imported.
"""

import json
import os
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.flows.prefect_server import place_database, running_server
from aerodb.flows.run import requires
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support import small_glider
from tests.support.command import aerodb
from tests.support.end_to_end import by_commands, environment, prefect_server, same_as_direct
from tests.support.forking import run_forked
from tests.support.glider_runs import stored, ways
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def direct(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document of the run without Prefect."""
    return shared.updated(tmp_path_factory.mktemp("direct"))


@pytest.fixture(scope="module")
def few(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Workspace, dict[str, Any]]:
    """The same with the first three flights."""
    return shared.updated(tmp_path_factory.mktemp("few"), flights=3)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Iterator[str]:
    """Address of a real Prefect server."""
    home = tmp_path_factory.mktemp("server")
    place_database(home / "prefect.db")
    with prefect_server(home) as url:
        yield url


def test_direct_run_finds_what_was_planted_and_records_it(
    direct: tuple[Workspace, dict[str, Any]],
) -> None:
    workspace, document = direct
    found = {
        entry["axis"]: {term["term"]: term for term in entry["terms"]}
        for entry in document["increments"]
    }
    for axis, planted in small_glider.TRUTH.items():
        for name, value in planted.items():
            term = found[axis][name]
            assert abs(term["value"] - value) < 4 * term["standard_error"], (axis, name)
    assert {axis: document["axes"][axis]["outcome"] for axis in ("CX", "CZ")} == {
        "CX": "at noise floor",
        "CZ": "at noise floor",
    }
    assert ways(workspace) == [
        ("flight_flow", "direct", "completed"),
        ("import_flow", "direct", "completed"),
        ("update_flow", "direct", "completed"),
    ]
    kept = stored(workspace)
    steps = {flight: {step for step, _ in results} for flight, results in kept["results"].items()}
    alone = {"ingest", "conditioning", "consistency", "coefficients", "compare"}
    assert steps == dict.fromkeys(steps, alone)
    with Catalogue.open(workspace.catalogue) as catalogue:
        candidate = catalogue.version(NAME, "candidate")
        lineage = catalogue.lineage(candidate.id)
    assert candidate.id == document["candidate"]
    assert sorted(lineage.roles.values()) == ["held_out"] * 2 + ["identified"] * 4
    assert {row.flow for row in lineage.runs} == {"import_flow", "update_flow"}


def test_prefects_ephemeral_mode_stores_the_same(
    tmp_path: Path,
    logs: list[Path],
    shared: SharedWorkspaces,
    few: tuple[Workspace, dict[str, Any]],
) -> None:
    """The logs in another order: side by side they are taken in in any order, and the held-out
    flights must not depend on it."""
    workspace = shared.prepared(tmp_path / "w")
    done = by_commands(workspace.root, logs[0].parent, logs[2::-1])
    same_as_direct(workspace, done, few)
    assert {how for flow, how, _ in ways(workspace) if flow != "import_flow"} == {"ephemeral"}
    assert (workspace.root / "prefect").is_dir()


@pytest.mark.parametrize(
    ("command", "code"),
    [(("close-loop", "--hold-out", "none"), 0), (("recalibrate", "--reason", "no sensors"), 3)],
)
def test_commands_answer_or_refuse_the_same_under_prefect(
    tmp_path: Path, shared: SharedWorkspaces, command: tuple[str, ...], code: int
) -> None:
    answers = []
    for under_prefect, how in ((False, "direct"), (True, "ephemeral")):
        workspace, _ = shared.updated(tmp_path / how, flights=3)
        words = ("--json", *command, "--vehicle", NAME)
        done = aerodb(workspace.root, *words, under_prefect=under_prefect)
        assert done.returncode == code, done.stderr
        flow = command[0].replace("-", "_") + "_flow"
        assert [how for name, how, _ in ways(workspace) if name == flow] == [how]
        answers.append((done.stdout + done.stderr).replace(str(workspace.root), ""))
    assert answers[0] == answers[1]


def test_a_batch_of_which_no_log_is_stored_is_refused(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """Under Prefect, where steps that got no flight once failed as a bug of aerodb."""
    workspace = shared.prepared(tmp_path / "w")
    bad = tmp_path / "bad.csv"
    bad.write_text("no log\n", encoding="utf-8")
    words = ("--json", "flight", "ingest", str(bad), "--vehicle", NAME)
    done = aerodb(workspace.root, *words, under_prefect=True)
    assert done.returncode == 3, done.stderr
    assert [each["status"] for each in json.loads(done.stdout)] == ["refused"]
    assert ways(workspace)[0] == ("flight_flow", "ephemeral", "completed")


def test_a_prefect_server_stores_the_same_and_knows_the_runs(
    tmp_path: Path,
    logs: list[Path],
    shared: SharedWorkspaces,
    few: tuple[Workspace, dict[str, Any]],
    server: str,
) -> None:
    workspace = shared.prepared(tmp_path / "w")
    done = by_commands(workspace.root, logs[0].parent, logs[:3], PREFECT_API_URL=server)
    same_as_direct(workspace, done, few)
    done_by = [(flow, how, state) for flow, how, state in ways(workspace) if flow != "import_flow"]
    assert done_by == [
        ("flight_flow", "server", "completed"),
        ("update_flow", "server", "completed"),
    ]
    assert {"flight-flow", "update-flow"} <= {
        flow["name"] for flow in posted(server, "/flows/filter")
    }


def posted(server: str, path: str, **asked: Any) -> list[dict[str, Any]]:
    """What a Prefect server answers to a filter."""
    headers = {"content-type": "application/json"}
    request = urllib.request.Request(f"{server}{path}", json.dumps(asked).encode(), headers)
    with urllib.request.urlopen(request, timeout=120) as response:
        found: list[dict[str, Any]] = json.load(response)
    return found


def test_a_prefect_server_shows_flights_vehicles_logs_and_what_was_refused(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces, server: str
) -> None:
    workspace = shared.prepared(tmp_path / "w")
    bad = tmp_path / "bad {0}.csv"
    bad.write_text("nonsense")
    arguments = ["--workspace", str(workspace.root), "flight", "ingest", str(logs[0]), str(bad)]
    done = run_forked([*arguments, "--vehicle", NAME], environment(PREFECT_API_URL=server))
    assert done.returncode == 3
    assert "1 of 2 logs stored" in done.stdout
    assert "Finished in state" not in done.stdout + done.stderr
    with Catalogue.open(workspace.catalogue) as catalogue:
        run = catalogue.runs()[0]
    assert (run.flow, run.state) == ("flight_flow", "completed")
    tagged = {"tags": {"all_": [f"run:{run.id}"]}}
    (flow_run,) = posted(server, "/flow_runs/filter", flow_runs=tagged)
    assert flow_run["name"] == f"flight of {NAME}: flight1.csv, bad {{0}}.csv"
    tags = {f"vehicle:{NAME}", "flight:flight1.csv", "flight:bad {0}.csv"}
    assert set(flow_run["tags"]) == tags | {f"run:{run.id}"}
    state = flow_run["state"]
    assert (state["type"], state["name"]) == ("FAILED", "Refused")
    assert state["message"].startswith("bad {0}.csv: refused: ")
    of_run = {"flow_runs": {"id": {"any_": [flow_run["id"]]}}}
    tasks = {task["name"]: task for task in posted(server, "/task_runs/filter", **of_run)}
    assert tasks["ingest.store_log bad {0}.csv"]["state"]["name"] == "Refused"
    assert tasks["ingest.store_log bad {0}.csv"]["run_count"] == 1, "a bad log stays bad"
    compared = tasks["compare.compare_with_version flight1.csv"]
    assert compared["state"]["type"] == "COMPLETED"
    assert set(compared["tags"]) == {f"vehicle:{NAME}", "flight:flight1.csv"}
    said = [
        log["message"]
        for log in posted(server, "/logs/filter", logs={"flow_run_id": {"any_": [flow_run["id"]]}})
    ]
    assert any(line.startswith("bad {0}.csv: refused: ") for line in said)
    assert "flight1.csv: stored" in said
    assert not any(line.startswith("Timeout of") for line in said)


def test_a_server_that_does_not_answer_is_done_without(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from aerodb.flows.prefect_environment import configure_prefect

    for name in [name for name in os.environ if name.startswith("PREFECT_")]:
        monkeypatch.delenv(name)
    before = dict(os.environ)
    with socket.socket() as closed:
        closed.bind(
            ("127.0.0.1", 0)
        )  # bound but not listening: nobody answers, and nobody else takes it
        monkeypatch.setenv("PREFECT_API_URL", f"http://127.0.0.1:{closed.getsockname()[1]}/api")
        try:
            assert configure_prefect(tmp_path) == "ephemeral"
            assert os.environ["PREFECT_API_URL"] == running_server()
            assert os.environ["PREFECT_HOME"] == str(tmp_path / "prefect")
            asked = os.environ["PREFECT_API_AUTH_STRING"]
            for name in ("PREFECT_API_AUTH_STRING", "PREFECT_SERVER_API_AUTH_STRING"):
                del os.environ[name]
            assert configure_prefect(tmp_path) == "ephemeral"
            assert os.environ["PREFECT_API_AUTH_STRING"] == asked, "its server still asks for it"
        finally:
            os.environ.clear()
            os.environ.update(before)


def test_runs_keep_their_records_in_a_folder_of_ones_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """Who uses Prefect otherwise has PREFECT_HOME set: its database was never made there."""
    own = tmp_path / "own"
    monkeypatch.setenv("PREFECT_HOME", str(own))
    workspace = shared.prepared(tmp_path / "w")
    log = str(shared.logs[0])
    ingest = ("flight", "ingest", log, "--vehicle", NAME)
    done = aerodb(workspace.root, *ingest, under_prefect=True)
    assert done.returncode == 0, done.stderr
    assert "1 log stored" in done.stdout
    assert (own / "prefect.db").stat().st_size > 100_000, "its tables are there"
    assert not (workspace.root / "prefect" / "prefect.db").exists()


def test_the_environment_is_prefects_only_while_a_run_lasts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """A notebook starts programs of its own after a run, and the next run has the same server."""
    from aerodb.flows import run

    workspace = shared.prepared(tmp_path / "w")
    monkeypatch.setattr(run, "_under_prefect", lambda *_: dict(os.environ))
    before = dict(os.environ)
    try:
        for name in [name for name in before if name.startswith(("PREFECT_", "PYTHONSAFEPATH"))]:
            del os.environ[name]
        os.environ["PREFECT_API_URL"] = "http://127.0.0.1:9/api"  # where nobody answers
        own = dict(os.environ)
        first = run.run_flow(run_of_nothing, {}, workspace)
        assert dict(os.environ) == own
        assert (first["PYTHONSAFEPATH"], first["PREFECT_API_URL"]) == ("1", running_server())
        assert first["PREFECT_API_AUTH_STRING"] == first["PREFECT_SERVER_API_AUTH_STRING"]
        assert run.run_flow(run_of_nothing, {}, workspace) == first
        assert dict(os.environ) == own
    finally:
        os.environ.clear()
        os.environ.update(before)


@requires("read")
def run_of_nothing(_steps: Any, *, workspace: str, run: str) -> None:
    """Do nothing."""


@pytest.mark.parametrize("command", [["version", "list"], ["flight", "list"], ["vehicle", "list"]])
def test_a_query_imports_no_orchestrator(
    direct: tuple[Workspace, dict[str, Any]], command: list[str]
) -> None:
    code = (
        "import sys; from aerodb.flows.cli.main import app; app(sys.argv[1:],"
        " standalone_mode=False);heavy = {'prefect', 'matplotlib', 'jinja2', 'numba', 'fastapi',"
        " 'pint', 'pandas', 'scipy', 'sqlalchemy.dialects.postgresql'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    arguments = [sys.executable, "-c", code, "--workspace", str(direct[0].root), "--json", *command]
    done = subprocess.run(arguments, env=environment(), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        (
            "aerodb.flows.close_loop, aerodb.flows.flight, aerodb.flows.update",
            {
                "prefect",
                "matplotlib",
                "jinja2",
                "scipy.signal",
                "scipy.stats",
                "sqlalchemy.dialects.postgresql",
            },
        ),
        (
            "aerodb.tasks.steps.log_findings",
            {"numba", "scipy.interpolate", "scipy.optimize", "scipy.signal", "scipy.stats"},
        ),
        ("aerodb.tasks.steps.inspect_log, aerodb.logs.mapping_draft", {"numba", "scipy"}),
        ("aerodb.tasks.workers.beginning", {"numpy", "pydantic", "aerodb.errors"}),
    ],
)
def test_what_draws_filters_or_compiles_nothing_does_not_import_what_does(
    modules: str, heavy: set[str]
) -> None:
    code = (
        f"import sys, {modules}; heavy = {heavy!r} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
