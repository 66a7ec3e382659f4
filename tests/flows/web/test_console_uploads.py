"""Logs that come over the network: the rules of the inbox, of roles, and of changes."""

import hashlib
import json
import re
import socket
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from starlette.testclient import TestClient

from aerodb.flows.web.bodies import LARGEST_BODY
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import hash_of_token, new_token
from tests.support.console_workspace import TOKEN, client_of, served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv

ADDRESS = f"/api/vehicles/{NAME}/logs"


@pytest.fixture
def workspace(shared: SharedWorkspaces, tmp_path: Path) -> Workspace:
    return shared.prepared(tmp_path / "workspace")


@pytest.fixture
def client(workspace: Workspace) -> Iterator[TestClient]:
    with client_of(workspace) as opened:
        opened.headers["x-csrf-token"] = opened.get("/api/session").json()["csrf"]
        yield opened


def inbox_of(workspace: Workspace) -> list[str]:
    return [path.name for path in workspace.inbox.rglob("*") if path.is_file()]


def test_a_log_is_ingested_and_sent_again_a_duplicate(
    client: TestClient, workspace: Workspace, tmp_path: Path
) -> None:
    data = write_csv(tmp_path / "long.csv", channels(1, 30.0, 50.0)).read_bytes()
    assert len(data) > LARGEST_BODY
    ended = client.post(f"{ADDRESS}?name=flight1.csv", content=data).json()
    assert (ended["kind"], ended["file"]) == ("stored", f"{NAME}/flight1.csv")
    assert ended["sha256"] == ended["flight"] == hashlib.sha256(data).hexdigest()
    assert client.get(f"/api/flights/{ended['flight']}").json()["log"]["name"] == "flight1.csv"
    again = client.post(f"{ADDRESS}?name=other.csv", content=data).json()
    assert (again["kind"], again["flight"]) == ("duplicate", ended["flight"])
    assert inbox_of(workspace) == []


def test_what_is_no_log_is_quarantined_with_the_reason(
    client: TestClient, workspace: Workspace
) -> None:
    ended = client.post(f"{ADDRESS}?name=x/../../notes.ulg", content=b"ULog\x01\x12\x35" * 9).json()
    assert ended.get("kind") == "quarantined", ended
    assert ended["reason"]
    assert (workspace.root / "quarantine" / ended["sha256"]).is_dir()
    assert ended["file"].startswith(f"{NAME}/{ended['sha256'][:12]}")  # not the name it came with
    assert inbox_of(workspace) == []


@pytest.mark.parametrize("name", ["passwd", "/etc/passwd", "", "Fl\u00fcge"])
def test_a_name_without_a_suffix_is_that_of_a_whole_log(
    client: TestClient, workspace: Workspace, name: str
) -> None:
    """It waited in the inbox for ever, under a name that marked it as unfinished."""
    ended = client.post(ADDRESS, params={"name": name}, content=b"no log\n").json()
    assert ended["kind"] == "quarantined", ended
    assert inbox_of(workspace) == []


@pytest.mark.parametrize(
    ("address", "content", "status", "words"),
    [
        (f"{ADDRESS}?name=a.csv", b"", 422, "the file is empty"),
        (f"{ADDRESS}?name=a.csv.part", b"x", 422, "unfinished"),
        (f"{ADDRESS}?name=.a.csv", b"x", 422, "unfinished"),
        ("/api/vehicles/nobody/logs?name=a.csv", b"x", 404, "nobody"),
        (f"{ADDRESS}?name={'a' * 201}", b"x", 422, "at most 200"),
    ],
)
def test_refused_before_anything_is_kept(
    client: TestClient, workspace: Workspace, address: str, content: bytes, status: int, words: str
) -> None:
    answer = client.post(address, content=content)
    assert answer.status_code == status
    assert words in answer.text
    assert inbox_of(workspace) == []


@pytest.mark.parametrize("announced", [True, False])
def test_larger_than_the_limit_leaves_nothing(
    client: TestClient, workspace: Workspace, announced: bool
) -> None:
    (workspace.root / "settings.toml").write_text("[limits]\nsize = 100000\n", encoding="utf-8")
    data = b"x" * 100_001
    content = data if announced else iter([data[:60_000], data[60_000:]])
    answer = client.post(f"{ADDRESS}?name=a.csv", content=content)
    assert answer.status_code == 422
    assert "the limit is 0 MB" in answer.text
    assert inbox_of(workspace) == []


def test_only_who_may_ingest_with_the_token_of_the_session(
    client: TestClient, workspace: Workspace
) -> None:
    forged = client.post(f"{ADDRESS}?name=a.csv", content=b"x", headers={"x-csrf-token": "0" * 64})
    assert forged.status_code == 403
    elsewhere = {"sec-fetch-site": "cross-site"}
    assert client.post(f"{ADDRESS}?name=a.csv", content=b"x", headers=elsewhere).status_code == 403
    token = new_token()
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_user("reader", "read", hash_of_token(token), by="test")
    with client_of(workspace, token=token) as reader:
        assert "Add logs" not in reader.get("/flights").text
        csrf = reader.get("/api/session").json()["csrf"]
        refused = reader.post(f"{ADDRESS}?name=a.csv", content=b"x", headers={"x-csrf-token": csrf})
        assert refused.status_code == 403
        assert "requires the role ingest" in refused.text
    assert "Add logs" in client.get("/flights").text
    assert inbox_of(workspace) == []


def test_a_log_is_looked_at_without_a_vehicle_and_not_stored(
    client: TestClient, workspace: Workspace, tmp_path: Path
) -> None:
    data = write_csv(tmp_path / "long.csv", channels(1, 30.0, 50.0)).read_bytes()
    seen = client.post("/api/looked-at/logs?name=<b>.csv", content=data).json()
    assert (seen["log"]["source"], seen["log"]["usable"]) == ("<b>.csv", True)
    page = client.get(seen["page"])
    assert page.status_code == 200
    assert "&lt;b&gt;.csv" in page.text
    policy = page.headers["content-security-policy"]
    assert "script-src 'sha256-" in policy
    assert "default-src 'none'" in policy
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert not catalogue.flights()
    assert inbox_of(workspace) == []
    first = seen["page"]
    for _ in range(8):
        seen = client.post("/api/looked-at/logs?name=a.csv", content=data).json()
    assert client.get(first).status_code == 404
    assert client.get(seen["page"]).status_code == 200


def test_what_cannot_be_looked_at_is_named_as_its_sender_does(
    client: TestClient, workspace: Workspace
) -> None:
    refused = client.post("/api/looked-at/logs?name=notes.ulg", content=b"ULog\x01\x12\x35" * 9)
    assert refused.status_code == 422
    assert str(workspace.root) not in refused.text
    assert "notes.ulg" in refused.text
    token = new_token()
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_user("reader", "read", hash_of_token(token), by="test")
    with client_of(workspace, token=token) as reader:
        assert "aerodb log show LOG" in reader.get("/logs").text
        csrf = {"x-csrf-token": reader.get("/api/session").json()["csrf"]}
        asked = reader.post("/api/looked-at/logs?name=a.csv", content=b"x", headers=csrf)
        assert asked.status_code == 403
    assert inbox_of(workspace) == []


class _Sender:
    """A client that has sent the head of a log's upload to a real console."""

    def __init__(self, address: str, path: str, length: int) -> None:
        parts = urlsplit(address)
        assert parts.hostname
        assert parts.port
        self._at = socket.create_connection((parts.hostname, parts.port), timeout=60)
        head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n"
        session = urllib.request.Request(
            f"{address}/api/session", headers={"authorization": f"Bearer {TOKEN}"}
        )
        with urllib.request.urlopen(session) as answer:
            token = json.loads(answer.read())["csrf"]
            cookie = answer.headers["set-cookie"].partition(";")[0]
        head += f"Cookie: {cookie}\r\nX-CSRF-Token: {token}\r\nContent-Length: {length}\r\n\r\n"
        self._at.sendall(head.encode())

    def send(self, data: bytes) -> None:
        self._at.sendall(data)

    def answer(self) -> bytes:
        """What the console says, head and body; empty if it closed the connection."""
        said = b""
        try:
            while part := self._at.recv(65536):
                said += part
                head, _, body = said.partition(b"\r\n\r\n")
                length = re.search(rb"content-length: (\d+)", head)
                if length is not None and len(body) >= int(length[1]):
                    break
        except ConnectionError:
            pass
        return said


def test_a_slow_log_may_take_its_time_and_one_that_stands_still_may_not(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aerodb.flows.web.connections.BODY_SECONDS", 0.5)
    path = f"{ADDRESS}?name=slow.csv"
    with served(workspace) as address:
        still = _Sender(address, path, 40_000)
        still.send(b"x" * 100)
        slow = _Sender(address, path, 40_000)
        for _ in range(20):  # two seconds and more
            slow.send(b"x" * 2000)
            time.sleep(0.1)
        assert b"quarantined" in slow.answer()
        assert still.answer() == b""
    assert inbox_of(workspace) == []
