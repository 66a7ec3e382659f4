"""The campaign of kills in its reduced form, and that it leaves no command out."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from aerodb.flows.cli.main import app
from tests.campaigns.kills.checks import wrong
from tests.campaigns.kills.commands import COMMANDS, READS, names_of_commands
from tests.campaigns.kills.places import Place
from tests.campaigns.kills.trial import Campaign, Moment, report
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.shared_workspace import SharedWorkspaces

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")

#: At a file in its place, and at a row; `test_catalogue_safety.py` kills within a transaction, and
#: after a time.
REDUCED = [
    ("database import", Moment("group", "INSERT versions#1")),
    ("flight ingest", Moment("process", "mkdir flights#2")),
]
#: What the small glider, which only pitches, may not have: a steady flight; a calibration, a ULog.
_MAY_REFUSE = {
    "calibration show",
    "derivatives",
    "version trim",
    "version modes",
    "version sweep",
    "version back-out",
    "estimate-online",
}
#: Each command in one process; its name goes before its writes into the record.
_IN_TURN = """
import json, os, sys
from tests.campaigns.kills.writes import arm
arm(command=True)
from aerodb.errors import AeroError
from aerodb.flows.cli.main import app
for name, given in json.loads(sys.argv[1]).items():
    with open(os.environ["KILLS_RECORD"], "a") as record:
        record.write(f"{name}:\\n")
    try:
        code = app([*sys.argv[2:], *name.split(), *given], standalone_mode=False)
    except AeroError as error:
        code = str(error)
    print(json.dumps([name, code or 0]), file=sys.stderr)
"""


def test_each_command_is_killed_or_only_reads() -> None:
    """A new command is in one of the two lists, or this fails."""
    killed = {name.partition(",")[0] for name in COMMANDS}
    assert killed | set(READS) == names_of_commands()
    assert not COMMANDS.keys() & READS.keys()


def test_no_command_that_only_reads_has_an_option_to_write_a_file() -> None:
    for name in READS:
        command = typer.main.get_command(app)
        for part in name.split():
            command = command.commands[part]  # type: ignore[attr-defined]
        texts = [getattr(option, "help", None) or "" for option in command.params]
        assert not [text for text in texts if re.search(r"\b(write|draw)\b", text)], name


def test_what_only_reads_writes_nothing(tmp_path: Path, shared: SharedWorkspaces) -> None:
    shared.updated(tmp_path / "w")
    place = Place(tmp_path, shared.logs[0].parent)
    record = tmp_path.parent / f"{tmp_path.name}.txt"
    given = {name: place.filled(parts) for name, parts in READS.items()}
    watched = {"KILLS_FOLDER": str(tmp_path), "KILLS_RECORD": str(record)}
    done = run_forked(
        [json.dumps(given), "--workspace", str(tmp_path / "w")],
        environment(**watched),
        tmp_path,
        code=_IN_TURN,
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("[")]
    assert {name for name, code in told if code == 0} >= READS.keys() - _MAY_REFUSE, told
    lines = record.read_text().splitlines()
    assert [line for line in lines if not line.endswith((":", "\tend"))] == [], lines
    assert sum(line.endswith(":") for line in lines) == len(given)


@pytest.mark.heavy
def test_what_is_killed_ends_as_if_nothing_had_happened(
    tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    campaign, names = Campaign(tmp_path, 6), list(COMMANDS)
    number = trials(len(REDUCED), 300)
    told: list[dict[str, Any]] = []
    while len(told) < number:
        turn = len(told) if number == len(REDUCED) else len(told) // 3
        told += (
            campaign.kill(*REDUCED[turn])
            if number == len(REDUCED)
            else campaign.kill(names[turn % len(names)], in_a_row=3)
        )
    assert [said for said in told if wrong(said)] == [], report(told)
