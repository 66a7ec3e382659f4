"""What is killed leaves no process behind: those of Prefect end with their parent; and two services do not share a port."""

import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.locks import note_of
from aerodb.storage.workspace import Workspace
from tests.flows.test_serve import SETTINGS, end_service, start_service
from tests.support.command import aerodb
from tests.support.end_to_end import environment
from tests.support.ports import free_port
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what is whose")


def until(condition: Callable[[], Any], what: str) -> Any:
    limit = time.monotonic() + 300
    while not (found := condition()):
        assert time.monotonic() < limit, f"never: {what}"
        time.sleep(0.1)
    return found


def processes_of(workspace: Workspace) -> dict[int, str]:
    """Process -> its arguments, of those whose environment names Prefect's folder there."""
    found = {}
    mine = f"PREFECT_HOME={workspace.prefect}".encode()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mine in (folder / "environ").read_bytes().split(b"\0"):
                said = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                found[int(folder.name)] = said
        except OSError:
            continue
    return {process: said for process, said in found.items() if said}


def answered(url: str) -> int:
    """Status of an answer to a request without a token; 0 for none."""
    path = f"{url}/flow_runs/filter"
    request = urllib.request.Request(path, b"{}", {"Content-Type": "application/json"})
    try:
        return int(urllib.request.urlopen(request, timeout=120).status)
    except urllib.error.HTTPError as error:
        return error.code
    except OSError:
        return 0


def test_the_server_of_a_killed_command_asks_for_a_token_and_ends_with_it(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.prepared(tmp_path / "w")
    ingest = ("flight", "ingest", str(shared.logs[0]), "--vehicle", NAME)
    # Stopped while the server of the ephemeral mode runs.
    code = (
        "import os, sys\n"
        "from aerodb.tasks.steps import ingest\n"
        "from aerodb.flows.cli import main\n"
        "import aerodb.flows.run as run\n"
        "def stopped(*_, **__):\n"
        "    print(os.environ['PREFECT_API_URL'], flush=True)\n"
        "    sys.stdin.read()\n"
        "run.PrefectSteps._done = stopped\n"
        "main()\n"
    )
    command = [sys.executable, "-c", code, "--workspace", str(workspace.root), *ingest]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment(), stdin=pipe, stdout=pipe, text=True) as first:
        assert first.stdout is not None
        url = first.stdout.readline().strip()
        assert answered(url) == 401
        assert [text for text in processes_of(workspace).values() if "prefect_server" in text]
        first.kill()
    until(lambda: not processes_of(workspace), "no process is left")
    assert answered(url) == 0
    done = aerodb(workspace.root, *ingest)
    assert done.returncode == 0, done.stderr


@pytest.mark.campaign
def test_a_killed_service_takes_its_runs_along(tmp_path: Path, shared: SharedWorkspaces) -> None:
    """Server, runner and the process of a run that is under way."""
    workspace = shared.prepared(tmp_path / "w")
    (workspace.root / "settings.toml").write_text(SETTINGS, encoding="utf-8")
    folder = workspace.inbox / NAME
    folder.mkdir()
    process = start_service(workspace)
    try:
        until(lambda: note_of(workspace.lock("serve")).get("url"), "the server came up")
        for log in shared.logs[:3]:
            (folder / log.name).write_bytes(log.read_bytes())
        runs = workspace.lock("run-x").parent
        until(lambda: list(runs.glob("run-*")), "a run is under way")
        begun = processes_of(workspace)
        assert len(begun) >= 3, begun
        process.kill()
        process.wait(timeout=300)
        until(lambda: not set(processes_of(workspace)) & set(begun), "they have ended")
    finally:
        end_service(process)


@pytest.mark.campaign
def test_two_services_on_one_port_are_told_apart(tmp_path: Path, shared: SharedWorkspaces) -> None:
    """Both started together: the port is free for both, until the first one's server listens."""
    port = free_port()
    workspaces = [shared.prepared(tmp_path / name / "w") for name in ("one", "other")]
    services = []
    for workspace in workspaces:
        (workspace.root / "settings.toml").write_text(f"[serve]\nport = {port}\n")
        services.append(start_service(workspace))
    try:
        refused = until(
            lambda: [service for service in services if service.poll() is not None],
            "one is refused",
        )
        assert [service.returncode for service in refused] == [3]
        place = services.index(refused[0])
        said = (workspaces[place].root.parent / "said.txt").read_text()
        assert f"port {port}" in said
        assert "bug" not in said
        other = workspaces[1 - place]
        until(lambda: note_of(other.lock("serve")).get("url"), "the other one came up")
    finally:
        for service in services:
            end_service(service)


@pytest.mark.campaign
def test_another_server_on_the_port_is_not_taken_for_ones_own(
    tmp_path: Path, shared: SharedWorkspaces, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that came between the look at the port and the start of one's own server."""
    from aerodb.errors import StoreError
    from aerodb.flows import serve

    workspace = Workspace.open(tmp_path / "w")
    (workspace.root / "settings.toml").write_text("[serve]\nport = 0\n")

    def unauthorised(_: object) -> bool:
        raise urllib.error.HTTPError("http://x", 401, "", {}, None)  # type: ignore[arg-type]

    monkeypatch.setattr(serve, "is_awaited", unauthorised)
    with pytest.raises(StoreError, match="another server answers"):
        serve.serve(workspace, lambda _: None)
    assert not processes_of(workspace)
