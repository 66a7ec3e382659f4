"""Prefect's server as aerodb starts it: of one process, for runs that no other server
orchestrates, or on a given port, for ``aerodb serve``.

Prefect starts one by itself, but only when its first request is made: after its client was
imported, with a poll until it answers, and for every new workspace with two hundred migrations of
its database. Here the server starts beside the imports, requests wait in the queue of a socket
that listens already, and a new workspace gets a copy of a migrated, empty database. The process is
``python -m aerodb.flows.prefect_server DESCRIPTOR`` and ends with the one that started it, or
``python -m aerodb.flows.prefect_server HOST PORT``.
"""

import atexit
import gc
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import urllib.request
from collections.abc import Mapping
from contextlib import closing, suppress
from http import HTTPStatus
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

#: Settings of the server beside those of its client: no pages, only the services that runs need.
_SETTINGS: Final = {
    "PREFECT_UI_ENABLED": "0",
    "PREFECT__SERVER_EPHEMERAL": "1",
}
#: The same where the database is as the template: what a start would look for is in it.
_CURRENT: Final = {
    "PREFECT_API_DATABASE_MIGRATE_ON_START": "false",
    "PREFECT_API_BLOCKS_REGISTER_ON_START": "false",
}
#: What names another database than that in PREFECT_HOME: the server makes and updates that one.
_ELSEWHERE: Final = (
    "PREFECT_API_DATABASE_CONNECTION_URL",
    "PREFECT_SERVER_DATABASE_CONNECTION_URL",
)
#: Wait [s] of a client whose request met a transaction of another: they last milliseconds.
_BUSY_SECONDS: Final = 0.2
#: Longest wait [s] for the server to end by itself.
_END_SECONDS: Final = 5.0
#: Longest wait [s] for a server that makes its database first.
_FIRST_SECONDS: Final = 300.0

_started: tuple[str, "subprocess.Popen[bytes]", int] | None = None
#: What the server of this process asks of who calls it.
_secret = ""


def running_server() -> str:
    """Return the URL of this process's server; empty if none was started, or it has ended."""
    if _started is None or _started[2] != os.getpid() or _started[1].poll() is not None:
        return ""
    return _started[0]


def running_secret() -> str:
    """Return what this process's server was told to ask of who calls it; empty without either."""
    return _secret if running_server() else ""


def start_server() -> str:
    """Start this process's server, and return its URL at once: requests wait until it answers.
    Its settings are those of the environment, its files in PREFECT_HOME."""
    global _started, _secret
    database = Path(os.environ["PREFECT_HOME"]) / "prefect.db"
    place_database(database)
    own = os.environ.keys().isdisjoint(_ELSEWHERE)
    known = _CURRENT if own and _revision(database) == _revision(_template()) != "" else {}
    url, process = _launched({**known, **os.environ})
    _started = (url, process, os.getpid())
    _secret = os.environ.get("PREFECT_SERVER_API_AUTH_STRING", "")
    atexit.register(_stop, process, os.getpid())
    return url


def _launched(environment: Mapping[str, str]) -> "tuple[str, subprocess.Popen[bytes]]":
    """URL and process of a server that listens on a free port of this machine."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(128)
        port, number = listening.getsockname()[1], listening.fileno()
        process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(number)],
            env={**environment, **_SETTINGS},
            stdin=subprocess.PIPE,  # closed when this process ends, however it does
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[number],
        )
    return f"http://127.0.0.1:{port}/api", process


def _stop(process: "subprocess.Popen[bytes]", owner: int) -> None:
    """End the server of this process; one that a forked copy of it sees is not its own."""
    if owner != os.getpid():
        return
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(_END_SECONDS)
    process.kill()
    process.wait()


def _template() -> Path:
    """Where the empty database of this Prefect is kept, in the environment it is installed in."""
    return Path(sys.prefix) / "share" / "aerodb" / f"prefect-{version('prefect')}.db"


def place_database(path: Path) -> None:
    """Copy the empty database to `path`, unless there is one, or no template: then the server
    makes it."""
    template = _template()
    if path.exists() or not template.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder, suppress(FileExistsError):
        os.link(shutil.copyfile(template, Path(folder) / path.name), path)


def _revision(path: Path) -> str:
    """The revision of the schema of a database; empty where there is none."""
    if not path.exists():
        return ""
    with closing(sqlite3.connect(path)) as database, suppress(sqlite3.Error):
        return str(database.execute("SELECT version_num FROM alembic_version").fetchone()[0])
    return ""


def make_template() -> None:
    """Keep the empty database of a server of the installed Prefect for new workspaces; a step of
    ``make install``."""
    template = _template()
    if template.exists():
        return
    template.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=template.parent) as folder:
        own = {name: text for name, text in os.environ.items() if not name.startswith("PREFECT_")}
        settings = {
            "PREFECT_HOME": folder,
            "DO_NOT_TRACK": "1",
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        }
        url, process = _launched(own | settings)
        try:
            with urllib.request.urlopen(f"{url}/health", timeout=_FIRST_SECONDS):
                pass
        finally:
            _stop(process, os.getpid())
        whole = Path(folder) / "whole.db"
        with closing(sqlite3.connect(Path(folder) / "prefect.db")) as database:
            database.execute("VACUUM INTO ?", (str(whole),))
        whole.replace(template)


def main() -> None:
    """Serve on the listening socket whose descriptor is the argument, or at host and port."""
    gc.disable()  # nothing of what is imported becomes garbage: a sixth of the time
    import uvicorn
    from prefect.server.api.server import create_app

    application = _with_short_waits(create_app(final=True))
    gc.freeze()
    gc.enable()
    if len(sys.argv) > 2:
        uvicorn.run(application, host=sys.argv[1], port=int(sys.argv[2]), log_level="warning")
        return
    threading.Thread(target=_end_with_parent, daemon=True).start()
    config = uvicorn.Config(application, log_level="error", lifespan="on")
    uvicorn.Server(config).run(sockets=[socket.socket(fileno=int(sys.argv[1]))])


def _with_short_waits(app: Any) -> Any:
    """The ASGI application with a short wait in its answers 503, which it gives when another of
    its own transactions holds SQLite: without one, its client sleeps 2 s, then 4 s, and so on."""

    async def application(scope: Any, receive: Any, send: Any) -> None:
        async def answer(message: Any) -> None:
            if message.get("status") == HTTPStatus.SERVICE_UNAVAILABLE:
                wait = (b"retry-after", str(_BUSY_SECONDS).encode())
                message = {**message, "headers": [*message.get("headers", ()), wait]}
            await send(message)

        await app(scope, receive, answer)

    return application


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
