"""``aerodb serve`` with a real Prefect server: schedules, events, the inbox, crashes, a second one,
and its end.

It is one process for most tests here, as in use: what they ask of it, they ask in order.
"""

import json
import os
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from aerodb.flows.orchestrator import OrchestratorClient, clear_up
from aerodb.flows.prefect_environment import configure_prefect
from aerodb.flows.processes import environment_of
from aerodb.flows.serve import Server
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import RunRow
from aerodb.storage.limits import Limits
from aerodb.storage.locks import holding, is_held, note_of, take
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import load_settings
from tests.support.command import aerodb
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv

TOKEN = "a-token-for-tests-only"
SETTINGS = """\
[serve]
port = 0
ui = true
[inbox]
settle = "0.5 s"
[nightly]
cron = "* * * * * */30"
[loop]
run = []
[vehicles.small-glider.schedule]
every = "1 h"
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks and signals of POSIX")


#: A vehicle that does not exist, in the settings that a test breaks.
BROKEN = "vehicles.nobody"


@dataclass
class Served:
    """A workspace and the `aerodb serve` that runs on it."""

    workspace: Workspace
    process: "subprocess.Popen[bytes]"
    logs: list[Path]
    #: From when until when the server was away because a test killed it.
    away: list[tuple[datetime, datetime]] = field(default_factory=list)

    @property
    def client(self) -> OrchestratorClient:
        return OrchestratorClient(note_of(self.workspace.lock("serve"))["url"], TOKEN)

    def said(self) -> str:
        """What it said, and what its processes did: for messages of tests that fail."""
        told = {
            file.name: file.read_text(errors="replace")[-3000:]
            for file in sorted(self.workspace.prefect.glob("*.log"))
        }
        own = self.workspace.root.parent / "said.txt"
        return "\n".join(
            f"== {name}\n{text}"
            for name, text in ({own.name: own.read_text(errors="replace")} | told).items()
        )


def start_service(workspace: Workspace, **more: str) -> "subprocess.Popen[bytes]":
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PREFECT_", "AERODB_"))
    }
    environment = {**kept, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", **more}
    command = [
        sys.executable,
        "-c",
        "from aerodb.flows.cli import main; main()",
        "--workspace",
        str(workspace.root),
        "serve",
    ]
    with (workspace.root.parent / "said.txt").open("ab") as said:
        return subprocess.Popen(
            command, env=environment, stdout=said, stderr=said, start_new_session=True
        )


def wait_until(
    condition: Callable[[], Any], served: Served, what: str, seconds: float = 300.0
) -> Any:
    until = time.monotonic() + seconds
    while not (found := condition()):
        if served.process.poll() is not None or time.monotonic() > until:
            pytest.fail(f"never: {what}\n{served.said()}")
        time.sleep(0.3)
    return found


def end_service(process: "subprocess.Popen[bytes]") -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(timeout=120)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(timeout=120)


def _workspace(root: Path, shared: SharedWorkspaces) -> Workspace:
    workspace = shared.prepared(root)
    (root / "settings.toml").write_text(SETTINGS, encoding="utf-8")
    (workspace.inbox / NAME).mkdir()
    return workspace


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """What these tests ask of the server themselves may take its time."""
    monkeypatch.setattr("aerodb.flows.orchestrator._SECONDS", 300.0)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Iterator[Served]:
    folder, logs = tmp_path_factory.mktemp("served"), shared.logs
    workspace = _workspace(folder / "w", shared)
    shutil.copy(logs[0], workspace.inbox / NAME / "missed.csv")  # whoever told of it told nobody
    (folder / "home").mkdir()
    one = Served(
        workspace, start_service(workspace, AERODB_TOKEN=TOKEN, HOME=str(folder / "home")), logs
    )
    try:
        wait_until(lambda: note_of(workspace.lock("serve")).get("url"), one, "the server came up")
        yield one
    finally:
        end_service(one.process)


def has_ended(served: Served) -> dict[str, str]:
    with Catalogue.open(served.workspace.catalogue) as catalogue:
        kinds = ("stored", "duplicate", "quarantined")
        return {
            e.path.removeprefix(f"{NAME}/"): e.kind
            for kind in kinds
            for e in catalogue.inbox_events(kind)
        }  # type: ignore[arg-type]


def _runs(served: Served, flow: str, state: Any = "completed") -> list[str]:
    with Catalogue.open(served.workspace.catalogue) as catalogue:
        return [run.id for run in catalogue.runs(state) if run.flow == flow and run.how == "server"]


def test_a_log_that_nobody_told_of_is_taken_in(served: Served) -> None:
    wait_until(
        lambda: has_ended(served) == {"missed.csv": "stored"},
        served,
        "the log that waited is stored",
    )
    assert list((served.workspace.inbox / NAME).iterdir()) == []


def test_the_schedule_fires(served: Served) -> None:
    """The run in the catalogue is the flow run of the orchestrator, which its own scheduler
    made."""
    (run, *_) = wait_until(
        lambda: _runs(served, "nightly_flow"), served, "a nightly run on the schedule"
    )
    found = served.client.post("/flow_runs/filter", {"flow_runs": {"id": {"any_": [run]}}})
    assert [(entry["auto_scheduled"], entry["id"]) for entry in found] == [(True, run)]
    planned = datetime.fromisoformat(found[0]["expected_start_time"])
    assert (planned.second % 30, planned.microsecond) == (0, 0)
    (deployment,) = served.client.post(
        "/deployments/filter", {"deployments": {"name": {"any_": ["nightly"]}}}
    )
    own = [
        entry for entry in deployment["schedules"] if entry["schedule"].get("interval") == 3600.0
    ]
    assert [(len(own), own[0]["parameters"]["vehicle"]), len(deployment["schedules"])] == [
        (1, NAME),
        2,
    ]


def test_nobody_is_served_without_the_token(served: Served) -> None:
    with pytest.raises(urllib.error.HTTPError, match="401"):
        OrchestratorClient(served.client.url, "").post("/flow_runs/filter", {})
    assert served.client.post("/flow_runs/filter", {"limit": 1})
    assert re.match(r"http://127\.0\.0\.1:\d+/api", served.client.url)
    kept = [
        path
        for path in served.workspace.root.rglob("*")
        if path.is_file() and TOKEN.encode() in path.read_bytes()
    ]
    assert kept == [], "and it is written nowhere"


def test_prefects_pages_are_there_where_they_are_asked_for(served: Served) -> None:
    with urllib.request.urlopen(served.client.url.removesuffix("api"), timeout=60) as page:
        assert b"<title>Prefect" in page.read()
    with urllib.request.urlopen(
        served.client.url.replace("/api", "/ui-settings"), timeout=60
    ) as page:
        assert json.load(page)["api_url"] == served.client.url
    quiet = Workspace.open(served.workspace.root.parent / "quiet", create=True)
    environment = environment_of(quiet, served.client.url, TOKEN)
    assert environment["PREFECT_SERVER_UI_ENABLED"] == "false"


def test_a_second_one_refuses_in_a_sentence(served: Served) -> None:
    second = aerodb(served.workspace.root, "serve")
    assert second.returncode == 1
    assert (
        f"another aerodb serve runs on this workspace: process {served.process.pid}"
        in second.stderr
    )
    assert "Traceback" not in second.stderr
    assert served.process.poll() is None


def test_commands_find_the_server(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    before = dict(os.environ)
    for name in [name for name in before if name.startswith("PREFECT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("AERODB_TOKEN", TOKEN)
    try:
        assert configure_prefect(served.workspace.root) == "server"
        assert os.environ["PREFECT_API_URL"] == served.client.url
    finally:
        os.environ.clear()
        os.environ.update(before)


def test_status_says_what_it_does(served: Served) -> None:
    document = json.loads(aerodb(served.workspace.root, "--json", "status").stdout)
    assert document["serve"]["running"] is True
    assert document["serve"]["url"] == served.client.url
    assert document["serve"]["schedule"] == "cron * * * * * */30 (UTC)"
    assert document["failed"] == []


def test_settings_are_read_again_and_a_bad_file_ends_nothing(served: Served) -> None:
    path = served.workspace.root / "settings.toml"
    path.write_text(SETTINGS + f"[{BROKEN}]\nstrict = true\n", encoding="utf-8")
    wait_until(
        lambda: "unknown vehicle" in served.said(), served, "the fault in the settings is said"
    )
    assert (
        BROKEN in json.loads(aerodb(served.workspace.root, "--json", "status").stdout)["settings"]
    )
    path.write_text(SETTINGS.replace("* * * * * */30", "0 0 29 2 *"), encoding="utf-8")
    wait_until(lambda: "was reloaded" in served.said(), served, "the new settings are taken")


def test_a_run_without_a_process_is_marked_crashed_and_one_with_is_not(served: Served) -> None:
    """Real runs of the deployment, in the state in which a power cut leaves them."""
    deployments = served.client.post(
        "/deployments/filter", {"deployments": {"name": {"any_": ["nightly"]}}}
    )
    state = {"type": "RUNNING", "name": "Running"}

    def made() -> str:
        document = {
            "flow_id": deployments[0]["flow_id"],
            "deployment_id": deployments[0]["id"],
            "state": state,
        }
        return str(served.client.post("/flow_runs/", document)["id"])

    def state_of(run: str) -> str:
        return str(
            served.client.post("/flow_runs/filter", {"flow_runs": {"id": {"any_": [run]}}})[0][
                "state"
            ]["type"]
        )

    dead, alive = made(), made()
    with holding(served.workspace.lock(f"run-{alive}"), remove=True):
        clear_up(served.client, served.workspace, at_start=False)
        assert state_of(dead) == "RUNNING", "it may only just begin"
        with holding(served.workspace.lock("inbox")):  # no other run begins meanwhile
            clear_up(served.client, served.workspace, at_start=True)
        assert (state_of(dead), state_of(alive)) == ("CRASHED", "RUNNING")


@pytest.mark.campaign
def test_what_is_dropped_while_the_server_is_killed_ends_where_it_belongs(served: Served) -> None:
    """kill -9 on Prefect's server, logs dropped while it is away: it comes back by itself, and they
    are taken in."""
    box = served.workspace.inbox / NAME
    found = subprocess.run(
        ["pgrep", "-P", str(served.process.pid), "-f", "aerodb.flows.prefect_server"],
        capture_output=True,
        text=True,
    )
    killed = datetime.now(UTC)
    os.kill(int(found.stdout.split()[0]), signal.SIGKILL)
    for k in range(8):
        write_csv(box / f"drop{k}.csv", channels(300 + k, seconds=6.0))
    shutil.copy(served.logs[0], box / "copy.csv")
    (box / "damaged.csv").write_bytes(b"\x00\xffnothing")
    (box / "link.csv").symlink_to("/etc/passwd")
    wait_until(
        lambda: "is restarted" in served.said() and served.client.healthy(),
        served,
        "the server is back",
    )
    served.away.append((killed, datetime.now(UTC)))
    wait_until(lambda: len(has_ended(served)) == 12, served, "all twelve have ended")
    assert Counter(has_ended(served).values()) == {"stored": 9, "duplicate": 1, "quarantined": 2}
    assert {name for name, kind in has_ended(served).items() if kind == "quarantined"} == {
        "damaged.csv",
        "link.csv",
    }
    assert list(box.iterdir()) == []


def test_an_event_starts_the_run_of_a_log_that_appears(served: Served) -> None:
    """The schedule comes on leap days only since the settings were read again: what takes this log
    in, an event has started."""
    write_csv(served.workspace.inbox / NAME / "told.csv", channels(400, seconds=6.0))
    wait_until(lambda: has_ended(served).get("told.csv") == "stored", served, "the log is stored")
    runs = wait_until(lambda: _runs(served, "sweep_flow"), served, "the run has ended")
    found = served.client.post("/flow_runs/filter", {"flow_runs": {"id": {"any_": runs}}})
    assert {entry["created_by"]["type"] for entry in found} == {"AUTOMATION"}


def test_it_stops_and_leaves_nothing_behind(served: Served) -> None:
    """Stopped in the middle of its work: the run is noted as cancelled, and what it was at waits
    for the next one.

    A run fails when the server dies under it, by whatever its connection says then, and when it
    begins while a test has broken the settings; no other run may have failed.
    """
    children = subprocess.run(
        ["pgrep", "-P", str(served.process.pid)], capture_output=True, text=True
    ).stdout.split()
    assert children, "the server's process at least"
    served.process.send_signal(signal.SIGTERM)
    assert served.process.wait(timeout=300) == 0, served.said()
    assert [pid for pid in children if Path(f"/proc/{pid}").exists()] == []
    assert not is_held(served.workspace.lock("serve"))
    with Catalogue.open(served.workspace.catalogue) as catalogue:
        assert catalogue.runs("running") == ()
        failed = catalogue.runs("failed")
    others = [
        run
        for run in failed
        if not any(_at_work(run, *span) for span in served.away) and BROKEN not in run.error
    ]
    assert [(run.flow, run.started_utc, run.ended_utc, run.error) for run in others] == [], (
        f"{served.away}\n{served.said()}"
    )
    assert served.said().count("stopped") == 1
    assert not (served.workspace.root.parent / "home" / ".prefect").exists(), (
        "a user's own profile is not ours"
    )


def _at_work(run: RunRow, since: datetime, until: datetime) -> bool:
    """Whether a run was under way at some time between two."""
    return run.started_utc <= until and run.ended_utc is not None and run.ended_utc >= since


def test_killed_it_takes_its_processes_along(tmp_path: Path, shared: SharedWorkspaces) -> None:
    """kill -9 on `aerodb serve` itself: the next one finds no orphan that still serves the
    workspace."""
    if sys.platform != "linux":
        pytest.skip("only Linux ends a process with its parent")
    workspace = _workspace(tmp_path / "w", shared)
    process = start_service(workspace)

    def children() -> list[str]:
        return subprocess.run(
            ["pgrep", "-P", str(process.pid)], capture_output=True, text=True
        ).stdout.split()

    try:
        begun = wait_until(children, Served(workspace, process, []), "the server's process began")
        time.sleep(1.0)  # the server's own start, so that the signal meets it there
        process.kill()
        process.wait(timeout=120)
        until = time.monotonic() + 300
        while alive := [pid for pid in begun if Path(f"/proc/{pid}").exists()]:
            assert time.monotonic() < until, alive
            time.sleep(0.2)
        assert not is_held(workspace.lock("serve"))
    finally:
        end_service(process)


def test_the_token_is_the_users_or_a_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace.open(tmp_path / "w")
    (workspace.root / "settings.toml").write_text("[serve]\nport = 0\n", encoding="utf-8")
    lock = take(workspace.lock("serve"))
    assert lock is not None
    monkeypatch.delenv("AERODB_TOKEN", raising=False)
    made = [Server(workspace, lock, str)._secret["token"] for _ in range(2)]
    assert made[0] != made[1]
    assert len(made[0]) >= 32
    monkeypatch.setenv("AERODB_TOKEN", TOKEN)
    assert Server(workspace, lock, str)._secret == {}
    lock.release()


@pytest.mark.campaign
def test_without_a_token_of_the_users_it_makes_one_that_only_the_user_can_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: SharedWorkspaces
) -> None:
    """Other users of the machine can reach a loopback port, too: they are not served, and the
    user's own commands are. Prefect makes a new database here."""
    workspace = _workspace(tmp_path / "w", shared)
    one = Served(workspace, start_service(workspace), [])
    lock = workspace.lock("serve")
    try:
        wait_until(lambda: note_of(lock).get("url"), one, "the server came up")
        note = note_of(lock)
        assert stat.S_IMODE(lock.stat().st_mode) == 0o600
        with pytest.raises(urllib.error.HTTPError, match="401"):
            OrchestratorClient(note["url"], "").post("/flow_runs/filter", {"limit": 1})
        client = OrchestratorClient(note["url"], note["token"])
        wait_until(
            lambda: client.post("/deployments/filter", {"limit": 2}),
            one,
            "its own runner is served",
        )
        said = aerodb(workspace.root, "--json", "status").stdout
        assert json.loads(said)["serve"]["url"] == note["url"]
        assert note["token"] not in said + one.said()
        others = [path for path in workspace.root.rglob("*") if path.is_file() and path != lock]
        assert [path for path in others if note["token"].encode() in path.read_bytes()] == []
        before = dict(os.environ)
        for name in [name for name in before if name.startswith(("PREFECT_", "AERODB_"))]:
            monkeypatch.delenv(name)
        try:
            assert configure_prefect(workspace.root) == "server"
            assert os.environ["PREFECT_API_AUTH_STRING"].endswith(note["token"])
        finally:
            os.environ.clear()
            os.environ.update(before)
    finally:
        end_service(one.process)


def test_what_others_could_reach_is_refused_without_a_token(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    (workspace.root / "settings.toml").write_text(
        '[serve]\nhost = "0.0.0.0"\nport = 0\n', encoding="utf-8"
    )
    done = aerodb(workspace.root, "serve")
    assert (done.returncode, done.stdout) == (3, "")
    assert "0.0.0.0, where other machines can reach it, without a token" in done.stderr
    assert not any(workspace.prefect.iterdir()), "nothing was started"


def test_a_port_that_is_taken_is_said(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        (workspace.root / "settings.toml").write_text(f"[serve]\nport = {port}\n", encoding="utf-8")
        done = aerodb(workspace.root, "serve")
    assert done.returncode == 3
    assert f"cannot listen on 127.0.0.1, port {port}" in done.stderr


def test_a_full_disk_is_said_once_and_logs_wait(tmp_path: Path) -> None:
    workspace, said = Workspace.open(tmp_path / "w"), list[str]()
    settings = workspace.root / "settings.toml"
    settings.write_text(f"[serve]\nport = 0\n[limits]\nreserve = {10**15}\n", encoding="utf-8")
    lock = take(workspace.lock("serve"))
    assert lock is not None
    server = Server(workspace, lock, said.append)
    server._watch_disk()
    server._watch_disk()
    (once,) = said
    assert once.endswith("(1000000000 MB): logs wait until there is room")
    assert not server._has_room
    server._settings = load_settings(workspace.root).model_copy(
        update={"limits": Limits(reserve=0)}
    )
    server._watch_disk()
    assert said[1].endswith("logs are ingested again")
    lock.release()
