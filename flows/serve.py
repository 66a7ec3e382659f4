"""``aerodb serve``: run a Prefect server and a runner, announce new logs, clean up after crashes.

Only one serves a workspace. Prefect is not imported here: a failure inside Prefect ends a child
process, which is restarted.
"""

import os
import secrets
import shutil
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Any, Final
from urllib.error import HTTPError

from aerodb.errors import AeroError, StoreError
from aerodb.flows.orchestrator import OrchestratorClient, clear_up, emit_arrival, is_awaited
from aerodb.flows.prefect_server import place_database
from aerodb.flows.processes import Child, claimed, end_orphans, environment_of, free_port
from aerodb.storage.inbox import InboxFile, rescan_inbox
from aerodb.storage.locks import Lock, is_held, note_of, take
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import FILE, checked_token, load_settings
from aerodb.tasks.steps import deliver, files_of_inbox, mark_ended
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

_BEAT: Final = 1.0
_CLEAR_UP_EVERY: Final = 30.0
#: Delay before the same files are announced again [s], in case no run came of it.
_REMIND: Final = 20.0
#: Delay before files are announced again when more have arrived [s]: the server needs a moment to
#: turn an event into a run.
_PAUSE: Final = 5.0
#: Delay [s] after a failed sweep (a full disk, for example), and the longest after many failures.
_AFTER_FAILURE: Final = 60.0
_AT_MOST: Final = 3600.0
_START_SECONDS: Final = 120.0
#: If the clock is set back by more than this [s], Prefect would wait for times already planned.
_SET_BACK: Final = 60.0

Say = Callable[[str], None]


class Server:
    """One ``aerodb serve``: the server, the runner, and the loop that supervises them."""

    def __init__(self, workspace: Workspace, lock: Lock, say: Say) -> None:
        self._workspace, self._lock, self._say = workspace, lock, say
        self._access: WorkspaceAccess = access_workspace(str(workspace.root))
        self._settings = load_settings(workspace.root, self._vehicles())
        given = checked_token(self._settings.serve, dict(os.environ))
        # Without one of the user's, the next best: others on this machine do not know it, and it
        # ends with this service.
        token = given or secrets.token_urlsafe(32)
        self._secret = {} if given else {"token": token}
        host, port = self._settings.serve.host, free_port(self._settings.serve)
        reached = f"[{host}]" if ":" in host else {"0.0.0.0": "127.0.0.1"}.get(host, host)
        self.client = OrchestratorClient(f"http://{reached}:{port}/api", token)
        environment = environment_of(workspace, self.client.url, token)
        start = [sys.executable, "-m", "aerodb.flows.prefect_server", host, str(port)]
        self._server = Child("server", start, environment, workspace.prefect)
        run = "from aerodb.flows.deployments import main; main()"
        self._runner = Child(
            "runner",
            [sys.executable, "-c", run, str(workspace.root)],
            environment,
            workspace.prefect,
        )
        self._told: tuple[float, frozenset[Any]] = (0.0, frozenset())
        self._cleared = 0.0
        self._delivering = threading.Thread()
        self._failures: list[str] = []
        self._written = self._settings_written()
        self._clock = _clock()
        self._since: dict[Any, float] = {}
        self._has_room = True
        if orphans := end_orphans(workspace.root):
            say(f"{orphans} processes of one that was killed were ended")

    def _vehicles(self) -> tuple[str, ...]:
        return tuple(row.name for row in self._access.catalogue.vehicles())

    def _settings_written(self) -> int:
        try:
            return (self._workspace.root / FILE).stat().st_mtime_ns
        except OSError:
            return 0

    def run(self, stopping: threading.Event) -> None:
        """Run until `stopping` is set; StoreError if the server does not start."""
        for ended in mark_ended(self._access):
            self._say(f"run {ended['run'][:12]} of {ended['flow']} had crashed")
        try:
            self._start(stopping)
            while not stopping.wait(_BEAT):
                self._beat(stopping)
        finally:
            self._stop()

    def _start(self, stopping: threading.Event) -> None:
        place_database(self._workspace.prefect / "prefect.db")
        self._server.start()
        until = time.monotonic() + _START_SECONDS
        while not self.client.healthy():
            if stopping.wait(0.2):
                return
            if not self._server.alive or time.monotonic() > until:
                where = str(self._workspace.prefect / "server.log")
                raise StoreError(
                    "the Prefect server did not start", where, "its last lines say why"
                )
        self._require_own()
        clear_up(self.client, self._workspace, at_start=True)
        self._runner.start()
        note = {
            "pid": os.getpid(),
            "url": self.client.url,
            "since_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        self._lock.note(note | self._secret)
        self._say(
            f"serving {self._workspace.root} at {self.client.url}; logs go to"
            f" {self._workspace.inbox}/<vehicle>/"
        )

    def _require_own(self) -> None:
        """Raise StoreError if the server that answers does not know the token: it is another's."""
        try:
            is_awaited(self.client)
        except HTTPError as error:
            if error.code != HTTPStatus.UNAUTHORIZED:
                raise
            raise StoreError(
                f"another server answers at {self.client.url}",
                f"{FILE}: serve",
                "set another port, or 0 for any free one",
            ) from error

    def _beat(self, stopping: threading.Event) -> None:
        """Once a second: restart dead processes, reload settings, look at the inbox, clean up
        crashes."""
        try:
            self._follow_clock(stopping)
            self._watch_disk()
            for child in (self._server, self._runner):
                child.keep_going(self._say)
            self._read_settings()
            if self._has_room:
                self._watch()
            if time.monotonic() - self._cleared > _CLEAR_UP_EVERY:
                self._cleared = time.monotonic()
                mark_ended(self._access)
                clear_up(self.client, self._workspace, at_start=False)
                self._deliver()
        except (AeroError, OSError) as error:
            self._say(
                f"postponed: {error}"
            )  # the next beat tries again: no error may end the service
        except Exception as error:  # nor may an unexpected error
            self._say(f"postponed: {type(error).__name__}: {error}")

    def _follow_clock(self, stopping: threading.Event) -> None:
        """Restart everything if the system clock was set back.

        The services of Prefect's server would otherwise sleep until the clock has caught up, and no
        scheduled run would start in the meantime.
        """
        before, self._clock = self._clock, _clock()
        if self._clock > before - _SET_BACK:
            return
        self._say(
            f"the clock was set back by {before - self._clock:.0f} s: server and runner are"
            " restarted"
        )
        self._runner.stop(4.0)
        self._server.stop(4.0)
        self._start(stopping)

    def _watch_disk(self) -> None:
        """Say once that the disk is full, and once that it is not: meanwhile no log is announced,
        because its run would only fail."""
        free, reserve = shutil.disk_usage(self._workspace.root).free, self._settings.limits.reserve
        if (free >= reserve) == self._has_room:
            return
        self._has_room = free >= reserve
        self._say(
            f"{free / 1e6:.0f} MB are free on the disk: logs are ingested again"
            if self._has_room
            else f"{free / 1e6:.0f} MB are free on the disk, less than [limits] reserve"
            f" ({reserve / 1e6:.0f} MB): logs wait until there is room"
        )

    def _deliver(self) -> None:
        """Deliver queued notifications in a thread: a receiver may take its time to answer."""
        if not self._delivering.is_alive():
            root = str(self._workspace.root)
            self._delivering = threading.Thread(
                target=_delivered, args=(root, self._say), daemon=True
            )
            self._delivering.start()

    def _read_settings(self) -> None:
        """Reload changed settings if they are valid, and restart the runner with them."""
        written = self._settings_written()
        if written == self._written:
            return
        self._written = written
        self._settings = load_settings(self._workspace.root, self._vehicles())
        self._say(f"{FILE} was reloaded")
        self._runner.stop(5.0)
        self._runner.start()

    def _watch(self) -> None:
        """Announce complete logs to the server, unless a sweep is already running."""
        ready = [entry for entry in self._look() if entry.state in ("ready", "refused")]
        files = frozenset(entry.file for entry in ready)
        if not ready or is_held(self._workspace.lock("inbox")):
            return
        at, told = self._told
        if time.monotonic() - at < (_REMIND if files <= told else _PAUSE) or self._failed_just_now(
            files <= told
        ):
            return
        if is_awaited(self.client):
            return
        emit_arrival(self.client, dict(Counter(entry.vehicle for entry in ready)))
        self._told = (time.monotonic(), files)

    def _look(self) -> list[InboxFile]:
        """Return the files in the inbox; one unchanged for long enough is ready, whatever its time
        stamps."""
        entries, now = files_of_inbox(self._access, self._settings, wait=False), time.monotonic()
        self._since = {entry.file: self._since.get(entry.file, now) for entry in entries}
        settle = self._settings.inbox.settle
        return [
            again
            for entry in entries
            for again in rescan_inbox([entry], now - self._since[entry.file], settle)
        ]

    def _failed_just_now(self, nothing_new: bool) -> bool:
        """Return whether the last sweep failed (no room, for example) and the next one must wait.

        The delay doubles with each failure, but not if new files have arrived.
        """
        last = self._access.catalogue.newest_run(["sweep_flow", "nightly_flow"])
        if last is None or last.state != "failed" or last.ended_utc is None:
            self._failures = []
            return False
        if last.id not in self._failures:
            self._failures.append(last.id)
        wait = (
            min(_AFTER_FAILURE * 2 ** (len(self._failures) - 1), _AT_MOST)
            if nothing_new
            else _AFTER_FAILURE
        )
        return 0.0 <= (datetime.now(UTC) - last.ended_utc).total_seconds() < wait

    def _stop(self) -> None:
        """Stop the runner, mark its runs as cancelled, and stop the server."""
        self._runner.stop(4.0)
        mark_ended(self._access, "cancelled", "aerodb serve was stopped")
        if self.client.healthy():
            try:
                clear_up(self.client, self._workspace, at_start=True)
            except OSError as error:
                self._say(f"left for the next start: {error}")
        self._server.stop(4.0)


def _clock() -> float:
    """Return the time of day minus the time since boot: constant until the clock is set."""
    return time.time() - time.monotonic()


def _delivered(root: str, say: Say) -> None:
    try:
        deliver(root, workspace=root, run="")
    except Exception as error:  # the next one tries again
        say(f"not delivered yet: {type(error).__name__}: {error}")


def serve(workspace: Workspace, say: Say) -> None:
    """Serve a workspace until SIGTERM or SIGINT; StoreError if another ``aerodb serve`` does
    already."""
    lock = take(workspace.lock("serve"))
    if lock is None:
        other = note_of(workspace.lock("serve"))
        who = (
            f"process {other['pid']} at {other['url']}"
            if "pid" in other
            else "a process that is just starting"
        )
        raise StoreError(
            f"another aerodb serve runs on this workspace: {who}",
            str(workspace.root),
            "stop that one first",
        )
    stopping = threading.Event()
    before = {
        number: signal.signal(number, lambda *_: stopping.set())
        for number in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        lock.note({})
        with claimed(load_settings(workspace.root).serve):
            Server(workspace, lock, say).run(stopping)
        say("stopped")
    finally:
        lock.release()
        for number, handler in before.items():
            signal.signal(number, handler)
