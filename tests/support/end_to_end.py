"""From logs to a proved candidate by the commands that people type; whichever way they run, they
store the same."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from aerodb.storage.workspace import Workspace
from tests.support.forking import run_forked
from tests.support.glider_runs import stored
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.small_glider import NAME

#: Both commands in one process, so that Prefect's own start is paid once.
BOTH = """
import sys
from aerodb.flows.cli.main import app
first, second = sys.argv[1:].index("--then"), sys.argv[1:]
for command in (second[:first], second[first + 1:]):
    assert not app(command, standalone_mode=False)
"""


def environment(**more: str) -> dict[str, str]:
    """The environment of a process of the product's: nothing of this one's orchestrator and
    workspace, and `more`."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PREFECT_", "AERODB_"))
    }
    return {**kept, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", **more}


def by_commands(
    root: Path, folder: Path, logs: list[Path], *options: str, **more: str
) -> subprocess.CompletedProcess[str]:
    """Ingests and updates in one process of its own; a workspace with vehicle and database must be
    there."""
    common = ["--workspace", str(root), "--json"]
    ingest = [*common, "flight", "ingest", *map(str, logs), "--vehicle", NAME, *options]
    update = [*common, "update", "--vehicle", NAME, "--model", str(folder / "model.toml"), *options]
    given = [*ingest, "--then", *update]
    if hasattr(os, "fork"):
        return run_forked(given, environment(**more), code=BOTH)
    command = [sys.executable, "-c", BOTH, *given]
    return subprocess.run(
        command, env=environment(**more), capture_output=True, text=True, timeout=600
    )


def same_as_direct(
    workspace: Workspace,
    done: subprocess.CompletedProcess[str],
    direct: tuple[Workspace, dict[str, Any]],
) -> None:
    """Asserts that commands ended well, and that `workspace` and their answer hold what the run
    without Prefect stored."""
    assert done.returncode == 0, done.stderr
    assert stored(workspace) == stored(direct[0])
    first = json.JSONDecoder().raw_decode(done.stdout)
    document = json.loads(done.stdout[first[1] :])
    assert document["candidate"] == direct[1]["candidate"]
    assert [entry["terms"] for entry in document["increments"]] == [
        entry["terms"] for entry in direct[1]["increments"]
    ]
    assert "prefect" not in (done.stdout + done.stderr).lower().replace(
        str(workspace.root).lower(), ""
    )
    assert "INFO" not in done.stderr


@contextmanager
def prefect_server(home: Path) -> Iterator[str]:
    """A real Prefect server, its files in `home`: its address. Its process is ended whatever
    happens."""
    port = free_port()
    url, log = f"http://127.0.0.1:{port}/api", home / "prefect-server.log"
    settings = {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": url,
        "DO_NOT_TRACK": "1",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    }
    command = [
        sys.executable,
        "-m",
        "prefect",
        "server",
        "start",
        "--host",
        "127.0.0.1",
        "--port",
        str(port),
        "--no-ui",
    ]
    with log.open("wb") as said:
        process = subprocess.Popen(
            command, env=environment(**settings), stdout=said, stderr=said, start_new_session=True
        )
    try:
        until = time.monotonic() + 300
        while not _answers(f"{url}/health"):
            if process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(
                    f"the Prefect server did not start:\n{log.read_text(errors='replace')[-2000:]}"
                )
            time.sleep(0.3)
        yield url
    finally:
        process.terminate()
        try:
            process.wait(timeout=120)
        except subprocess.TimeoutExpired:
            os.killpg(
                process.pid, signal.SIGKILL
            )  # its own session: the workers that it started go with it
            process.wait(timeout=120)


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=30) as response:
            return bool(response.status == 200)
    except OSError:
        return False
