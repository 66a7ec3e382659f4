"""Names that were never meant as names: refused or kept, in plain words, and harmless to files,
catalogue and terminal."""

import os
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.errors import AeroError
from aerodb.flows.cli.main import app
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, VEHICLE, channels, state_of, write_csv

HOSTILE = [
    "../x",
    "/etc/passwd",
    "'; DROP TABLE flights; --",
    "übung",
    "a\nb",
    "[red]x[/red]",
    "[/]",
    "\x1b[31mred",
    "x" * 5000,
    "",
]
CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    return shared.ingested(tmp_path_factory.mktemp("made") / "w").root


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_are_refused_in_plain_words(
    workspace: Path, tmp_path: Path, name: str
) -> None:
    before = state_of(workspace)
    for arguments in (
        ["vehicle", "init", name],
        ["vehicle", "show", name],
        ["flight", "show", name],
        ["flight", "retract", name, "--reason", "x"],
        ["version", "show", name],
        ["version", "impact", name],
        ["version", "evaluate", "released", "--at", f"{name}=1"],
        ["flight", "list", "--vehicle", name],
        [
            "flight",
            "ingest",
            str(write_csv(tmp_path / "new.csv", channels(99))),
            "--vehicle",
            NAME,
            "--name",
            name,
            "--direct",
        ],
    ):
        result = CliRunner().invoke(app, ["--workspace", str(workspace), *arguments])
        if arguments[1] == "ingest":
            assert result.exit_code == 3
            assert len(result.stderr.splitlines()) == 2
            assert not CONTROL.search(result.stderr)
        else:
            assert isinstance(result.exception, AeroError), (arguments, result.output)
    assert state_of(workspace) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.csv"]
    assert len(asked(workspace, "flight", "list")) == 6


def test_a_refusal_of_a_hostile_name_stays_two_lines_without_control_characters(
    workspace: Path,
) -> None:
    done = aerodb(workspace, "flight", "show", "a\n\x1b[31m[red]")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 2
    assert not CONTROL.search(done.stderr)


def test_logs_with_hostile_names_are_kept_under_their_hash(tmp_path: Path) -> None:
    """Escape sequences once reached the terminal, and a name in brackets would have been read as
    colour."""
    workspace = tmp_path / "w"
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    asked(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    names = [
        "[red]x[bold].csv",
        "'; DROP TABLE flights; --.csv",
        "ü\nnew\x1b[31mline.csv",
        "--help.csv",
    ]
    logs = [write_csv(tmp_path / name, channels(k, seconds=4.0)) for k, name in enumerate(names)]
    done = aerodb(workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    assert done.returncode == 0, done.stderr
    assert not CONTROL.search(done.stdout + done.stderr)
    assert "[red]x[bold].csv  " in done.stdout
    assert r"ü\nnew\x1b[31mline.csv  " in done.stdout
    flights = asked(workspace, "flight", "list")
    assert len(flights) == len(names)
    shown = [
        asked(workspace, "flight", "show", flight["flight"])["log"]["name"] for flight in flights
    ]
    assert sorted(Path(name).name for name in shown) == sorted(names)
    stored = [
        path.name
        for path in (workspace / "flights").rglob("*")
        if path.is_file() and path.name != "recording.json"
    ]
    assert all(re.fullmatch(r"[0-9a-f]{64}\.parquet|[0-9]{4}\.parquet", name) for name in stored)


@pytest.mark.skipif(
    sys.platform != "linux", reason="only here may a file's name be other than text"
)
def test_a_file_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    """It once ended in an exception of the library that writes canonical JSON."""
    workspace = tmp_path / "w"
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    asked(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    path = os.fsdecode(os.fsencode(tmp_path) + b"/bad\xff.csv")
    os.rename(write_csv(tmp_path / "log.csv", channels(0, seconds=4.0)), path)
    done = aerodb(workspace, "flight", "ingest", path, "--vehicle", NAME, "--direct")
    assert done.returncode == 3
    assert done.stderr.splitlines()[0].endswith(r"bad\udcff.csv: its name is not valid UTF-8")
    assert asked(workspace, "flight", "list") == []
