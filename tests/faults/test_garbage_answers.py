"""HTTP servers that answer garbage: the client reports it, continues, and reveals no address."""

import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from aerodb.flows.orchestrator import OrchestratorClient
from aerodb.flows.serve import Server
from aerodb.storage.inbox.outbox import post_notification
from aerodb.storage.locks import take
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.notify import deliver

GARBAGE = b"sesame is what was asked for\r\n\r\n"
SHORT = b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n[1"
NO_JSON = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\n{sim"
ANOTHER_SHAPE = b'HTTP/1.1 200 OK\r\nContent-Length: 7\r\n\r\n{"a":1}'


BUSY = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n"
AN_ID = b'HTTP/1.1 200 OK\r\nContent-Length: 8\r\n\r\n{"id":7}'


class Answering:
    """Answers every connection on `port` with the same bytes, the first ones with `first`, and
    counts them."""

    def __init__(self, answer: bytes, *first: bytes) -> None:
        self._answer, self._first, self.asked = answer, list(first), 0
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with connection:
                self.asked += 1
                connection.settimeout(300.0)
                _question(connection)
                connection.sendall(self._first.pop(0) if self._first else self._answer)

    def close(self) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join()


def _question(connection: socket.socket) -> None:
    """Reads a whole question: who closes before that resets the connection, and the answer may be
    lost."""
    with connection.makefile("rb") as asked:
        length = 0
        while (line := asked.readline()).strip():
            name, _, value = line.partition(b":")
            length = int(value) if name.lower() == b"content-length" else length
        asked.read(length)


@pytest.fixture
def answering() -> Iterator[Callable[..., Answering]]:
    made: list[Answering] = []

    def answer(*with_what: bytes) -> Answering:
        made.append(Answering(*with_what))
        return made[-1]

    yield answer
    for each in made:
        each.close()


@pytest.mark.parametrize("answer", [GARBAGE, b"", b"HTTP/1.1 two hundred\r\n\r\n"])
def test_a_webhook_that_answers_garbage(
    tmp_path: Path, answering: Callable[..., Answering], answer: bytes
) -> None:
    """It is asked once for three notifications, all of them wait, and nothing of its address is
    said."""
    hook = answering(answer)
    workspace = Workspace.open(tmp_path / "w")
    text = f'[notification]\nwebhook = "http://127.0.0.1:{hook.port}/sesame"\n'
    (workspace.root / "settings.toml").write_text(text, encoding="utf-8")
    for k in range(3):
        post_notification(workspace, "failed", "glider", f"sentence {k}", {})
    failures = deliver(str(workspace.root), workspace=str(workspace.root), run="")
    assert [failure["text"] for failure in failures] == [f"sentence {k}" for k in range(3)]
    assert all(
        f["error"].startswith("webhook: ") and "sesame" not in f["error"] for f in failures
    ), failures
    assert hook.asked == 1
    assert len(list(workspace.outbox.iterdir())) == 3


def test_an_address_that_is_none_is_not_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What complains of an address quotes it in part."""
    monkeypatch.setenv("HOOK", "http://127.0.0.1/a b?key=sesame")
    workspace = Workspace.open(tmp_path / "w")
    (workspace.root / "settings.toml").write_text(
        '[notification]\nwebhook = "$HOOK"\n', encoding="utf-8"
    )
    post_notification(workspace, "failed", "glider", "a sentence", {})
    assert deliver(str(workspace.root), workspace=str(workspace.root), run="") == [
        {"text": "a sentence", "error": "webhook: InvalidURL"}
    ]


@pytest.mark.parametrize("answer", [GARBAGE, SHORT, NO_JSON])
def test_a_server_that_answers_garbage_is_out_of_reach(
    answering: Callable[..., Answering], answer: bytes
) -> None:
    client = OrchestratorClient(f"http://127.0.0.1:{answering(answer).port}/api", "")
    with pytest.raises(OSError, match="gave no valid answer"):
        client.post("/flow_runs/filter", {})


def test_garbage_is_not_healthy(answering: Callable[..., Answering]) -> None:
    assert not OrchestratorClient(f"http://127.0.0.1:{answering(GARBAGE).port}/api", "").healthy()


@pytest.mark.parametrize("answer", [GARBAGE, SHORT, NO_JSON, ANOTHER_SHAPE])
def test_the_service_outlives_any_answer(
    tmp_path: Path, answering: Callable[..., Answering], answer: bytes
) -> None:
    """A beat asks a server that answers anything at all: it is said, and the next beat comes."""
    workspace = Workspace.open(tmp_path / "w")
    (workspace.root / "settings.toml").write_text("[serve]\nport = 0\n", encoding="utf-8")
    lock = take(workspace.lock("serve"))
    assert lock is not None
    said: list[str] = []
    server = Server(workspace, lock, said.append)
    server.client = OrchestratorClient(f"http://127.0.0.1:{answering(answer).port}/api", "")
    beats = [server._beat(threading.Event()) for _ in range(2)]
    lock.release()
    assert len(beats) == 2
    assert said[0].startswith("postponed: "), said


def test_a_server_that_is_busy_is_asked_again(answering: Callable[..., Answering]) -> None:
    server = answering(AN_ID, BUSY, BUSY)
    assert OrchestratorClient(f"http://127.0.0.1:{server.port}", "").post("/flow_runs/", {}) == {
        "id": 7
    }
    assert server.asked == 3


def test_a_server_that_stays_busy_is_given_up(
    answering: Callable[..., Answering], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aerodb.flows.orchestrator._SECONDS", 0.5)
    server = answering(BUSY)
    with pytest.raises(OSError, match="503"):
        OrchestratorClient(f"http://127.0.0.1:{server.port}", "").post("/flow_runs/", {})
    assert server.asked > 1
