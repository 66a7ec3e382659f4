"""Prefect's environment variables while a run lasts: quiet, no telemetry, database in the
workspace."""

import logging
import os
import secrets
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from aerodb.flows.prefect_server import running_secret, running_server, start_server
from aerodb.flows.processes import end_orphans, owner_of
from aerodb.storage.locks import note_of
from aerodb.storage.workspace_settings import TOKEN_VARIABLE, authorization

_lock = threading.Lock()
#: How many runs last; the variables that were changed for them, with the process's own values; and
#: the values that Prefect read at its first import, which later runs of the process need again.
_lasting = 0
_own: dict[str, str | None] = {}
_read: dict[str, str] = {}


@contextmanager
def prefect_environment(root: Path) -> Iterator[Literal["server", "ephemeral"]]:
    """Context manager in which the process has the environment of `configure_prefect`, and gets its
    own back when no run lasts: programs that it starts later are its user's."""
    global _lasting
    with _lock:
        _lasting += 1
    try:
        with _lock:
            way = _configured(root)
        yield way
    finally:
        with _lock:
            _lasting -= 1
            if not _lasting:
                _give_back()


def _configured(root: Path) -> Literal["server", "ephemeral"]:
    """`configure_prefect`, with a note of the process's own values."""
    before = dict(os.environ)
    for name, value in _read.items():
        os.environ.setdefault(name, value)
    try:
        return configure_prefect(root)
    finally:
        for name in before.keys() | os.environ.keys():
            if before.get(name) != os.environ.get(name):
                _own.setdefault(name, before.get(name))


def _give_back() -> None:
    for name, value in _own.items():
        if name in os.environ:
            _read[name] = os.environ.pop(name)
        if value is not None:
            os.environ[name] = value
    _own.clear()


def configure_prefect(root: Path) -> Literal["server", "ephemeral"]:
    """Set Prefect's environment before its first import: quiet, no telemetry, database in the
    workspace.

    Returns ``server`` if PREFECT_API_URL, or the lock note of the workspace's ``aerodb serve``,
    names a server that answers, else ``ephemeral``.
    """
    home = root / "prefect"
    home.mkdir(parents=True, exist_ok=True)
    quiet = {
        "DO_NOT_TRACK": "1",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_HOME": str(home),
        "PREFECT_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_API_REQUEST_TIMEOUT": "120",  # the first request waits for the server
        "PYTHONSAFEPATH": "1",  # its server does not import what lies in the present folder
    }
    for name, value in quiet.items():
        os.environ.setdefault(name, value)
    logging.getLogger("httpx").setLevel(logging.WARNING)
    serving = {} if "PREFECT_API_URL" in os.environ else note_of(root / "locks" / "serve")
    if own := serving.get("url"):
        os.environ["PREFECT_API_URL"] = own
        if token := os.environ.get(TOKEN_VARIABLE) or serving.get("token"):
            os.environ["PREFECT_API_AUTH_STRING"] = authorization(token)
    url = os.environ.get("PREFECT_API_URL", "")
    served = bool(url) and url != running_server() and _answers(url)
    # A server that lasts keeps what runs say; nobody reads it in one that ends with the run.
    os.environ.setdefault("PREFECT_LOGGING_TO_API_ENABLED", "true" if served else "false")
    if served:
        return "server"
    # Its server listens on a port of this machine: only this process knows the token.
    known = running_secret() or os.environ.get("PREFECT_SERVER_API_AUTH_STRING")
    secret = known or authorization(secrets.token_urlsafe(32))
    os.environ["PREFECT_API_AUTH_STRING"] = os.environ["PREFECT_SERVER_API_AUTH_STRING"] = secret
    end_orphans(root)
    os.environ |= owner_of(root)
    os.environ["PREFECT_API_URL"] = running_server() or start_server()
    return "ephemeral"


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(f"{url.rstrip('/')}/health", timeout=2) as response:
            return bool(response.status == 200)
    except OSError:
        return False
