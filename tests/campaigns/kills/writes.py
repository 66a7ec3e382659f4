"""Inside a process of a trial: the writes that it makes, and SIGKILL just before one of them.

`arm` reads the environment: ``KILLS_FOLDER`` is the folder of the trial; ``KILLS_RECORD`` a file to
which each write adds a line; ``KILLS_AT`` (``LABEL#K``) the K-th write of that label in a process,
at which ``KILLS_STRUCK`` is written and the trial's command (``KILLS_COMMAND``, set by itself) is killed as ``KILLS_REACH`` says:
``process``, ``group``, ``all`` (every process of the folder), or ``run`` (the process that writes).

A write is an audit event of Python that changes a file of the folder, or a statement of SQLite that
changes its catalogue; not a lock (but those of runs), the access log, or Prefect's own files.
"""

import atexit
import os
import signal
import sqlite3
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final
from urllib.parse import unquote

#: Statement -> which of its words is the table; 0: not told.
_CHANGES: Final = {
    "INSERT": 2, "REPLACE": 2, "DELETE": 2, "UPDATE": 1, "CREATE": 0, "DROP": 0, "ALTER": 0,
}  # fmt: skip
#: Event -> which of its arguments is the path, and which the folder that it is relative to.
_FILES: Final = {
    "os.rename": (1, 3), "os.remove": (0, 1), "os.mkdir": (0, 2), "os.rmdir": (0, 1),
    "os.link": (1, 3), "shutil.rmtree": (0, 1),
}  # fmt: skip
_WRITING: Final = os.O_WRONLY | os.O_RDWR


def arm(command: bool = False) -> None:
    """Watch this process's writes, if the environment asks for it.

    command : this process is the command of the trial (not one that it has started).
    """
    if "KILLS_FOLDER" not in os.environ:
        return
    if command:
        os.environ["KILLS_COMMAND"] = str(os.getpid())
    watch = _Watch(os.environ["KILLS_FOLDER"])
    sys.addaudithook(watch.event)
    sqlite3.connect = sqlite3.dbapi2.connect = watch.connect(sqlite3.connect)
    if command:
        atexit.register(watch.write, "end")


class _Watch:
    def __init__(self, folder: str) -> None:
        self._folder = folder + os.sep
        self._at, _, number = os.environ.get("KILLS_AT", "").partition("#")
        self._number = int(number or 0)
        self._record = os.environ.get("KILLS_RECORD", "")
        self._counts: Counter[str] = Counter()

    def event(self, name: str, given: tuple[Any, ...]) -> None:
        if name == "open":
            path, mode, flags = given
            writes = flags & _WRITING if mode is None else set(mode) & set("wax+")
            if writes:
                self._changed("open", path)
        elif name in _FILES:
            path, folder = _FILES[name]
            relative = folder < len(given) and given[folder] not in (-1, None)
            if not relative and (name != "os.mkdir" or not os.path.exists(given[path])):
                self._changed(name.partition(".")[2], given[path])

    def connect(self, to: Callable[..., Any]) -> Callable[..., Any]:
        """`sqlite3.connect`, with a trace of the statements that are run in the folder."""

        def connected(database: Any, *given: Any, **named: Any) -> Any:
            connection = to(database, *given, **named)
            if self._inside(database):
                connection.set_trace_callback(self._statements())
            return connection

        return connected

    def _inside(self, path: Any) -> str:
        """Path below the folder; empty for what is not counted."""
        if not isinstance(path, str | bytes | os.PathLike):
            return ""
        text = os.fsdecode(path)
        if text.startswith("file:"):
            text = unquote(text[5:].partition("?")[0])
        text = os.path.abspath(text)
        if not text.startswith(self._folder):
            return ""
        inside = text.removeprefix(self._folder)
        parts = inside.split(os.sep)[1:]
        uncounted = parts[:1] in (["prefect"], ["access.log"]) or (
            parts[:1] == ["locks"] and not parts[-1].startswith("run-")
        )
        return "" if uncounted else inside

    def _changed(self, verb: str, path: Any) -> None:
        if inside := self._inside(path):
            parts = inside.split(os.sep)
            named = parts[1] if parts[0] in ("w", "restored") and len(parts) > 2 else parts[0]
            self.write(f"{verb} {'tmp' if named.endswith('.tmp') else named}")

    def _statements(self) -> Callable[[str], None]:
        """A trace of one connection; the end of a transaction that has only read is no write."""
        changed = False

        def statement(text: str) -> None:
            nonlocal changed
            words = text.replace("(", " ").replace('"', " ").split(None, 3)
            verb = words[0].upper() if words else ""
            if verb in _CHANGES or (verb == "COMMIT" and changed):
                changed = verb != "COMMIT"
                place = _CHANGES.get(verb)
                self.write(f"{verb} {words[min(place, len(words) - 1)]}" if place else verb)

        return statement

    def write(self, label: str) -> None:
        """Count a write that is about to be made; record it, or kill."""
        self._counts[label] += 1
        if self._record:
            _append(self._record, f"{os.getpid()}\t{label}\n")
        if label == self._at and self._counts[label] == self._number:
            struck = os.environ["KILLS_STRUCK"]
            if not os.path.exists(struck):  # each process counts its own
                _append(struck, label)
                strike(
                    int(os.environ["KILLS_COMMAND"]), os.environ["KILLS_REACH"], self._folder[:-1]
                )


def _append(path: str, text: str) -> None:
    file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(file, text.encode())
    os.close(file)


def strike(command: int, reach: str, folder: str) -> None:
    """Kill a command's process, its group, all processes of the folder, or (``run``) this one."""
    with suppress(ProcessLookupError):
        if reach == "run":
            os.kill(os.getpid(), signal.SIGKILL)
        elif reach == "process":
            os.kill(command, signal.SIGKILL)
        elif reach == "group":
            os.killpg(command, signal.SIGKILL)
        else:
            for process in sorted(processes_in(folder), key=lambda pid: pid == os.getpid()):
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)


def processes_in(folder: str) -> dict[int, str]:
    """Process -> its arguments, of those that work in a folder: children inherit it."""
    found = {}
    for name in filter(str.isdecimal, os.listdir("/proc")):
        with suppress(OSError):
            if os.readlink(f"/proc/{name}/cwd").removesuffix(" (deleted)") == folder:
                with open(f"/proc/{name}/cmdline", "rb") as file:
                    said = file.read().replace(b"\0", b" ").decode(errors="replace")
                if said:  # no zombie
                    found[int(name)] = said[:200]
    return found
