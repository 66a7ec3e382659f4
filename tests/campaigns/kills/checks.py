"""What is known of a workspace: what its queries answer, what is damaged, and the whole picture that
must be the same as without the kill."""

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Final

import sqlalchemy as sa

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.campaigns.kills.places import Place
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.glider_runs import rows
from tests.support.small_glider import state_of

#: What a kill may leave behind until the command is done again: nothing that anybody could take
#: for the truth.
HARMLESS: Final = {"half-written", "orphan"}
#: Files whose bytes do not tell when they were made.
_COMPARED: Final = (".dml", ".toml", ".png")


@dataclass(frozen=True)
class Undisturbed:
    """A command that nobody killed: seconds until it was at work and until its end, its writes
    (label -> how often in one process), and what is known before and after (`answers`, `picture`).
    """

    begins: float
    ends: float
    writes: dict[str, int]
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
    found["problems"] = problems(place)
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
            "rows": _numbers(workspace, catalogue),
            "files": {
                name: sha256
                for name, sha256 in state_of(workspace.root).items()
                if name.startswith(("flights/", "results/", "recordings/", "inbox/"))
            },
        }


def _numbers(workspace: Workspace, catalogue: Catalogue) -> dict[str, int]:
    """Table -> number of rows, without the history of what killed runs began to take in: it stays
    told."""
    numbers = rows(workspace)
    killed = {row.id for row in catalogue.runs("crashed")}
    with catalogue._database.reading() as connection:
        events = connection.execute(sa.text("SELECT run, path, kind FROM inbox_events")).all()
    ended = {(row.run, row.path) for row in events if row.kind != "tried"}
    begun = sum(
        row.kind == "tried" and row.run in killed and (row.run, row.path) not in ended
        for row in events
    )
    return numbers | {name: numbers[name] - begun for name in ("inbox_events", "chain")}


def _beside(place: Place) -> dict[str, int]:
    """Files beside the workspace, and their sizes; of those that say when they were made, that they
    are not empty."""
    return {
        path.relative_to(place.here).as_posix(): path.stat().st_size
        if path.suffix in _COMPARED
        else min(path.stat().st_size, 1)
        for path in sorted(place.here.rglob("*"))
        if path.is_file() and path.relative_to(place.here).parts[0] not in ("w", "restored")
    }


#: The queries of all vehicles in one process: the answers of ``--json`` as one document.
_ASKING: Final = """
import contextlib, io, json, sys
from aerodb.flows.cli.main import app
def asked(*given):
    with contextlib.redirect_stdout(io.StringIO()) as answer:
        code = app([*sys.argv[1:], "--json", *given], standalone_mode=False)
    assert not code, (given, code)
    return json.loads(answer.getvalue())
vehicles = [entry["vehicle"] for entry in asked("vehicle", "list")]
print(json.dumps({
    "vehicles": vehicles,
    "lists": {name: asked("version", "list", "--all", "--vehicle", name) for name in vehicles},
    "flights": [entry["flight"] for entry in asked("flight", "list")],
    "status": asked("status"),
}))
"""


def answers(place: Place) -> dict[str, Any]:
    """What the queries answer: vehicles, flights, versions, what is released, and the status; and
    the problems that are found.

    Raises AssertionError if one does not answer with a document, and exit code 0.
    """
    if not place.has_catalogue:
        return {
            "vehicles": [], "flights": [], "versions": [], "released": {}, "status": {},
            "problems": [],
        }  # fmt: skip
    found = problems(place)
    done = run_forked(place.arguments(()), environment(**place.more), place.here, code=_ASKING)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    lists = told.pop("lists")
    return {
        **told,
        "problems": found,
        "versions": [entry["version"] for entries in lists.values() for entry in entries],
        "released": {
            name: entry["version"]
            for name, entries in lists.items()
            for entry in entries
            if "released" in entry["names"]
        },
    }


def wrong_answers(found: Mapping[str, Any], expected: Undisturbed, place: Place) -> list[str]:
    """What queries answer after a kill that was neither so before nor would be after."""
    wrong = []
    for kind in ("vehicles", "flights", "versions"):
        before, after = (set(each[kind]) for each in (expected.before, expected.after))
        if not before & after <= set(found[kind]) <= before | after:
            wrong.append(f"{kind}: {found[kind]}")
    known = (expected.before["released"].items(), expected.after["released"].items())
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
    return [str(row[0]) for row in asked_sqlite(place, "SELECT id FROM runs WHERE state='running'")]


def asked_sqlite(place: Place, statement: str) -> list[Any]:
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


def problems(place: Place) -> list[list[str]]:
    """Kind and place of what `aerodb verify` finds."""
    if not place.has_catalogue:
        return []
    with Catalogue.open(place.workspace.catalogue) as catalogue:
        found = verify(place.workspace, catalogue).problems
    return sorted([each.kind, each.where] for each in found)


def further_problems(place: Place, expected: Undisturbed) -> list[list[str]]:
    """What `aerodb verify` finds that is neither so before nor after an undisturbed run (what is
    not pushed yet, for example)."""
    known = expected.before["problems"] + expected.after["problems"]
    return [each for each in problems(place) if each not in known]


def differences(expected: Undisturbed, place: Place) -> list[str]:
    """What of the picture is not that of the undisturbed run: where, what is, what should be."""
    return list(_unlike("", picture(place), expected.picture))


def _unlike(where: str, found: Any, wanted: Any) -> Iterator[str]:
    if isinstance(found, dict) and isinstance(wanted, dict):
        for key in sorted(found.keys() | wanted.keys()):
            yield from _unlike(f"{where}/{key}", found.get(key), wanted.get(key))
    elif found != wanted:
        yield f"{where}: {str(found)[:200]} for {str(wanted)[:200]}"


def wrong(said: Mapping[str, Any]) -> list[str]:
    """What must not be after a kill, and was."""
    never = (
        "wrong_answers", "bad", "again", "differs", "lost", "still_running", "left", "console",
    )  # fmt: skip
    found = [key for key in never if said[key]]
    return found + (["integrity"] if said["integrity"] not in ([], ["ok"]) else [])
