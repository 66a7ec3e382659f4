"""Flows: the same keys whichever way they run, nothing twice, and one bad log stops no other.

A Prefect server is a process of its own here, on a free port with its home in the test's folder; so is every flow that
runs under Prefect, because Prefect reads its settings when it is first imported.
"""

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

from storage.catalogue import Catalogue
from storage.workspace import Workspace
from tests import small_glider
from tests.glider_runs import ingest_and_update, prepared, stored, ways
from tests.small_glider import NAME, write_files

#: Both commands in one process, so that Prefect's own start is paid once.
BOTH = """
import sys
from flows.cli.main import app
first, second = sys.argv[1:].index("--then"), sys.argv[1:]
for command in (second[:first], second[first + 1:]):
    assert not app(command, standalone_mode=False)
"""


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


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_files(tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def direct(tmp_path_factory: pytest.TempPathFactory, logs: list[Path]) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document of the run without Prefect, in this process."""
    workspace = prepared(tmp_path_factory.mktemp("direct"), logs[0].parent)
    return workspace, ingest_and_update(workspace, logs)


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
    assert stored(workspace) == stored(direct[0])
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
    assert ways(workspace) == [
        ("flight_flow", "direct", "completed"),
        ("import_flow", "direct", "completed"),
        ("update_flow", "direct", "completed"),
    ]
    kept = stored(workspace)
    steps = [[step for step, _ in results] for results in kept["results"].values()]
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
    workspace = prepared(tmp_path / "w", logs[0].parent)
    done = _both(workspace.root, logs[0].parent, logs[::-1])
    _same_as_direct(workspace, done, direct)
    assert {how for flow, how, _ in ways(workspace) if flow != "import_flow"} == {"ephemeral"}
    assert (workspace.root / "prefect").is_dir()


def test_a_prefect_server_stores_the_same_and_knows_the_runs(
    tmp_path: Path, logs: list[Path], direct: tuple[Workspace, dict[str, Any]], server: str
) -> None:
    workspace = prepared(tmp_path / "w", logs[0].parent)
    done = _both(workspace.root, logs[0].parent, logs, PREFECT_API_URL=server)
    _same_as_direct(workspace, done, direct)
    done_by = [(flow, how, state) for flow, how, state in ways(workspace) if flow != "import_flow"]
    assert done_by == [("flight_flow", "server", "completed"), ("update_flow", "server", "completed")]
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
