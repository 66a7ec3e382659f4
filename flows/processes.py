"""Child processes of `aerodb serve`: environment, port, start, stop and restart."""

import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from aerodb.errors import InputError
from aerodb.storage.catalogue import catalogue_location
from aerodb.storage.urls import resolved, shown
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import (
    FILE,
    TOKEN_VARIABLE,
    ServeSettings,
    authorization,
    load_settings,
)

#: Delay before the first restart [s]; it doubles with each further one.
_FIRST_WAIT: Final = 1.0
#: Longest delay before a restart [s]: a cause that has passed holds nobody up for long.
_LONGEST_WAIT: Final = 60.0
#: A process that has run this long [s] had started well: its next restart is not delayed.
_WELL: Final = 120.0
_LOG_BYTES: Final = 20_000_000
_PR_SET_PDEATHSIG: Final = 1
#: Environment variable of child processes: process, its start, and the workspace folder.
_OWNER: Final = "AERODB_OWNER"
#: Arguments of the processes that Prefect, and `aerodb serve` for it, start.
_OURS: Final = (b"prefect", b"from aerodb.flows.deployments", b"aerodb.flows.prefect_server")


def environment_of(workspace: Workspace, url: str, token: str) -> dict[str, str]:
    """Return the environment of server and runner: Prefect's files in the workspace, no user
    profile."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    settings = {
        "PREFECT_HOME": str(workspace.prefect),
        "PREFECT_PROFILES_PATH": str(workspace.prefect / "profiles.toml"),
        "PREFECT_API_URL": url,
        "PREFECT_API_DATABASE_CONNECTION_URL": database_of(workspace),
        "DO_NOT_TRACK": "1",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_LOGGING_LEVEL": "WARNING",
        "PREFECT_SERVER_LOGGING_LEVEL": "WARNING",
        "PREFECT_LOGGING_TO_API_ENABLED": "true",
        # A year of runs every few minutes must not grow without end.
        "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "events,flow_runs,orphans",
        # its services write side by side, and SQLite lets one after the other
        "PREFECT_API_DATABASE_TIMEOUT": "60",
        "PREFECT_SERVER_UI_ENABLED": str(load_settings(workspace.root).serve.ui).lower(),
        "PREFECT_SERVER_UI_API_URL": url,
        "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(workspace.prefect / "ui"),
        "PREFECT_CLI_COLORS": "false",
        "PYTHONSAFEPATH": "1",  # what lies in the present folder is not imported
    }
    if token:
        secret = authorization(token)
        settings |= {
            "PREFECT_SERVER_API_AUTH_STRING": secret,
            "PREFECT_API_AUTH_STRING": secret,
            TOKEN_VARIABLE: token,
        }
    return {**kept, **settings, **owner_of(workspace.root), "PYTHONUTF8": "1"}


def database_of(workspace: Workspace) -> str:
    """Return the URL of Prefect's own database: a file in the workspace, or ``serve.database``.

    Raises InputError, without the URL, if Prefect cannot use it or if it is the catalogue's.
    """
    where = f"{workspace.root / FILE}: serve.database"
    url = resolved(load_settings(workspace.root).serve.database, where)
    if not url:
        return f"sqlite+aiosqlite:///{workspace.prefect / 'prefect.db'}"
    catalogue = catalogue_location(workspace.catalogue).url
    if catalogue and shown(catalogue) == shown(url):
        raise InputError(
            "is the catalogue's database",
            where,
            "make another database for Prefect: createdb prefect",
        )
    parts = urlsplit(url)
    options = dict(parse_qsl(parts.query))
    if unknown := sorted(set(options) - set(_OPTIONS)):
        raise InputError(
            f"Prefect's database driver does not know the option '{unknown[0]}'",
            where,
            f"known options: {', '.join(_OPTIONS)}",
        )
    query = urlencode({_OPTIONS[name]: value for name, value in options.items()})
    return urlunsplit(parts._replace(scheme="postgresql+asyncpg", query=query))


#: Options of an address, and what asyncpg calls them.
_OPTIONS: Final = {"host": "host", "port": "port", "sslmode": "ssl"}


def free_port(serve: ServeSettings) -> int:
    """Return the port of the settings, or a free one; InputError if it is taken."""
    family = socket.AF_INET6 if ":" in serve.host else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((serve.host, serve.port))
        except OSError as error:
            what = f"cannot listen on {serve.host}, port {serve.port}: {error.strerror or error}"
            raise InputError(
                what, f"{FILE}: serve", "set another port, or 0 for any free one"
            ) from error
        return int(probe.getsockname()[1])


class Child:
    """A process that is restarted with growing delays when it ends; its output goes to a log
    file."""

    def __init__(
        self, name: str, command: Sequence[str], environment: Mapping[str, str], folder: Path
    ) -> None:
        self.name, self._command, self._environment = name, list(command), dict(environment)
        self._log = folder / f"{name}.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._started, self._wait = 0.0, _FIRST_WAIT

    @property
    def alive(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start the process in its own session, so that its children can be ended with it."""
        if self._log.exists() and self._log.stat().st_size > _LOG_BYTES:
            self._log.replace(self._log.with_suffix(".log.1"))
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                self._command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                preexec_fn=end_with_parent,
            )
        self._started = time.monotonic()

    def keep_going(self, say: Callable[[str], None]) -> None:
        """Restart the process if it has ended and the delay is over."""
        if self.alive or self._process is None:
            return
        lived = time.monotonic() - self._started
        if lived > _WELL:
            self._wait = _FIRST_WAIT
        if lived < self._wait:
            return
        say(f"{self.name} ended with {self._process.returncode} and is restarted; see {self._log}")
        self._wait = min(2 * self._wait, _LONGEST_WAIT)
        self.start()

    def stop(self, seconds: float) -> None:
        """Terminate the process; kill it and its children if it has not ended within `seconds`."""
        if self._process is None:
            return
        if self.alive:
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout=seconds)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait(timeout=10)


def end_with_parent() -> None:
    """In a new process: let the system end it when its parent is killed, so that none is
    orphaned. At once: one that ends in order could wait for what it has begun."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def owner_of(workspace: Path) -> dict[str, str]:
    """Return the environment variable by which processes that this one starts for a workspace are
    known as its own."""
    return {_OWNER: f"{os.getpid()} {_start_of(os.getpid())} {workspace}"}


def end_orphans(workspace: Path) -> int:
    """End processes of Prefect that were started for a workspace by a process that is gone, and
    return how many there were. Only Linux tells."""
    count = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            variables = (folder / "environ").read_bytes().split(b"\0")
            arguments = (folder / "cmdline").read_bytes().split(b"\0")
        except OSError:  # it has ended, or is another user's
            continue
        named = _OWNER.encode() + b"="
        owner = next((v[len(named) :] for v in variables if v.startswith(named)), b"")
        parts = os.fsdecode(owner).split(" ", 2)
        if len(parts) != 3 or parts[2] != str(workspace) or not parts[0].isdecimal():
            continue
        if _start_of(int(parts[0])) != parts[1] and any(a.startswith(_OURS) for a in arguments):
            with suppress(OSError):
                os.kill(int(folder.name), signal.SIGKILL)
                count += 1
    return count


def _start_of(process: int) -> str:
    """Return when a process started, in ticks since boot; empty if there is none."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
    return text.rpartition(")")[2].split()[19]


@contextmanager
def claimed(serve: ServeSettings) -> Iterator[None]:
    """Context manager that holds the port of the settings against another `aerodb serve` on this
    machine, from before its server listens. InputError if one holds it already; other systems than
    Linux do not tell."""
    with socket.socket(socket.AF_UNIX) as holder:
        if sys.platform == "linux" and serve.port:
            try:
                holder.bind(f"\0aerodb serve {serve.port}")
            except OSError as error:
                what = f"another aerodb serve on this machine uses port {serve.port}"
                raise InputError(
                    what, f"{FILE}: serve", "set another port, or 0 for any free one"
                ) from error
        yield
