"""The console's server: the listening socket, and the application until it is stopped."""

import logging
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import uvicorn

from aerodb.flows.web.app import create_app
from aerodb.flows.web.connections import connections, most_connections, raise_descriptor_limit
from aerodb.flows.web.guard import Guard
from aerodb.flows.web.messages import Sparing
from aerodb.flows.web.prepare import prepare

#: Connections that the system holds until they are accepted. asyncio tries to accept as many at a
#: time, and reports as many errors when no descriptor is left.
_BACKLOG = 128


@contextmanager
def listening(host: str, port: int) -> Iterator[socket.socket]:
    """Return a socket that listens at `host` and `port` (0: a free one); OSError if it cannot."""
    family, kind, protocol, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    with socket.socket(family, kind, protocol) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(place)
        listener.listen(_BACKLOG)
        yield listener


def server_of(root: Path, guard: Guard) -> uvicorn.Server:
    """Return the server of a workspace's console; `run(sockets=[...])` serves until
    `should_exit`."""
    # What a browser may call itself stays with the guard: no header of a proxy changes it.
    return uvicorn.Server(
        uvicorn.Config(
            create_app(root, guard),
            http=connections(most_connections()),
            backlog=_BACKLOG,
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,
            ws="none",
            reset_contextvars=True,  # no request sees who acted in the one before it
            timeout_graceful_shutdown=5,
        )
    )


def serve_console(root: Path, guard: Guard, place: socket.socket) -> None:
    """Serve the console of the workspace folder `root` at a listening socket until SIGINT or
    SIGTERM."""
    logging.basicConfig(level=logging.WARNING, handlers=[Sparing()])
    raise_descriptor_limit()
    threading.Thread(target=prepare, name="prepare", daemon=True).start()
    server_of(root, guard).run(sockets=[place])
