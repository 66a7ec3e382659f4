"""Every command that writes, and the services, killed (SIGKILL) at random moments while at work.

``python -m tests.campaigns.kills --kills 300 --seed 1 --to kills.jsonl`` kills in turn each command
of `COMMANDS`, appends a line of JSON per kill, and prints a table; ``--report FILE ...`` prints it
of files. A command begins on a copy of a prepared workspace, and is killed some time after it has
begun to write there: its process alone, or its process group. Then queries must answer, no file and
no row may be damaged, and the same command again must end in the workspace of an undisturbed run.
"""

import argparse
import json
import lzma
import os
import shutil
import signal
import sqlite3
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import typer

from aerodb.flows.cli.main import app
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.locks import is_held
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.support import consistent_flights
from tests.support.end_to_end import environment
from tests.support.forking import Forked, run_forked
from tests.support.glider_runs import rows
from tests.support.object_service import ObjectService, object_service
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.small_glider import NAME, state_of, write_files

#: What a kill may leave behind until the command is done again: nothing that anybody could take
#: for the truth.
HARMLESS: Final = {"half-written", "orphan"}
#: Commands that write neither into a workspace nor beside it.
READS: Final = {
    "status", "verify", "vehicle list", "vehicle show", "log inspect", "flight list",
    "flight show", "version list", "version show", "version history", "version evaluate",
    "version lineage", "version impact", "version diff",
    "version trim", "version modes", "version sweep", "calibration list", "calibration show",
    "user list",
}  # fmt: skip
TOKEN: Final = "a-token-for-the-campaign"
#: A process group of its own, as a shell gives to each command.
_CODE: Final = "import os; os.setsid(); from aerodb.flows.cli import main; main()"
_LONGEST: Final = 300.0
_SERVED: Final = """\
[serve]
port = 0
[inbox]
settle = "0.2 s"
[nightly]
cron = "* * * * * */10"
[loop]
after = 3
run = ["update"]
model = "increments.toml"
"""


@dataclass(frozen=True)
class Command:
    """A command that writes: the workspace that it starts from, and its arguments.

    prepare : what is done to each copy of the workspace before. once : that a second run would do
    more than repeat the first. done : for a service: asked again and again, whether it has done
    what it is there for.
    """

    base: str
    arguments: tuple[str, ...]
    prepare: Callable[["Place"], None] = lambda _: None
    once: bool = False
    done: Callable[["Place"], bool] | None = None


@dataclass
class Place:
    """Folder of one trial: ``w`` is the workspace, and the commands run in the folder itself."""

    here: Path
    files: Path
    environment: dict[str, str] = field(default_factory=environment)
    #: Requests of this trial to a service.
    sent: list[threading.Thread] = field(default_factory=list)

    @property
    def workspace(self) -> Workspace:
        return Workspace.open(self.here / "w")

    def arguments(self, given: Iterable[str]) -> list[str]:
        """The arguments of the command line, with the names of files and ids put in."""
        given = tuple(given)
        port = self.environment.get("TEST_PORT", "")
        known: dict[str, Any] = {"files": self.files, "here": self.here, "port": port}
        if any("{flight}" in part or "{candidate}" in part for part in given):
            with Catalogue.open(self.here / "w" / "catalogue.sqlite") as catalogue:
                known["flight"] = min(row.id for row in catalogue.flights(NAME))
                known["candidate"] = catalogue.names(NAME).get("candidate", "")
        return ["--workspace", str(self.here / "w"), *(part.format(**known) for part in given)]

    def run(self, *given: str) -> tuple[int, str, str]:
        """Exit code, output and errors of a command that nobody kills."""
        done = run_forked(self.arguments(given), self.environment, self.here)
        return done.returncode, done.stdout, done.stderr

    @contextmanager
    def begun(self, given: Iterable[str]) -> Iterator[Forked]:
        """A command that has begun."""
        with (
            (self.here.parent / "said.txt").open("wb") as said,
            Forked(
                self.arguments(given), self.environment, said, said, self.here, _CODE
            ) as process,
        ):
            yield process

    def said(self) -> str:
        return (self.here.parent / "said.txt").read_text(errors="replace")[-3000:]


# What is prepared -------------------------------------------------------------------------------


def _drop(place: Place) -> None:
    folder = place.here / "w" / "inbox" / NAME
    folder.mkdir(parents=True)
    for log in sorted(place.files.glob("flight*.csv")):
        shutil.copy(log, folder)
    shutil.copy(place.files / "model.toml", place.here / "w" / "increments.toml")
    (place.here / "w" / "settings.toml").write_text(_SERVED, encoding="utf-8")


def _objects(place: Place) -> None:
    """A place in the object store of its own for each trial."""
    service = _service()
    place.environment = environment(**service.environment)
    text = f'[store]\nurl = "s3://{service.bucket()}/aerodb"\n'
    (place.here / "w" / "settings.toml").write_text(text, encoding="utf-8")
    os.environ |= service.environment


def _pushed(place: Place) -> None:
    _objects(place)
    assert place.run("store", "push")[0] == 0


def _only_there(place: Place) -> None:
    _pushed(place)
    assert place.run("store", "trim", "--size", "0")[0] == 0


@cache
def _service() -> ObjectService:
    return object_service().__enter__()


def _crashed(place: Place) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from aerodb.storage.catalogue import Catalogue\n"
        "with Catalogue.open(Path(sys.argv[1]) / 'catalogue.sqlite') as catalogue:\n"
        "    catalogue.start_run('flight_flow', how='direct', code_version='x', id='a' * 32,\n"
        "        parameters={'logs': sys.argv[2:], 'vehicle': 'small-glider'})\n"
    )
    logs = map(str, sorted(place.files.glob("flight*.csv")))
    run_forked([str(place.here / "w"), *logs], environment(), code=code).check_returncode()


def _former(place: Place) -> None:
    (place.here / "w").mkdir()
    text = lzma.decompress((ROOT / "tests/storage/catalogue/former/r0001.sql.xz").read_bytes())
    with closing(sqlite3.connect(place.here / "w" / "catalogue.sqlite")) as raw:
        raw.executescript(text.decode("utf-8"))


_INGEST: Final = ("flight", "ingest", *(f"{{files}}/flight{k}.csv" for k in (1, 2, 3)))
_BESIDE: Final = ("--vehicle", consistent_flights.NAME)
_ACCEPT: Final = ("alpha_slope", "zero_offset", "pitch_rate_force")
#: Name -> the workspace that it goes on from, and commands or a function that make it.
BASES: Final[dict[str, tuple[str, tuple[Any, ...]]]] = {
    "none": ("", ()),
    "vehicle": ("none", (("vehicle", "add", "{files}/vehicle.toml"),)),
    "prepared": (
        "vehicle",
        (("database", "import", "{files}/database.toml", "--vehicle", NAME),),
    ),
    "ingested": ("prepared", ((*_INGEST, "--vehicle", NAME, "--direct"),)),
    "updated": (
        "ingested",
        (("update", "--vehicle", NAME, "--model", "{files}/model.toml", "--direct"),),
    ),
    "released": ("updated", (("version", "promote", "{candidate}", "--reason", "proved"),)),
    "users": ("prepared", (("user", "add", "anna", "--role", "release"),)),
    "backed up": ("ingested", (("backup", "{here}/backup"),)),
    "crashed": ("prepared", (_crashed,)),
    "inbox": ("prepared", (_drop,)),
    "former": ("none", (_former,)),
    "sensors": (
        "none",
        (
            ("vehicle", "add", "{files}/sensors/vehicle.toml"),
            ("flight", "ingest", "{files}/sensors/flight0.parquet", "{files}/sensors/flight1.parquet",
             *_BESIDE, "--direct"),
        ),
    ),
}  # fmt: skip


# What services are there for --------------------------------------------------------------------


def _all_taken_in(place: Place) -> bool:
    """The inbox is empty, the update has made its candidate, and no run is under way."""
    inbox = place.here / "w" / "inbox" / NAME
    if any(inbox.iterdir()):
        return False
    with Catalogue.open(place.workspace.catalogue) as catalogue:
        if any(is_held(place.workspace.lock(f"run-{r.id}")) for r in catalogue.runs("running")):
            return False
        return len(catalogue.versions(NAME)) == 2


def _promoted(place: Place) -> bool:
    """The console has answered a promotion."""
    if not place.sent:
        port = int(place.environment["TEST_PORT"])
        candidate = place.arguments(["{candidate}"])[-1]
        place.sent.append(threading.Thread(target=_promote, args=(port, candidate)))
        place.sent[0].start()
    return not place.sent[0].is_alive()


def _promote(port: int, version: str) -> None:
    body = json.dumps({"name": "released", "reason": "proved"}).encode()
    head = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
    url = f"http://127.0.0.1:{port}/api/versions/{version}/promote"
    until = time.monotonic() + _LONGEST
    while time.monotonic() < until:
        try:
            urllib.request.urlopen(urllib.request.Request(url, body, head), timeout=60).close()
            return
        except urllib.error.HTTPError:
            return
        except ConnectionRefusedError:
            return
        except urllib.error.URLError as error:
            if not isinstance(error.reason, ConnectionRefusedError):
                return
            time.sleep(0.05)
        except OSError:
            return


def _port(place: Place) -> None:
    port = str(free_port())
    place.environment = environment(AERODB_TOKEN=TOKEN, TEST_PORT=port)


#: All commands that write; after a comma, another way to run the same one.
COMMANDS: Final[dict[str, Command]] = {
    "vehicle init": Command("none", ("vehicle", "init", "new-glider"), once=True),
    "vehicle add": Command("none", ("vehicle", "add", "{files}/vehicle.toml")),
    "database import": Command(
        "vehicle", ("database", "import", "{files}/database.toml", "--vehicle", NAME)
    ),
    "database inputs": Command("prepared", ("database", "inputs", "released", "--vehicle", NAME)),
    "flight ingest": Command("prepared", (*_INGEST, "--vehicle", NAME, "--direct")),
    "flight ingest, under Prefect": Command("prepared", (*_INGEST, "--vehicle", NAME)),
    "flight retract": Command("ingested", ("flight", "retract", "{flight}", "--reason", "icing"), once=True),
    "update": Command(
        "ingested", ("update", "--vehicle", NAME, "--model", "{files}/model.toml", "--direct")
    ),
    "update, under Prefect": Command(
        "ingested", ("update", "--vehicle", NAME, "--model", "{files}/model.toml")
    ),
    "close-loop": Command(
        "ingested",
        ("close-loop", "--vehicle", NAME, *(p for a in _ACCEPT for p in ("--accept-suspected", a)),
         "--direct"),
    ),
    "recalibrate": Command("sensors", ("recalibrate", *_BESIDE, "--reason", "first", "--direct")),
    "version promote": Command(
        "updated", ("version", "promote", "{candidate}", "--reason", "proved"), once=True
    ),
    "version rollback": Command(
        "released", ("version", "rollback", "--vehicle", NAME, "--reason", "wrong"), once=True
    ),
    "version export": Command(
        "updated",
        ("version", "export", "released", "--output", "{here}/x.dml", "--format", "daveml"),
    ),
    "report flight": Command(
        "ingested", ("report", "flight", "{flight}", "--output", "{here}/report.html")
    ),
    "report update": Command(
        "updated", ("report", "update", "{candidate}", "--output", "{here}/report.html")
    ),
    "report version": Command(
        "updated", ("report", "version", "released", "--output", "{here}/report.html")
    ),
    "nightly": Command("inbox", ("nightly", "--direct")),
    "nightly, under Prefect": Command("inbox", ("nightly",)),
    "retry": Command("crashed", ("retry", "all", "--direct")),
    "demo": Command("none", ("demo", "--flights", "3", "--direct")),
    "store push": Command("ingested", ("store", "push"), _objects),
    "store pull": Command("ingested", ("store", "pull"), _only_there),
    "store trim": Command("ingested", ("store", "trim", "--size", "0"), _pushed),
    "user add": Command("prepared", ("user", "add", "anna", "--role", "ingest"), once=True),
    "user token": Command("users", ("user", "token", "anna"), once=True),
    "user remove": Command("users", ("user", "remove", "anna"), once=True),
    "backup": Command("ingested", ("backup", "{here}/backup")),
    "restore": Command(
        "backed up", ("restore", "{here}/backup", "--workspace", "{here}/restored"), once=True
    ),
    "flight list, of an earlier catalogue": Command("former", ("flight", "list")),
    "web": Command(
        "updated", ("web", "--port", "{port}"), _port, done=_promoted
    ),
    "serve": Command("inbox", ("serve",), done=_all_taken_in),
}  # fmt: skip


def names_of_commands() -> set[str]:
    """All commands of the command line, as people type them."""

    def walk(command: Any, path: tuple[str, ...]) -> Iterator[str]:
        parts = getattr(command, "commands", None)
        if parts is None:
            yield " ".join(path)
        for name, part in (parts or {}).items():
            yield from walk(part, (*path, name))

    return set(walk(typer.main.get_command(app), ()))


# One kill ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Undisturbed:
    """A command that nobody killed: seconds until it began to write and until its end, and what is
    known before and after (`answers`, `picture`)."""

    begins: float
    ends: float
    before: dict[str, Any]
    after: dict[str, Any]
    picture: dict[str, Any]


def picture(place: Place) -> dict[str, Any]:
    """What must be the same as without the kill: ids, keys, verdicts, roles, names and their moves,
    users, numbers of rows, problems, and every file of the store and beside the workspace."""
    found: dict[str, Any] = {"beside": _beside(place)}
    for name in ("w", "restored"):
        root = place.here / name
        if (root / "catalogue.sqlite").is_file():
            found[name] = _content(Workspace.open(root))
    told: dict[str, Any] = json.loads(json.dumps(found))
    return told


def _content(workspace: Workspace) -> dict[str, Any]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        names = [row.name for row in catalogue.vehicles()]
        flights = [row for name in names for row in catalogue.flights(name)]
        versions = [row for name in names for row in catalogue.versions(name)]
        return {
            "vehicles": [(name, catalogue.vehicle(name).sha256) for name in names],
            "flights": sorted((r.id, r.label, r.verdict, str(r.retract_reason)) for r in flights),
            "results": {
                row.id: sorted((r.step, r.key) for r in catalogue.results_of(row.id))
                for row in flights
            },
            "versions": [(row.label, row.id, row.content_sha256) for row in versions],
            "roles": {
                row.id: sorted((use.flight, use.role) for use in catalogue.version_flights(row.id))
                for row in versions
            },
            "moves": [
                (e.name, e.step, e.version, e.previous)
                for name in names
                for e in catalogue.name_history(name)
            ],
            "calibrations": [row.id for name in names for row in catalogue.calibrations(name)],
            "logs": sorted((row.sha256, row.status) for row in catalogue.logs()),
            "users": [(row.name, row.role) for row in catalogue.users()],
            "rows": rows(workspace),
            "problems": sorted(
                (found.kind, found.where) for found in verify(workspace, catalogue).problems
            ),
            "files": {
                name: sha256
                for name, sha256 in state_of(workspace.root).items()
                if name.startswith(("flights/", "results/", "recordings/", "inbox/"))
            },
        }


def _beside(place: Place) -> dict[str, int]:
    """Files beside the workspace, and their sizes; of reports and backups, which say when they were
    made, that they are not empty."""
    return {
        path.relative_to(place.here).as_posix(): path.stat().st_size
        if path.suffix in (".dml", ".toml")
        else min(path.stat().st_size, 1)
        for path in sorted(place.here.rglob("*"))
        if path.is_file() and path.relative_to(place.here).parts[0] not in ("w", "restored")
    }


def answers(place: Place) -> dict[str, Any]:
    """What the queries answer: vehicles, flights, versions, what is released, and the status.

    Raises AssertionError if one does not answer with a document, and exit code 0.
    """
    if not (place.here / "w" / "catalogue.sqlite").is_file():
        return {"vehicles": [], "flights": [], "versions": [], "released": {}, "status": {}}

    def asked(*given: str) -> Any:
        code, output, errors = place.run("--json", *given)
        assert code == 0, (given, errors)
        return json.loads(output)

    vehicles = [entry["vehicle"] for entry in asked("vehicle", "list")]
    lists = {name: asked("version", "list", "--all", "--vehicle", name) for name in vehicles}
    return {
        "vehicles": vehicles,
        "flights": [entry["flight"] for entry in asked("flight", "list")],
        "versions": [entry["version"] for entries in lists.values() for entry in entries],
        "released": {
            name: entry["version"]
            for name, entries in lists.items()
            for entry in entries
            if "released" in entry["names"]
        },
        "status": asked("status"),
    }


def wrong_answers(found: Mapping[str, Any], undisturbed: Undisturbed, place: Place) -> list[str]:
    """What queries answer after a kill that was neither so before nor would be after."""
    wrong = []
    for kind in ("vehicles", "flights", "versions"):
        before, after = (set(each[kind]) for each in (undisturbed.before, undisturbed.after))
        if not before & after <= set(found[kind]) <= before | after:
            wrong.append(f"{kind}: {found[kind]}")
    known = (undisturbed.before["released"].items(), undisturbed.after["released"].items())
    if not set(found["released"].items()) <= set(known[0]) | set(known[1]):
        wrong.append(f"released: {found['released']}")
    if len(found["released"]) < min(map(len, known)):
        wrong.append("released: nothing")
    if found["status"]:
        if found["status"]["running"]:
            wrong.append(f"running: {found['status']['running']}")
        said = {entry["run"] for entry in found["status"]["failed"]}
        if not set(running(place)) <= said:
            wrong.append("status does not tell of the killed run")
    return wrong


def running(place: Place) -> list[str]:
    """Runs without an end in the catalogue, read without aerodb."""
    return [
        str(row[0]) for row in _asked_sqlite(place, "SELECT id FROM runs WHERE state='running'")
    ]


def _asked_sqlite(place: Place, statement: str) -> list[Any]:
    path = place.here / "w" / "catalogue.sqlite"
    if not path.is_file():
        return []
    with closing(sqlite3.connect(path, timeout=60)) as raw:
        try:
            return raw.execute(statement).fetchall()
        except sqlite3.OperationalError as error:
            if "no such table" in str(error):  # killed before the first transaction
                return []
            raise


def trial(
    name: str, base: Path, files: Path, folder: Path, expected: Undisturbed, rng: Any
) -> dict[str, Any]:
    """Kill a command once, repeat it, and return what was found."""
    command, share = COMMANDS[name], 1.0
    while True:
        place = copied(base, files, folder)
        command.prepare(place)
        delay = share * float(rng.uniform()) * (expected.ends - expected.begins)
        group = bool(rng.integers(2))
        if killed(command, place, delay, group):
            break
        share *= 0.7  # it ended before: the machine was slower when it was measured
        assert share > 1e-9, f"{name} ends before it can be killed"
    held = list((place.here / "w" / "locks").glob("run-*"))
    said: dict[str, Any] = {
        "command": name,
        "delay": round(delay, 3),
        "of": round(expected.ends - expected.begins, 3),
        "group": group,
        "under_way": bool(held and running(place)),
        "integrity": [row[0] for row in _asked_sqlite(place, "PRAGMA integrity_check")],
    }
    answered = answers(place)
    said["wrong_answers"] = wrong_answers(answered, expected, place)
    said["bad"] = [p for p in problems(place, expected) if p[0] not in HARMLESS]
    said["again"] = again(command, place, expected)
    shown = picture(place)
    said["differs"] = [
        f"{part}/{key}"
        for part in expected.picture
        for key in expected.picture[part].keys() | shown.get(part, {}).keys()
        if shown.get(part, {}).get(key) != expected.picture[part].get(key)
    ]
    last = answers(place)
    said["lost"] = [
        one for kind in ("flights", "versions") for one in answered[kind] if one not in last[kind]
    ]
    said["still_running"] = last["status"].get("running", [])
    said["left"] = left(place)
    if wrong(said):
        kept = folder / f"wrong-{int(time.time())}"
        shutil.copytree(place.here, kept)
        said["kept"], said["said"] = str(kept), place.said()
    _cleared(place.here)
    return said


def killed(command: Command, place: Place, delay: float, group: bool) -> bool:
    """Kill a command `delay` [s] after it has begun to write; false if it ended before."""
    seen = snapshot(place)
    with place.begun(command.arguments) as process:
        if not _until(lambda: snapshot(place) != seen or _ended(process), command, place):
            raise TimeoutError(f"never began: {place.said()}")
        until = time.monotonic() + delay
        while time.monotonic() < until and not _ended(process):
            if command.done is not None:
                command.done(place)
            time.sleep(0.002)
        if not _ended(process):
            with suppress(ProcessLookupError):
                (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
        code = process.wait(60)
    for request in place.sent:
        request.join()
    place.sent.clear()
    assert code in (-signal.SIGKILL, 0), (code, place.said())
    return code == -signal.SIGKILL


def _until(condition: Callable[[], bool], command: Command, place: Place) -> bool:
    until = time.monotonic() + _LONGEST
    while not condition():
        if time.monotonic() > until:
            return False
        if command.done is not None:
            command.done(place)
        time.sleep(0.001)
    return True


def _ended(process: Forked) -> bool:
    if process.returncode is None:
        with suppress(Exception):
            process.wait(0.0001)
    return process.returncode is not None


def snapshot(place: Place) -> dict[str, tuple[int, int]]:
    """Size and time of each file that a command changes when it has begun to write.

    Not the files by which SQLite reads, and no locks but those of runs. Of a service only those of
    its runs: it also writes before it works.
    """
    found = {}
    for folder, _, names in os.walk(place.here):
        for name in names:
            path = os.path.join(folder, name)
            inside = path.removeprefix(str(place.here / "w") + os.sep)
            if inside.startswith("prefect" + os.sep) or inside == "access.log":
                continue
            if inside.startswith("locks" + os.sep) and not name.startswith("run-"):
                continue
            with suppress(OSError):
                status = os.stat(path)
                if not name.endswith(("-shm", "-wal")) or (status.st_size and name[-1] == "l"):
                    found[path] = (status.st_size, status.st_mtime_ns)
    return found


def again(command: Command, place: Place, expected: Undisturbed) -> str:
    """Repeat a command, unless it has done its work already and would do more; returns what was
    wrong with it."""
    if command.once and picture(place) == expected.picture:
        return ""
    try:
        undisturbed(command, place)
    except (AssertionError, TimeoutError) as error:
        return str(error)
    return ""


def undisturbed(command: Command, place: Place) -> tuple[float, float]:
    """Run a command to its end, a service until it has done what it is there for; seconds until it
    has begun to write, and until the end."""
    seen, start = snapshot(place), time.monotonic()
    with place.begun(command.arguments) as process:
        _until(lambda: snapshot(place) != seen or _ended(process), command, place)
        begins = time.monotonic() - start
        if command.done is None:
            code = process.wait(_LONGEST)
            ends = time.monotonic() - start
        else:
            done = command.done
            if not _until(lambda: done(place) or _ended(process), command, place):
                process.kill()
                raise TimeoutError(f"not done: {place.said()}")
            ends = time.monotonic() - start
            process.send_signal(signal.SIGTERM)
            code = process.wait(_LONGEST)
    for request in place.sent:
        request.join()
    place.sent.clear()
    assert code == 0, (code, place.said())
    return begins, ends


def problems(place: Place, expected: Undisturbed) -> list[tuple[str, str]]:
    """What `aerodb verify` finds beyond what it finds after an undisturbed run."""
    if not (place.here / "w" / "catalogue.sqlite").is_file():
        return []
    with Catalogue.open(place.workspace.catalogue) as catalogue:
        found = verify(place.workspace, catalogue).problems
    known = [tuple(each) for each in expected.picture.get("w", {}).get("problems", [])]
    return [(each.kind, each.where) for each in found if (each.kind, each.where) not in known]


def left(place: Place) -> list[str]:
    """Processes that still run in the folder of a trial a minute after its last command."""
    until = time.monotonic() + 60
    while found := processes(place.here):
        if time.monotonic() > until:
            return found
        time.sleep(0.05)
    return []


def processes(folder: Path) -> list[str]:
    """Arguments of the processes whose working folder is there: children inherit it."""
    found = []
    for each in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if os.readlink(each / "cwd").removesuffix(" (deleted)") == str(folder):
                said = (each / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                if said:  # no zombie
                    found.append(f"{each.name} {said[:200]}")
    return found


def wrong(said: Mapping[str, Any]) -> list[str]:
    """What must not be after a kill, and was."""
    never = ("wrong_answers", "bad", "again", "differs", "lost", "still_running", "left")
    found = [key for key in never if said[key]]
    return found + (["integrity"] if said["integrity"] not in ([], ["ok"]) else [])


def copied(base: Path, files: Path, folder: Path) -> Place:
    here = folder / "trial"
    _cleared(here)
    shutil.copytree(base, here)
    return Place(here, files)


def _cleared(folder: Path) -> None:
    """Remove a folder; a process that has just been killed may still be at its last file there."""
    until = time.monotonic() + 60
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


# The campaign -----------------------------------------------------------------------------------


class Campaign:
    """Workspaces to start from and undisturbed runs, each made when it is first needed."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder, self._files = folder, folder / "files"
        self._rng = np.random.default_rng(seed)
        self._expected: dict[str, Undisturbed] = {}
        write_files(self._files, 3)
        sensors = self._files / "sensors"
        sensors.mkdir()
        (sensors / "vehicle.toml").write_text(consistent_flights.VEHICLE, encoding="utf-8")
        for number in range(2):
            table = consistent_flights.table(
                number, consistent_flights.PLANTED, seconds=30.0, start=40.0 * number
            )
            consistent_flights.log(sensors, f"flight{number}", table)

    def kill(self, name: str) -> dict[str, Any]:
        """Kill a command once, as `trial` says."""
        base = self._base(COMMANDS[name].base)
        return trial(name, base, self._files, self._folder, self._undisturbed(name), self._rng)

    def _base(self, name: str) -> Path:
        base = self._folder / f"base-{name}"
        if not base.exists():
            parent, steps = BASES[name]
            if parent:
                shutil.copytree(self._base(parent), base)
            else:
                base.mkdir()
            place = Place(base, self._files)
            for step in steps:
                if callable(step):
                    step(place)
                    continue
                code, _, errors = place.run(*step)
                assert code == 0, (name, step, errors)
        return base

    def _undisturbed(self, name: str) -> Undisturbed:
        if name not in self._expected:
            command = COMMANDS[name]
            place = copied(self._base(command.base), self._files, self._folder)
            command.prepare(place)
            former = command.base == "former"  # asking would migrate it
            before = None if former else answers(place)
            begins, ends = undisturbed(command, place)
            after = answers(place)
            self._expected[name] = Undisturbed(
                begins, ends, after if before is None else before, after, picture(place)
            )
            assert left(place) == [], name
        return self._expected[name]


def report(lines: Iterable[Mapping[str, Any]]) -> str:
    """The table of kills: per command, and in all."""
    told: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        told.setdefault(line["command"], []).append(line)
    head = "| command | kills | of its group | run under way | lost | damaged | wrong answers | processes left |"
    table = [head, "|---" * 8 + "|"]
    total = [0] * 7
    for name in [*sorted(told), ""]:
        entries = told.get(name, [])
        counts = [
            len(entries),
            sum(e["group"] for e in entries),
            sum(e["under_way"] for e in entries),
            sum(bool(e["lost"]) for e in entries),
            sum(bool(set(wrong(e)) & {"bad", "again", "differs", "integrity"}) for e in entries),
            sum(bool(e["wrong_answers"] or e["still_running"]) for e in entries),
            sum(bool(e["left"]) for e in entries),
        ]
        total = [a + b for a, b in zip(total, counts, strict=True)]
        shown = counts if name else total
        table.append("| " + " | ".join([name or "all", *map(str, shown)]) + " |")
    return "\n".join(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--command", action="append", choices=list(COMMANDS), default=None)
    parser.add_argument("--to", type=Path, default=None)
    parser.add_argument("--report", type=Path, nargs="*", default=None)
    given = parser.parse_args()
    if given.report is not None:
        lines = [
            json.loads(line) for file in given.report for line in file.read_text().splitlines()
        ]
        print(report(lines))
        return
    names = given.command or list(COMMANDS)
    folder = Path(tempfile.mkdtemp(prefix="kills-"))
    campaign, lines = Campaign(folder, given.seed), []
    for number in range(given.kills):
        said = campaign.kill(names[number % len(names)])
        lines.append(said)
        if given.to is not None:
            with given.to.open("a", encoding="utf-8") as file:
                file.write(json.dumps(said) + "\n")
        if found := wrong(said):
            print(f"{said['command']}: {', '.join(found)}: {json.dumps(said)}", flush=True)
    print(report(lines))
    if not any(wrong(said) for said in lines):
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
