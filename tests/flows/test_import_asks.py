"""``database import`` on a terminal asks for what is open, all at once and with proposals; nobody is
asked where nobody can answer."""

import json
import os
import pty
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.aerodb.exchange.test_import_questions import FILE
from tests.flows.test_database_inputs import AIRCRAFT
from tests.support.command import aerodb, asked
from tests.support.paths import ROOT
from tests.support.small_glider import NAME, VEHICLE


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (tmp_path / "signs.dml").write_bytes(FILE)
    (tmp_path / "g.xml").write_text(AIRCRAFT, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    return tmp_path


def at_terminal(folder: Path, file: str, answers: list[str], *more: str) -> tuple[int, str]:
    """Exit code and screen of an import on a terminal of its own; each answer is typed at the next
    prompt."""
    leader, follower = pty.openpty()
    command = ["--workspace", str(folder / "w"), *more, "database", "import", str(folder / file)]
    command += ["--vehicle", NAME]
    process = subprocess.Popen(
        [sys.executable, "-c", "from aerodb.flows.cli import main; main()", *command],
        stdin=follower,
        stdout=follower,
        stderr=follower,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200", "TERM": "dumb"},
        close_fds=True,
    )
    os.close(follower)
    screen, seen, left, until = "", 0, list(answers), time.monotonic() + 120
    while time.monotonic() < until:
        if select.select([leader], [], [], 1.0)[0]:
            try:
                part = os.read(leader, 65536)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            screen += part.decode("utf-8", "replace")
        if left and screen[seen:].rstrip(" ").endswith((":", "]:")):
            seen = len(screen)
            os.write(leader, f"{left.pop(0)}\n".encode())
    os.close(leader)
    assert not left, (left, screen)
    return process.wait(300), screen


def test_all_open_inputs_are_asked_for_with_their_proposals(folder: Path) -> None:
    code, screen = at_terminal(folder, "signs.dml", ["", "p*FACTOR", "p*(", "0"])
    assert code == 0, screen
    assert "2 inputs of the file must be bound" in screen
    assert "BETA [beta*57.29577951308232]:" in screen
    assert "-(beta*57.29577951308232)   if it is positive against beta" in screen
    assert "write a number in place of the word in capitals" in screen
    assert "PB [" not in screen, "what only the user knows has no default"
    (version,) = asked(folder / "w", "version", "list")
    settings = asked(folder / "w", "version", "show", version["version"])["settings"]
    assert settings["bindings"] == {"BETA": "beta*57.29577951308232", "PB": "0"}
    again = ("--bind", "BETA=beta*57.29577951308232", "--bind", "PB=0")
    file = str(folder / "signs.dml")
    same = asked(folder / "w", "database", "import", file, "--vehicle", NAME, *again)
    assert same["version"] == version["version"], "what is printed makes the same version"
    assert "--bind PB=0" in screen


def test_inputs_that_no_flight_has_are_asked_for_before_anything_is_stored(folder: Path) -> None:
    code, screen = at_terminal(folder, "g.xml", [""])
    assert code == 0, screen
    assert "no flight has" in screen
    assert "fcs/brake-norm [0]:" in screen
    (version,) = asked(folder / "w", "version", "list")
    assert version["names"] == ["released"]
    assert asked(folder / "w", "database", "inputs")["lacking"] == []
    assert asked(folder / "w", "status")["failed"] == []


def test_who_ends_the_questions_has_imported_nothing(folder: Path) -> None:
    code, screen = at_terminal(folder, "g.xml", ["\x04"])
    assert code == 1, screen
    assert asked(folder / "w", "version", "list") == []
    assert asked(folder / "w", "status")["failed"] == []


def test_nobody_is_asked_without_a_terminal_or_for_a_document(folder: Path) -> None:
    importing = ("database", "import", str(folder / "signs.dml"), "--vehicle", NAME)
    refused = aerodb(folder / "w", *importing)
    assert refused.returncode == 3
    assert "--bind BETA=beta*57.29577951308232" in refused.stderr
    code, screen = at_terminal(folder, "g.xml", [], "--json")
    assert code == 0
    assert json.loads(screen[screen.index("{") :])["lacking"] == ["fcs_brake_norm"]
