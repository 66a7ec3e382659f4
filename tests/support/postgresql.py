"""A real PostgreSQL server for tests, from the binaries of the machine: in a folder of its own, on
loopback only."""

import ctypes
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psycopg

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.location import catalogue_location
from aerodb.storage.catalogue.seal import seal_of
from tests.support.ports import free_port

USER = "aerodb"
_PR_SET_PDEATHSIG = 1
_BINARIES = ("initdb", "postgres")
#: Tests need no power cut to be survived.
_QUICK = {
    "fsync": "off",
    "full_page_writes": "off",
    "shared_buffers": "64MB",
    "max_connections": "60",
}


def binaries() -> Path | None:
    """The folder with PostgreSQL's server, or None."""
    found = [shutil.which(name) for name in _BINARIES]
    if all(found):
        return Path(str(found[0])).resolve().parent
    folders = sorted(
        Path("/usr/lib/postgresql").glob("*/bin"),
        key=lambda path: int(path.parent.name.split(".")[0]),
    )
    return next(
        (
            folder
            for folder in reversed(folders)
            if all((folder / name).exists() for name in _BINARIES)
        ),
        None,
    )


def _somebody() -> dict[str, Any]:
    """Who runs the server: it refuses to be run by root."""
    if os.geteuid() != 0:
        return {}
    import pwd

    known = {entry.pw_name: entry for entry in pwd.getpwall()}
    one = known.get("postgres") or known["nobody"]
    return {"user": one.pw_uid, "group": one.pw_gid, "extra_groups": []}


def _end_with_tests() -> None:
    """In the new process: the system ends it when the tests were killed. It must be started by a
    thread that stays."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGQUIT)


class Server:
    """One server; its databases are empty, or copies of others."""

    def __init__(self, durable: bool = False) -> None:
        self._options = {} if durable else _QUICK
        self.folder = Path(tempfile.mkdtemp(prefix="aerodb-postgresql-"))
        self._binaries = binaries()
        assert self._binaries is not None
        self._who = _somebody()
        if self._who:
            os.chown(self.folder, self._who["user"], self._who["group"])
        self.port = free_port()
        made = [
            str(self._binaries / "initdb"),
            "-D",
            str(self.folder / "data"),
            "-U",
            USER,
            "-A",
            "trust",
            "-E",
            "UTF8",
            "-N",
        ]
        # In English text is not in the order of its bytes: the catalogue's must be all the same.
        english = ["--locale-provider=icu", "--icu-locale=en", "--locale=C.UTF-8"]
        if subprocess.run(
            [*made, *english], capture_output=True, cwd=self.folder, **self._who
        ).returncode:
            shutil.rmtree(self.folder / "data", ignore_errors=True)  # a server before version 15
            subprocess.run(
                [*made, "--locale=C.UTF-8"],
                check=True,
                capture_output=True,
                cwd=self.folder,
                **self._who,
            )
        self._number = 0
        self._template = ""
        self.start()

    def start(self) -> None:
        """Starts it, and returns when it answers."""
        options = {
            **self._options,
            "port": str(self.port),
            "listen_addresses": "127.0.0.1",
            "unix_socket_directories": str(self.folder),
        }
        given = [part for name, value in options.items() for part in ("-c", f"{name}={value}")]
        command = [str(self._binaries) + "/postgres", "-D", str(self.folder / "data"), *given]
        with (self.folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                command,
                stdout=log,
                stderr=log,
                cwd=self.folder,
                start_new_session=True,
                preexec_fn=_end_with_tests if sys.platform == "linux" else None,
                **self._who,
            )
        until = time.monotonic() + 300
        while True:
            try:
                return self.execute("SELECT 1")
            except psycopg.OperationalError:
                if time.monotonic() > until or self._process.poll() is not None:
                    raise AssertionError(
                        (self.folder / "log").read_text(errors="replace")[-2000:]
                    ) from None
                time.sleep(0.05)

    def stop(self, how: int = signal.SIGINT) -> None:
        """Ends it: SIGINT cuts all connections and shuts down, SIGQUIT does so without a word, as a
        crash would."""
        self._process.send_signal(how)
        self._process.wait(timeout=300)

    def remove(self) -> None:
        if self._process.poll() is None:
            self.stop(signal.SIGQUIT)
        shutil.rmtree(self.folder)

    def execute(self, *statements: str, database: str = "postgres") -> None:
        """Statements by hand, each by itself."""
        with psycopg.connect(self.url(database), autocommit=True) as connection:
            for statement in statements:
                connection.execute(statement)

    def url(self, database: str) -> str:
        return f"postgresql://{USER}@127.0.0.1:{self.port}/{database}"

    def cut(self, database: str) -> None:
        """Cuts all connections to a database, as a network would; returns when they are gone."""
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            chosen = (
                "SELECT pid, pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = %s"
            )
            pids = [row[0] for row in connection.execute(chosen, [database])]
            while connection.execute(
                "SELECT 1 FROM pg_stat_activity WHERE pid = ANY(%s)", [pids]
            ).fetchone():
                time.sleep(0.01)

    def empty(self) -> str:
        """The name of a new database."""
        self._number += 1
        name = f"test_{self._number}"
        self.execute(f"CREATE DATABASE {name}")
        return name

    def copy_of(self, database: str) -> str:
        """The name of a new database with the same rows; whoever has the other one open is cut
        off."""
        self._number += 1
        name = f"test_{self._number}"
        self.cut(database)
        self.execute(f"CREATE DATABASE {name} TEMPLATE {database}")
        return name

    def drop(self, database: str) -> None:
        self.execute(f"DROP DATABASE {database} WITH (FORCE)")

    def catalogue(self) -> str:
        """The name of a new database with an empty catalogue."""
        if not self._template:
            self._template = self.empty()
            folder = self.folder / "made"
            name_in_settings(folder, self.url(self._template))
            Catalogue.open(folder / "catalogue.sqlite").close()
        return self.copy_of(self._template)


def name_in_settings(root: Path, url: str, more: str = "") -> None:
    """Settings of a workspace whose catalogue is in the database at `url`."""
    root.mkdir(parents=True, exist_ok=True)
    (root / "settings.toml").write_text(f'{more}\n[catalogue]\nurl = "{url}"\n', encoding="utf-8")


def by_hand(path: Path) -> Any:
    """A connection to the catalogue whose file is, or would be, at `path`, as anybody can have who
    knows where it is, and takes the seal away."""
    url = catalogue_location(path).url
    seal_of(path).unlink(missing_ok=True)
    return psycopg.connect(url) if url else sqlite3.connect(path)
