"""All commands of the command line: those that are killed, and those that only read."""

import lzma
import os
import shutil
import signal
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from typing import Any, Final

import typer

from aerodb.flows.cli.main import app
from tests.campaigns.kills import services
from tests.campaigns.kills.places import Place, stores
from tests.campaigns.kills.services import Load
from tests.support import consistent_flights
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.paths import ROOT
from tests.support.small_glider import NAME

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

    prepare : what is done to each copy of the workspace before. ready : before each start. once : that a second run would do
    more than repeat the first. code : its exit code. Of a
    service: done, whether it has done what it is there for; load, what is asked of it meanwhile.
    at_work : whether it is at its work, if that is not its first write.
    """

    base: str
    arguments: tuple[str, ...]
    prepare: Callable[[Place], None] = lambda _: None
    ready: Callable[[Place], None] = lambda _: None
    once: bool = False
    code: int = 0
    done: Callable[[Place, Load | None], bool] | None = None
    at_work: Callable[[Place, Load | None], bool] | None = None
    load: Callable[[Place], AbstractContextManager[Load | None]] = lambda _: nullcontext()


# What is prepared -------------------------------------------------------------------------------


def _drop(place: Place) -> None:
    folder = place.here / "w" / "inbox" / NAME
    folder.mkdir(parents=True)
    for log in sorted(place.files.glob("flight*.csv")):
        shutil.copy(log, folder)
    shutil.copy(place.files / "model.toml", place.here / "w" / "increments.toml")
    (place.here / "w" / "settings.toml").write_text(_SERVED, encoding="utf-8")


def _unsealed(place: Place) -> None:
    """As a killed writer leaves the catalogue: `verify` seals it."""
    (place.here / "w" / "catalogue.sqlite.sha256").unlink()


def _objects(place: Place) -> None:
    """A place in the object store of its own for each trial."""
    service = stores()
    place.more |= service.environment
    text = f'[store]\nurl = "s3://{service.bucket()}/aerodb"\n'
    (place.here / "w" / "settings.toml").write_text(text, encoding="utf-8")
    os.environ |= service.environment  # `verify` is asked in this process


def _unused(place: Place) -> None:
    """As if the files had been read a day ago: those in use stay in the cache."""
    before = time.time() - 86_400
    for folder in ("flights", "results"):
        for path in (place.here / "w" / folder).rglob("*"):
            os.utime(path, (before, before))


def _pushed(place: Place) -> None:
    _objects(place)
    assert place.run("store", "push")[0] == 0


def _only_there(place: Place) -> None:
    _pushed(place)
    _unused(place)
    assert place.run("store", "trim", "--size", "0")[0] == 0


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
_STEADY: Final = ("--speed", "25", "--altitude", "0", "--glide")
_PAGE: Final = ("--output", "{here}/page.html")


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
    "flight retract": Command(
        "ingested", ("flight", "retract", "{flight}", "--reason", "icing"), once=True
    ),
    "update": Command(
        "ingested", ("update", "--vehicle", NAME, "--model", "{files}/model.toml", "--direct")
    ),
    "update, under Prefect": Command(
        "ingested", ("update", "--vehicle", NAME, "--model", "{files}/model.toml")
    ),
    "estimate": Command(
        "ingested", ("estimate", "--vehicle", NAME, "--model", "{files}/model.toml")
    ),
    "close-loop": Command(
        "ingested",
        ("close-loop", "--vehicle", NAME, "--accept-ambiguous", "alpha_slope", "--direct"),
    ),
    "recalibrate": Command("sensors", ("recalibrate", *_BESIDE, "--reason", "first", "--direct")),
    "version promote": Command(
        "updated", ("version", "promote", "{candidate}", "--reason", "proved"), once=True
    ),
    "version rollback": Command(
        "released", ("version", "rollback", "--vehicle", NAME, "--reason", "wrong")
    ),
    "version export": Command(
        "updated",
        ("version", "export", "released", "--output", "{here}/x.dml", "--format", "daveml"),
    ),
    "version tabulate": Command(
        "updated", ("version", "tabulate", "candidate", "--over", "alpha=-5deg:10deg:7", "--at", "V=25")
    ),
    "version tag": Command("updated", ("version", "tag", "candidate", "flight-tested")),
    "version comment": Command("updated", ("version", "comment", "candidate", "agrees")),
    "version lineage": Command(
        "updated", ("version", "lineage", "candidate", "--prov", "{here}/prov.json")
    ),
    "version diff": Command(
        "updated", ("version", "diff", "v0001", "candidate", "--figure", "{here}/diff.png")
    ),
    "mapping init": Command(
        "none", ("mapping", "init", "{files}/flight1.csv", "--output", "{here}/m.toml"), once=True
    ),
    "flight compare": Command("updated", ("flight", "compare", "{flight}", "candidate")),
    "flight frequency-response": Command(
        "ingested",
        ("flight", "frequency-response", "{flight}", "--input", "delta_elevator", "--output", "q"),
    ),
    "flight wake": Command("ingested", ("flight", "wake", "{flight}", "--to", "10")),
    "flight turbulence": Command("ingested", ("flight", "turbulence", "{flight}")),
    "version fly": Command(
        "updated", ("version", "fly", "candidate", "--flight", "{flight}", *_PAGE)
    ),
    "version validate": Command(
        "updated", ("version", "validate", "candidate", "--flight", "{flight}", *_PAGE), code=4
    ),
    "version gate": Command("updated", ("version", "gate", "candidate")),
    "version design": Command(
        "updated",
        ("version", "design", "candidate", *_STEADY, "--model", "{files}/model.toml", "--duration",
         "8", "--output", "{here}/next.toml"),
    ),
    "log show": Command("none", ("log", "show", "{files}/flight1.csv", *_PAGE)),
    "report flight": Command("ingested", ("report", "flight", "{flight}", *_PAGE)),
    "report update": Command("updated", ("report", "update", "{candidate}", *_PAGE)),
    "report version": Command("updated", ("report", "version", "released", *_PAGE)),
    "nightly": Command("inbox", ("nightly", "--direct")),
    "nightly, under Prefect": Command("inbox", ("nightly",)),
    "retry": Command("crashed", ("retry", "all", "--direct")),
    "dismiss": Command(
        "crashed", ("dismiss", "a" * 32, "--reason", "logs ingested by hand"), once=True
    ),
    "demo": Command("none", ("demo", "--flights", "3", "--direct")),
    "store push": Command("ingested", ("store", "push"), _objects, at_work=lambda *_: True),
    "store pull": Command("ingested", ("store", "pull"), _only_there),
    "store trim": Command("ingested", ("store", "trim", "--size", "0"), _pushed, _unused),
    "user add": Command("prepared", ("user", "add", "anna", "--role", "ingest"), once=True),
    "user token": Command("users", ("user", "token", "anna"), once=True),
    "user remove": Command("users", ("user", "remove", "anna"), once=True),
    "verify": Command("ingested", ("verify",), _unsealed, at_work=lambda *_: True),
    "backup": Command("ingested", ("backup", "{here}/backup")),
    "restore": Command(
        "backed up", ("restore", "{here}/backup", "--workspace", "{here}/restored"), once=True
    ),
    "flight list, of an earlier catalogue": Command("former", ("flight", "list")),
    "web": Command(
        "updated", ("web", "--port", "{port}"), services.own_port, code=-signal.SIGTERM,
        done=services.promoted, at_work=services.a_page_is_asked, load=services.clients,
    ),
    "serve": Command(
        "inbox", ("serve",), done=services.all_taken_in, at_work=services.a_run_is_under_way,
        load=services.console_beside,
    ),
}  # fmt: skip
#: Commands that write neither into a workspace nor beside it, and arguments with which a test
#: watches that.
READS: Final[dict[str, tuple[str, ...]]] = {
    "status": (),
    "schema": (),
    "vehicle list": (),
    "vehicle show": (NAME,),
    "log inspect": ("{files}/flight1.csv",),
    "flight list": (),
    "flight show": ("{flight}",),
    "version list": ("--all",),
    "version show": ("candidate",),
    "version history": (),
    "version evaluate": ("candidate", "--at", "alpha=2deg"),
    "version impact": ("{flight}",),
    "version trim": ("candidate", *_STEADY),
    "version modes": ("candidate", *_STEADY),
    "version back-out": (
        "candidate",
        *_STEADY,
        "--linear",
        "{files}/model.toml",
        "--parameter",
        "tail_CLa",
    ),
    "version sweep": (
        "candidate",
        *_STEADY,
        "--variable",
        "V",
        "--from",
        "24",
        "--to",
        "26",
        "--steps",
        "2",
    ),
    "derivatives": ("{files}/model.toml",),
    "estimate-online": (
        "--vehicle",
        NAME,
        "--model",
        "{files}/model.toml",
        "--log",
        "{files}/flight1.csv",
    ),
    "version expand": (
        "candidate",
        *_STEADY,
        "--variable",
        "V",
        "--from",
        "25",
        "--to",
        "24",
        "--step",
        "1",
        "--growth-rate",
        "10",
    ),
    "calibration list": (),
    "calibration show": ("0" * 12,),
    "user list": (),
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
