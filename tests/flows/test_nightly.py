"""The nightly flow: databases are taken further when enough is new, people are told, and what is
stored costs nothing."""

import json
import shutil
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.flows.flight import flight_flow
from aerodb.flows.nightly import night_lock, nightly_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.inbox.outbox import post_notification
from aerodb.storage.locks import holding
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.notify import deliver
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, channels, write_csv

SETTINGS = """\
[inbox]
settle = "0.1 s"
[loop]
after = 3
run = ["update"]
model = "increments.toml"
"""


def _made(root: Path, shared: SharedWorkspaces, more: str = "") -> Workspace:
    workspace = shared.prepared(root)
    (root / "settings.toml").write_text(SETTINGS + more, encoding="utf-8")
    (root / "increments.toml").write_text(MODEL, encoding="utf-8")
    (workspace.inbox / NAME).mkdir()
    return workspace


def _night(workspace: Workspace, **parameters: Any) -> dict[str, Any]:
    document: dict[str, Any] = run_flow(nightly_flow, parameters, workspace, "direct")
    return document


class Received(HTTPServer):
    """A webhook on this machine, and the documents that came."""

    def __init__(self) -> None:
        self.documents: list[dict[str, Any]] = []
        self.status = 200
        super().__init__(("127.0.0.1", 0), _Handler)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/hook?secret=sesame"


class _Handler(BaseHTTPRequestHandler):
    server: Received

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if self.server.status == 200:
            self.server.documents.append(json.loads(body))
        self.send_response(self.server.status)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        """Says nothing."""


@pytest.fixture
def hook() -> Iterator[Received]:
    with Received() as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield server
        server.shutdown()
        serving.join()


def test_a_candidate_is_made_when_enough_is_new_and_told_once(
    tmp_path: Path,
    logs: list[Path],
    shared: SharedWorkspaces,
    hook: Received,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two flights are not enough, three are; the night after does nothing; two more are not enough
    again. A webhook that is down gets its notification later, and its address, which holds a
    secret, stands nowhere."""
    monkeypatch.setenv("HOOK", hook.address)
    workspace = _made(tmp_path / "w", shared, '[notification]\nwebhook = "$HOOK"\n')
    for log in logs[:2]:
        shutil.copy(log, workspace.inbox / NAME)
    first = _night(workspace)
    assert [(loop["due"], loop["new"], loop["candidate"]) for loop in first["loops"]] == [
        (False, 2, None)
    ]
    shutil.copy(logs[2], workspace.inbox / NAME)
    (workspace.inbox / NAME / "bad.csv").write_text("time,nothing\n0,1\n")
    hook.status = 500
    second = _night(workspace)
    (loop,) = second["loops"]
    assert (loop["due"], loop["new"], loop["label"], loop["error"]) == (True, 3, "v0002", "")
    assert len(second["undelivered"]) == 2
    assert hook.documents == []
    assert "sesame" not in json.dumps(second)
    hook.status = 200
    third = _night(workspace)
    assert [loop["due"] for loop in third["loops"]] == [False]
    assert third["undelivered"] == []
    assert [document["occasion"] for document in hook.documents] == ["refused", "candidate"]
    refused, candidate = hook.documents
    assert "no mapping fits" in refused["details"]["files"][0]["reason"]
    assert (candidate["details"]["version"], candidate["details"]["label"]) == (
        loop["candidate"],
        "v0002",
    )
    assert (
        candidate["details"]["axes"]["CZ"]["rms_after"]
        < candidate["details"]["axes"]["CZ"]["rms_before"]
    )
    for log in logs[3:5]:
        shutil.copy(log, workspace.inbox / NAME)
    assert [(loop["due"], loop["new"]) for loop in _night(workspace)["loops"]] == [(False, 2)]
    assert len(hook.documents) == 2
    found = [
        path
        for path in workspace.root.rglob("*")
        if path.is_file() and b"sesame" in path.read_bytes()
    ]
    assert found == []


def test_one_loop_that_fails_is_said_and_stops_nothing(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    """Its model file is missing: the sweep stands, a command is told, and the night ends well."""
    told = tmp_path / "told.json"
    code = f"import sys; open({str(told)!r}, 'ab').write(sys.stdin.buffer.read() + b'\\n')"
    command = json.dumps([sys.executable, "-c", code])
    workspace = _made(tmp_path / "w", shared, f"[notification]\ncommand = {command}\n")
    (workspace.root / "increments.toml").unlink()
    for log in logs[:3]:
        shutil.copy(log, workspace.inbox / NAME)
    document = _night(workspace)
    assert [entry["kind"] for entry in document["files"]] == ["stored"] * 3
    (loop,) = document["loops"]
    assert (loop["due"], loop["candidate"]) == (True, None)
    assert "increments.toml" in loop["error"] or "cannot be read" in loop["error"]
    (message,) = [json.loads(line) for line in told.read_text().splitlines()]
    assert (message["occasion"], message["vehicle"]) == ("failed", NAME)
    assert [loop["due"] for loop in _night(workspace)["loops"]] == [True], (
        "what failed is tried again the next night"
    )


def test_a_log_that_never_flew_is_rejected_and_not_new(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = _made(tmp_path / "w", shared)
    standing = channels(7)
    standing |= {"V": 0.02 * standing["V"], "qbar": 4e-4 * standing["qbar"]}
    log = write_csv(tmp_path / "standing.csv", standing)
    parameters = {"logs": [str(log)], "vehicle": NAME}
    (outcome,) = run_flow(flight_flow, parameters, workspace, "direct")
    assert outcome["consistency"]["verdict"] == "rejected"
    assert "never airborne" in outcome["consistency"]["reasons"][0]
    (loop,) = _night(workspace)["loops"]
    assert (loop["new"], loop["due"]) == (0, False)


def test_a_vehicle_with_its_own_schedule_is_left_to_it(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = _made(tmp_path / "w", shared, f'[vehicles.{NAME}.schedule]\nevery = "1 h"\n')
    assert _night(workspace, scheduled=True)["loops"] == []
    assert [loop["vehicle"] for loop in _night(workspace, vehicle=NAME)["loops"]] == [NAME]


def test_a_run_whose_process_is_gone_has_crashed_and_one_that_lives_has_not(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = _made(tmp_path / "w", shared)
    with Catalogue.open(workspace.catalogue) as catalogue:
        dead = catalogue.start_run("flight_flow", how="direct", parameters={"vehicle": NAME}).id
        alive = catalogue.start_run("flight_flow", how="direct").id
    with holding(workspace.lock(f"run-{alive}")):
        document = _night(workspace)
    assert [run["run"] for run in document["crashed"]] == [dead]
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert (catalogue.run(dead).state, catalogue.run(alive).state) == ("crashed", "running")
        assert "without a message" in catalogue.run(dead).error


def test_what_cannot_be_delivered_waits_in_order(
    tmp_path: Path, shared: SharedWorkspaces, hook: Received
) -> None:
    workspace = _made(tmp_path / "w", shared, f'[notification]\nwebhook = "{hook.address}"\n')
    for k in range(3):
        post_notification(workspace, "failed", NAME, f"sentence {k}", {})
    where = {"workspace": str(workspace.root), "run": ""}
    hook.status = 503
    failures = deliver(str(workspace.root), **where)
    assert [failure["text"] for failure in failures] == [f"sentence {k}" for k in range(3)]
    assert "503" in failures[0]["error"]
    assert "sesame" not in failures[0]["error"]
    hook.status = 200
    assert deliver(str(workspace.root), **where) == []
    assert [document["text"] for document in hook.documents] == [f"sentence {k}" for k in range(3)]
    assert list(workspace.outbox.iterdir()) == []


def test_a_command_leaves_a_night_alone_that_is_under_way(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """The deployment's night holds the same lock; a vehicle's own night is another one."""
    workspace = _made(tmp_path / "w", shared)
    with holding(night_lock(workspace, None)):
        done = CliRunner().invoke(app, ["--workspace", str(workspace.root), "nightly", "--direct"])
        assert "a nightly run of this workspace is already running" in str(done.exception)
        asked(workspace.root, "nightly", "--direct", "--vehicle", NAME)
    assert asked(workspace.root, "nightly", "--direct")["files"] == []


def _statements(workspace: Workspace) -> int:
    """How many statements a night with one new flight puts to the catalogue, and that it reads no
    stored flight."""
    count = 0

    def note(*_: Any) -> None:
        nonlocal count
        count += 1

    sa.event.listen(sa.Engine, "before_cursor_execute", note)
    try:
        document = _night(workspace)
    finally:
        sa.event.remove(sa.Engine, "before_cursor_execute", note)
    assert [entry["kind"] for entry in document["files"]] == ["stored"]
    return count


def test_a_night_costs_what_is_new(tmp_path: Path, shared: SharedWorkspaces) -> None:
    """One new flight beside three stored ones and beside thirteen: the same number of statements,
    and no stored flight is opened again (their files are taken away meanwhile)."""
    workspace = _made(tmp_path / "w", shared)
    (workspace.root / "settings.toml").write_text(
        SETTINGS.replace("after = 3", "after = 50"), encoding="utf-8"
    )
    box, counts = workspace.inbox / NAME, []
    for stored in (3, 9):
        more = [
            write_csv(tmp_path / f"{stored}-{k}.csv", channels(100 * stored + k, seconds=6.0))
            for k in range(stored)
        ]
        run_flow(
            flight_flow, {"logs": [str(log) for log in more], "vehicle": NAME}, workspace, "direct"
        )
        away = workspace.root / "flights-away"
        (workspace.root / "flights").rename(away)
        (workspace.root / "flights").mkdir()
        write_csv(box / f"new{stored}.csv", channels(5000 + stored, seconds=6.0))
        counts.append(_statements(workspace))
        shutil.copytree(workspace.root / "flights", away, dirs_exist_ok=True)
        shutil.rmtree(workspace.root / "flights")
        away.rename(workspace.root / "flights")
    assert counts[0] == counts[1]
