"""The first five lines of commands about a version and a workspace: verdict, what it rests on, and
what comes next, on a terminal of 80 columns."""

import re
import shlex
from pathlib import Path

import pytest

from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.terminal import MOST_LINES, NARROW, answered

AT = ("--speed", "25", "--altitude", "500")
NEXT = "next +aerodb"
SWEEP = ("version", "sweep", "candidate", *AT, "--variable", "alpha", "--from", "0", "--to",
         "40deg", "--steps", "3")  # fmt: skip


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    root = tmp_path_factory.mktemp("lines") / "workspace"
    shared.updated(root)
    return root


@pytest.mark.parametrize(
    ("words", "answers"),
    [
        (("version", "history"), ("released is v0001", "candidate is v0002", "last", NEXT)),
        (
            ("version", "evaluate", "candidate", "--at", "alpha=2deg,V=25"),
            (r"v0002 at \S+ CX -?\d", "known +inside", NEXT),
        ),
        (
            ("version", "evaluate", "candidate", "--at", "alpha=60deg,V=25"),
            ("outside +what was flown: .*alpha", NEXT),
        ),
        (
            ("version", "trim", "candidate", *AT),
            ("flies steadily", r"known to +alpha \S+ \+- \S+ deg", "data +alpha flown", NEXT),
        ),
        (("version", "modes", "candidate", *AT), ("flies steadily", "data +alpha flown", NEXT)),
        (
            (*SWEEP[:7], "--variable", "V", "--from", "5", "--to", "35", "--steps", "4"),
            ("3 of 4 points fly steadily", "takes +alpha .* deg", NEXT),
        ),
        ((*SWEEP, "--hold"), (r"CZ \S+ to \S+", "data +alpha flown .* faded out", NEXT)),
        (("user", "list"), ("no users", "next +aerodb user add")),
        (("vehicle", "list"), ("1 vehicle", "next +aerodb vehicle show")),
        (("calibration", "list"), ("no calibration", "next +aerodb recalibrate")),
        (("verify",), ("no problems", "checked .*2 versions", NEXT)),
    ],
)
def test_the_answer_comes_first(
    workspace: Path, words: tuple[str, ...], answers: tuple[str, ...]
) -> None:
    lines = answered(workspace, words, *answers)
    assert all(len(line) <= NARROW or "aerodb " in line for line in lines)


def test_a_designed_manoeuvre_is_said_in_a_line_and_flown_by_the_command_below(
    workspace: Path, tmp_path: Path
) -> None:
    model, file = tmp_path / "model.toml", tmp_path / "next.toml"
    model.write_text('[[increment]]\naxis = "Cm"\nterms = ["1", "alpha"]\n', encoding="utf-8")
    words = ("version", "design", "released", *AT, "--glide", "--model", str(model))
    limits = ("--limit", "alpha=-2deg:9deg", "--duration", "10", "--output", str(file))
    lines = answered(
        workspace,
        (*words, *limits),
        r"small-glider: \S+ of delta_elevator by \S+ deg",
        r"tells +Cm_\S+ most: standard error \S+ -> \S+",
        r"moves +alpha \[deg\]",
    )
    command = next(line for line in lines if "aerodb version fly" in line).split("aerodb ")[1]
    assert asked(workspace, *shlex.split(command))["responses"]["alpha"]


def test_the_command_that_is_printed_runs(workspace: Path) -> None:
    """With the options of the one that printed it."""
    pull = ("--pull-up", "--load-factor", "1.3")
    lines = answered(workspace, ("version", "trim", "v0002", *AT, *pull), NEXT)
    command = next(line for line in lines if "aerodb version modes" in line).split("aerodb ")[1]
    assert command.endswith("--speed 25 --altitude 500 --load-factor 1.3 --pull-up")
    assert asked(workspace, *shlex.split(command))["channels"]["load_factor"] == pytest.approx(1.3)


def test_the_report_of_a_flight_leads_to_the_flight(workspace: Path, tmp_path: Path) -> None:
    report = ("report", "flight", "flight1.csv", "--output", str(tmp_path / "flight.html"))
    told = (r"report of flight1\.csv.*: wrote flight\.html", r"verdict +(good|limited: \S+)", NEXT)
    lines = answered(workspace, report, *told)
    command = next(line for line in lines if "aerodb flight show" in line).split("aerodb ")[1]
    assert asked(workspace, *shlex.split(command))["flight"]


def test_files_that_are_written_say_so_first(workspace: Path, tmp_path: Path) -> None:
    page, model, copy = tmp_path / "v.html", tmp_path / "glider.csv.zip", tmp_path / "copy"
    report = ("report", "version", "candidate", "--output", str(page))
    answered(workspace, report, r"report of v0002: wrote .*v\.html", "found", NEXT)
    export = ("version", "export", "candidate", "--format", "csv", "--output", str(model))
    answered(workspace, export, "wrote .*v0002 of", "proved +read back")
    answered(workspace, ("backup", str(copy)), "a complete backup: .* files", "hash", NEXT)
    assert page.is_file()
    assert model.is_file()


def test_a_draft_says_what_it_found_and_what_it_asks(
    workspace: Path, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    file = tmp_path / "mapping.toml"
    draft = ("mapping", "init", str(shared.logs[0]), "--output", str(file))
    lines = answered(workspace, draft, r"flight1\.csv: \d+ channels found", "wrote +")
    assert any("aerodb log inspect" in line for line in lines[: MOST_LINES + 2])
    assert file.is_file()


def test_a_problem_is_the_verdict(
    tmp_path: Path, workspace: Path, shared: SharedWorkspaces
) -> None:
    root = tmp_path / "damaged"
    place, _ = shared.updated(root)
    damaged = next(path for path in (place.root / "results").rglob("*") if path.is_file())
    damaged.chmod(0o600)
    damaged.write_bytes(damaged.read_bytes()[:-1])
    lines = answered(root, ("verify",), r"damaged: \d+ problems?", "first .*results", code=1)
    assert not any("backup FOLDER" in line for line in lines[:MOST_LINES])


def test_a_number_after_plus_minus_is_half_of_the_interval(workspace: Path) -> None:
    """In the table and in the headline, of a trim and of an increment."""
    lines = answered(workspace, ("version", "trim", "candidate", *AT), NEXT)
    said = float(re.search(r"alpha \S+ \+- (\S+) deg", " ".join(lines[:MOST_LINES]))[1])
    sigma = asked(workspace, "version", "trim", "candidate", *AT)["standard_errors"]["alpha"]
    assert said == pytest.approx(1.96 * sigma * 57.2958, rel=0.05)
    modes = asked(workspace, "version", "modes", "candidate", *AT)["modes"]
    short = next(mode for mode in modes if mode["name"] == "short period")
    lines = answered(workspace, ("version", "modes", "candidate", *AT), NEXT)
    row = next(
        line for line in lines if "+-" in line and "data" not in line and "alpha" not in line
    )
    told = float(re.search(r"\S+ \+- (\S+)", row)[1])
    assert any(told == pytest.approx(1.96 * e, rel=0.06) for e in short["standard_errors"].values())
    assert "+-: half of the 95 % interval" in lines
