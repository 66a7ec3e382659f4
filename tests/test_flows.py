"""Flows: the same keys whichever way they run, nothing twice, and one bad log stops no other.

A Prefect server is a process of its own here, on a free port with its home in the test's folder; so is every flow that
runs under Prefect, because Prefect reads its settings when it is first imported.
"""

import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from aerodb.errors import InputError
from flows.flight import flight_flow
from flows.importing import import_flow
from flows.run import run_flow
from flows.update import update_flow
from storage.catalogue import Catalogue
from storage.workspace import Workspace
from tests import small_glider
from tests.small_glider import MODEL, NAME, state_of, write_files

#: Both commands in one process, so that Prefect's own start is paid once.
BOTH = """
import sys
from flows.cli.main import app
first, second = sys.argv[1:].index("--then"), sys.argv[1:]
for command in (second[:first], second[first + 1:]):
    assert not app(command, standalone_mode=False)
"""
#: Rows that any second run may add: that it ran, and what it used.
OF_RUNS = {"runs", "run_results", "run_versions"}


def _environment(**more: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT_", "AERODB_"))}
    return {**kept, "PYTHONPATH": str(Path(__file__).resolve().parents[1]), "PYTHONUTF8": "1", **more}


def _both(root: Path, folder: Path, logs: list[Path], *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Ingests and updates in one process of its own; a workspace with vehicle and database must be there."""
    common = ["--workspace", str(root), "--json"]
    ingest = [*common, "flight", "ingest", *map(str, logs), "--vehicle", NAME, *options]
    update = [*common, "update", "--vehicle", NAME, "--model", str(folder / "model.toml"), *options]
    command = [sys.executable, "-c", BOTH, *ingest, "--then", *update]
    return subprocess.run(command, env=_environment(**environment), capture_output=True, text=True, timeout=120)


def _prepared(root: Path, folder: Path) -> Workspace:
    """A workspace with the vehicle and its handbook database, made without the orchestrator."""
    workspace = Workspace.open(root)
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, small_glider.VEHICLE)
    run_flow(import_flow, {"file": str(folder / "database.toml"), "vehicle": NAME, "bindings": {}}, workspace, "direct")
    return workspace


def _stored(workspace: Workspace) -> dict[str, Any]:
    """Everything that a second way must store under the same names, read from the catalogue itself."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        flights = [row.id for row in catalogue.flights(NAME)]
        results = {flight: sorted((r.step, r.key) for r in catalogue.results_of(flight)) for flight in flights}
        versions = [(row.label, row.id, row.content_sha256) for row in catalogue.versions(NAME)]
        roles = {id: sorted((use.flight, use.role) for use in catalogue.version_flights(id)) for _, id, _ in versions}
        return {"flights": sorted(flights), "results": results, "versions": versions, "roles": roles}


def _ways(workspace: Workspace) -> list[tuple[str, str, str]]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return sorted((row.flow, row.how, row.state) for row in catalogue.runs())


def _rows(workspace: Workspace) -> dict[str, int]:
    engine = sa.create_engine(f"sqlite:///{workspace.catalogue}")
    with engine.connect() as connection:
        tables = [name for name in sa.inspect(connection).get_table_names() if name not in OF_RUNS]
        counts = {name: connection.execute(sa.text(f'SELECT count(*) FROM "{name}"')).scalar() for name in tables}
    engine.dispose()
    return {name: int(count or 0) for name, count in counts.items()}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_files(tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def direct(tmp_path_factory: pytest.TempPathFactory, logs: list[Path]) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document of the run without Prefect, in this process."""
    workspace = _prepared(tmp_path_factory.mktemp("direct"), logs[0].parent)
    return workspace, _ingest_and_update(workspace, logs)


def _ingest_and_update(workspace: Workspace, logs: list[Path]) -> dict[str, Any]:
    parameters: dict[str, Any] = {"logs": [str(log) for log in logs], "vehicle": NAME}
    outcomes = run_flow(flight_flow, parameters, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        baseline = catalogue.version(NAME, "released").id
    flights = [outcome["flight"] for outcome in outcomes if outcome["flight"]]
    update = {"vehicle": NAME, "baseline": baseline, "flights": flights, "model": MODEL}
    document: dict[str, Any] = run_flow(update_flow, update, workspace, "direct")
    return document


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a real Prefect server; its process is ended whatever happens."""
    home = tmp_path_factory.mktemp("server")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"http://127.0.0.1:{port}/api"
    settings = {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": url,
        "DO_NOT_TRACK": "1",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    }
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port), "--no-ui"]
    with (home / "log.txt").open("wb") as log:
        process = subprocess.Popen(command, env=_environment(**settings), stdout=log, stderr=log, start_new_session=True)
    try:
        _wait_for(lambda: _answers(f"{url}/health"), process, home / "log.txt")
        yield url
    finally:
        process.terminate()
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # its own session: the workers that it started go with it
            process.wait(timeout=20)


def _wait_for(ready: Callable[[], bool], process: "subprocess.Popen[bytes]", log: Path) -> None:
    until = time.monotonic() + 90
    while not ready():
        if process.poll() is not None or time.monotonic() > until:
            pytest.fail(f"the Prefect server did not start:\n{log.read_text(errors='replace')[-2000:]}")
        time.sleep(0.3)


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2) as response:
            return bool(response.status == 200)
    except OSError:
        return False


def _same_as_direct(
    workspace: Workspace, done: subprocess.CompletedProcess[str], direct: tuple[Workspace, dict[str, Any]]
) -> None:
    assert done.returncode == 0, done.stderr
    assert _stored(workspace) == _stored(direct[0])
    first = json.JSONDecoder().raw_decode(done.stdout)
    document = json.loads(done.stdout[first[1] :])
    assert document["candidate"] == direct[1]["candidate"]
    assert [entry["terms"] for entry in document["increments"]] == [entry["terms"] for entry in direct[1]["increments"]]
    assert "prefect" not in (done.stdout + done.stderr).lower().replace(str(workspace.root).lower(), "")
    assert "INFO" not in done.stderr


def test_direct_run_finds_what_was_planted_and_records_it(direct: tuple[Workspace, dict[str, Any]]) -> None:
    workspace, document = direct
    found = {entry["axis"]: {term["term"]: term for term in entry["terms"]} for entry in document["increments"]}
    for axis, planted in small_glider.TRUTH.items():
        for name, value in planted.items():
            term = found[axis][name]
            assert abs(term["value"] - value) < 4 * term["standard_error"], (axis, name)
    assert {axis: document["axes"][axis]["outcome"] for axis in ("CX", "CZ")} == {"CX": "at noise floor", "CZ": "at noise floor"}
    assert _ways(workspace) == [
        ("flight_flow", "direct", "completed"),
        ("import_flow", "direct", "completed"),
        ("update_flow", "direct", "completed"),
    ]
    stored = _stored(workspace)
    steps = [[step for step, _ in results] for results in stored["results"].values()]
    assert all(set(entry) == {"ingest", "coefficients", "compare"} for entry in steps)
    with Catalogue.open(workspace.catalogue) as catalogue:
        candidate = catalogue.version(NAME, "candidate")
        lineage = catalogue.lineage(candidate.id)
    assert candidate.id == document["candidate"]
    assert sorted(lineage.roles.values()) == ["held_out"] * 2 + ["identified"] * 4
    assert {row.flow for row in lineage.runs} == {"import_flow", "update_flow"}


def test_prefects_ephemeral_mode_stores_the_same(
    tmp_path: Path, logs: list[Path], direct: tuple[Workspace, dict[str, Any]]
) -> None:
    """The logs in another order: side by side they are taken in in any order, and the held-out flights must not depend on it."""
    workspace = _prepared(tmp_path / "w", logs[0].parent)
    done = _both(workspace.root, logs[0].parent, logs[::-1])
    _same_as_direct(workspace, done, direct)
    assert {how for flow, how, _ in _ways(workspace) if flow != "import_flow"} == {"ephemeral"}
    assert (workspace.root / "prefect").is_dir()


def test_a_prefect_server_stores_the_same_and_knows_the_runs(
    tmp_path: Path, logs: list[Path], direct: tuple[Workspace, dict[str, Any]], server: str
) -> None:
    workspace = _prepared(tmp_path / "w", logs[0].parent)
    done = _both(workspace.root, logs[0].parent, logs, PREFECT_API_URL=server)
    _same_as_direct(workspace, done, direct)
    ways = [(flow, how, state) for flow, how, state in _ways(workspace) if flow != "import_flow"]
    assert ways == [("flight_flow", "server", "completed"), ("update_flow", "server", "completed")]
    request = urllib.request.Request(f"{server}/flows/filter", data=b"{}", headers={"content-type": "application/json"})
    with urllib.request.urlopen(request, timeout=10) as response:
        assert {"flight-flow", "update-flow"} <= {flow["name"] for flow in json.load(response)}


def test_a_server_that_does_not_answer_is_done_without(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from flows.run import configure_prefect

    for name in [name for name in os.environ if name.startswith("PREFECT_")]:
        monkeypatch.delenv(name)
    before = dict(os.environ)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound but not listening: nobody answers, and nobody else takes it
        monkeypatch.setenv("PREFECT_API_URL", f"http://127.0.0.1:{closed.getsockname()[1]}/api")
        try:
            assert configure_prefect(tmp_path) == "ephemeral"
            assert "PREFECT_API_URL" not in os.environ
            assert os.environ["PREFECT_HOME"] == str(tmp_path / "prefect")
        finally:
            os.environ.clear()
            os.environ.update(before)


def test_everything_a_second_time_changes_nothing(logs: list[Path], direct: tuple[Workspace, dict[str, Any]]) -> None:
    workspace, document = direct
    files, rows, stored = state_of(workspace.root), _rows(workspace), _stored(workspace)
    assert any(name.startswith("reports/") for name in files)
    again = _ingest_and_update(workspace, logs)
    assert again == document
    assert state_of(workspace.root) == files
    assert _rows(workspace) == rows
    assert _stored(workspace) == stored
    database = {"file": str(logs[0].parent / "database.toml"), "vehicle": NAME, "bindings": {}}
    run_flow(import_flow, database, workspace, "direct")
    assert _rows(workspace) == rows


def test_one_bad_log_stops_no_other(tmp_path: Path, logs: list[Path]) -> None:
    """Also one that is fine but belongs to another vehicle: its refusal once came as an exception and ended the run."""
    workspace = _prepared(tmp_path / "w", logs[0].parent)
    other = small_glider.VEHICLE.replace(NAME, "other-glider")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("other-glider", other)
    run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": "other-glider"}, workspace, "direct")
    empty, absent = tmp_path / "empty.csv", tmp_path / "absent.csv"
    empty.write_bytes(b"")
    given = [str(path) for path in (empty, logs[1], logs[0], absent, tmp_path, logs[2])]
    outcomes = run_flow(flight_flow, {"logs": given, "vehicle": NAME}, workspace, "direct")
    assert [outcome["log"] for outcome in outcomes] == given
    assert [outcome["status"] for outcome in outcomes] == ["refused", "stored", "refused", "refused", "refused", "stored"]
    assert "already stored for vehicle 'other-glider'" in outcomes[2]["what"]
    assert all(outcome["comparison"]["key"] for outcome in outcomes if outcome["status"] == "stored")
    held = [path.parent.name for path in (workspace.root / "quarantine").glob("*/reason.json")]
    assert held == [hashlib.sha256(b"").hexdigest()], "only what is wrong with the bytes themselves goes to quarantine"
    assert [entry[2] for entry in _ways(workspace)] == ["completed"] * 3


def test_a_run_that_fails_is_recorded_with_its_error(tmp_path: Path, logs: list[Path]) -> None:
    workspace = _prepared(tmp_path / "w", logs[0].parent)
    stored = _stored(workspace)
    missing = {"file": str(tmp_path / "database.xyz"), "vehicle": NAME, "bindings": {}}
    (tmp_path / "database.xyz").write_text("x")
    with pytest.raises(InputError, match="no importer"):
        run_flow(import_flow, missing, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        failed = catalogue.runs("failed")
    assert len(failed) == 1
    assert "no importer for '.xyz'" in failed[0].error
    assert failed[0].ended_utc is not None
    assert _stored(workspace) == stored


def test_progress_is_told_step_by_step(tmp_path: Path, logs: list[Path]) -> None:
    told: list[tuple[str, int, int]] = []
    workspace = _prepared(tmp_path / "w", logs[0].parent)
    parameters = {"logs": [str(log) for log in logs[:2]], "vehicle": NAME}
    run_flow(flight_flow, parameters, workspace, "direct", lambda step, done, total: told.append((step, done, total)))
    steps = ("ingest.store_log", "coefficients.reconstruct", "compare.compare_with_version")
    assert told == [(step, done, 2) for step in steps for done in (0, 1, 2)]


@pytest.mark.parametrize("command", [["version", "list"], ["flight", "list"], ["vehicle", "list"]])
def test_a_query_imports_no_orchestrator(direct: tuple[Workspace, dict[str, Any]], command: list[str]) -> None:
    code = (
        "import sys; from flows.cli.main import app; app(sys.argv[1:], standalone_mode=False);"
        "heavy = {'prefect', 'matplotlib', 'numba', 'fastapi', 'pint'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    arguments = [sys.executable, "-c", code, "--workspace", str(direct[0].root), "--json", *command]
    done = subprocess.run(arguments, env=_environment(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)
