"""Requests of one connection: none sees what the one before it left in its context."""

import socket
import threading
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from aerodb.flows.web.guard import guard_of
from aerodb.flows.web.server import listening, server_of
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace

_LEFT: ContextVar[str] = ContextVar("left", default="nothing")


async def _tells_what_was_left(scope: dict[str, Any], receive: Any, send: Any) -> None:
    if scope["type"] != "http":
        return
    seen = _LEFT.get().encode()
    _LEFT.set(scope["path"])
    await receive()
    headers = [(b"content-length", str(len(seen)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": seen})


def test_a_request_inherits_nothing_from_the_one_before_it(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    Catalogue.open(workspace.catalogue).close()
    with listening("127.0.0.1", 0) as place:
        port = place.getsockname()[1]
        server = server_of(
            workspace.root, guard_of("127.0.0.1", port, (), {"AERODB_TOKEN": "t" * 32})
        )
        server.config.app = _tells_what_was_left
        thread = threading.Thread(target=server.run, kwargs={"sockets": [place]})
        thread.start()
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=60) as client:
                last = b"GET /third HTTP/1.1\r\nhost: a\r\nconnection: close\r\n\r\n"
                client.sendall(b"GET /first HTTP/1.1\r\nhost: a\r\n\r\n" * 2 + last)
                answer = b"".join(iter(lambda: client.recv(4096), b""))
        finally:
            server.should_exit = True
            thread.join(60)
    assert answer.count(b"200 OK") == 3
    assert answer.count(b"nothing") == 3
