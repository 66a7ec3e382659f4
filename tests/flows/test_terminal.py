"""What people read first: verdict, change, next command within five lines, then one small table;
and the same numbers as in the JSON document."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len
from typer.testing import CliRunner

from aerodb.consistency import unmeasured_angles_outlook
from aerodb.errors import GateRefusal
from aerodb.flight import Flight
from aerodb.flows.cli.main import app
from aerodb.flows.cli.output import Session
from aerodb.nomenclature import AXES
from aerodb.report import faded_at
from tests.support.command import asked
from tests.support.console_workspace import client_of
from tests.support.contradictions import contradictions
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv
from tests.support.terminal import on_terminal, plain

WIDTHS = (80, 120)


def place_of(lines: list[str], word: str) -> int:
    """The number of the first line that begins with `word`, counted from 1."""
    return next(k for k, line in enumerate(lines, 1) if line.strip().startswith(word))


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_next_command_stands_alone_and_what_is_said_before_it_is_wrapped(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is copied from the terminal is the command; a pipe gets both in one line."""
    command = "aerodb update --vehicle my-glider --baseline v0001 --model FILE --direct"
    said = "write a model file, CX: 1, CZ: (1, alpha, q_hat), Cm: (1, alpha, q_hat, delta_e), then"
    for forced in ("1", ""):
        monkeypatch.setenv("FORCE_COLOR", forced)
        monkeypatch.setenv("COLUMNS", str(columns))
        session = Session(Path(), as_json=False, debug=False)
        session.headlines("a verdict " * 14, [("found", "this")], f"{said} {command}")
        lines = capsys.readouterr().out.splitlines()
        assert not forced or max(map(len, lines[:-1])) <= columns
        assert lines[-1].strip() == (command if forced else f"next   {said} {command}")
        assert lines[1].startswith("  a verdict") == bool(forced)


@pytest.mark.parametrize("columns", WIDTHS)
def test_no_number_is_cut_where_the_terminal_is_narrow(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Columns that can be spared are left out, which is said; numbers go on in a second part."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(columns))
    session = Session(Path(), as_json=False, debug=False)
    numbers = [[f"{row}.{k}234567 ± 0.00123" for k in range(7)] for row in (1, 2)]
    heads = [f"figure {k} [rad/s]" for k in range(7)]
    rows = [["Dutch roll", "id-1", *numbers[0]], ["phugoid", "id-2", *numbers[1]]]
    session.table(["mode", "id", *heads], rows, range(2, 9), spare=(1,))
    out = plain(capsys.readouterr().out)
    assert max(map(cell_len, out.splitlines())) <= columns
    assert all(cell in out for row in numbers for cell in row)
    assert all(head in out for head in heads)
    assert out.count("Dutch roll") == out.count("phugoid") == out.count("mode") > 1
    assert "id-1" not in out
    assert "not shown on a terminal this narrow: id" in out
    words = "two real roots in place of an oscillation, or one merged with another"
    session.table(["mode", "", "T [s]"], [["short period", words, "1 +- 2"]] * 2, (2,))
    assert plain(capsys.readouterr().out).count("short period ") == 2, "a name stays whole"
    session.table(["mode", "id"], [], spare=(1,))
    assert plain(capsys.readouterr().out).split() == ["mode", "id"]
    session.say("  a long sentence about what was found " * 5)
    wrapped = capsys.readouterr().out.splitlines()
    assert max(map(len, wrapped)) <= columns
    assert all(line.startswith("    ") for line in wrapped[1:])


@pytest.mark.parametrize("columns", WIDTHS)
def test_ingest_begins_with_its_verdict_and_has_a_line_per_flight(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.prepared(tmp_path / "w").root
    logs = [write_csv(tmp_path / f"flight{seed}.csv", channels(seed)) for seed in (11, 12, 13)]
    words = ("flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    code, lines = on_terminal(workspace, columns, *words)
    outcomes = asked(workspace, *words)
    assert code == 0
    assert lines[0] == f"{NAME}: 3 of 3 logs stored: 3 limited; 0 refused"
    assert place_of(lines, "next") <= 5
    assert len(lines) <= 14, "three lines above, two per flight, four around them"
    assert not [line for line in lines if len(line) > columns and "aerodb " not in line]
    for outcome in outcomes:
        place = place_of(lines, Path(outcome["log"]).name)
        shown = re.findall(r"-(?= |$)|\S+(?= %)", lines[place - 1].split("limited")[1])
        assert len(shown) == len(AXES)
        for axis, percent in zip(AXES, shown, strict=True):
            entry = outcome["comparison"]["axes"][axis]
            if percent == "-":
                assert entry["variation"] == 0.0
                continue
            of_flown = entry["rms_residual"] / entry["variation"]
            assert entry["of_flown"] == pytest.approx(of_flown)
            assert float(percent) == pytest.approx(100 * of_flown, rel=0.06)
        reason = " ".join(outcome["consistency"]["reasons"][0].split())
        assert lines[place].strip()[:30] == reason[:30], "its first reason, in the line below"


@pytest.mark.parametrize("columns", WIDTHS)
def test_inspect_says_in_its_first_lines_whether_a_log_can_be_used(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    log = shared.guide / "flight-1.ulg"
    code, lines = on_terminal(tmp_path, columns, "log", "inspect", str(log))
    found = asked(tmp_path, "log", "inspect", str(log))
    assert (code, found["usable"], found["because"]) == (0, True, [])
    assert lines[0].startswith("flight-1.ulg: USABLE (ulog, ")
    assert f"{found['duration']:.1f} s, {found['rate']:.4g} Hz" in lines[0]
    assert place_of(lines, "next") == 2
    assert len(lines) <= 20
    assert not [line for line in lines if len(line) > columns and "aerodb " not in line]
    said = " ".join(" ".join(lines).split())
    turn = found["outlook"]["beta"]["turn"]
    assert found["outlook"]["alpha"] == {"expected": True, "lacking": []}
    assert f"the track turns by {math.degrees(turn):.0f} deg" in said
    assert not {"alpha", "beta", "qbar", "mach"} & {
        word for each in found["not_possible"] for word in each["what"].split()
    }, "what is computed or reconstructed is not called impossible"
    _, detailed = on_terminal(tmp_path, columns, "log", "inspect", str(log), "-v")
    assert detailed[: len(lines) - 1] == lines[:-1]
    assert not [line for line in detailed if "no angle of" in line]
    assert sum(line.split()[:1] == ["topic"] for line in detailed) == 1


def test_inspect_says_why_a_log_cannot_be_used(tmp_path: Path) -> None:
    table = channels(3)
    log = write_csv(
        tmp_path / "slow.csv", {k: v for k, v in table.items() if k not in ("V", "qbar")}
    )
    _, lines = on_terminal(tmp_path, 80, "log", "inspect", str(log))
    found = asked(tmp_path, "log", "inspect", str(log))
    assert lines[0].startswith("slow.csv: NOT USABLE (")
    assert place_of(lines, "because") == 2
    assert found["unusable"] in found["because"]
    assert "".join(lines[1].split()[1:3]) == "".join(found["unusable"].split()[:2])
    assert found["not_possible"][0]["what"] == "coefficients"


@pytest.mark.parametrize(
    ("without", "lacking"),
    [((), []), (("theta",), ["theta"]), (("velocity_north", "V"), ["V", "velocity_north"])],
)
def test_angles_without_a_vane_are_expected_where_the_kinematics_give_them(
    without: tuple[str, ...], lacking: list[str]
) -> None:
    names = ("ax", "ay", "az", "p", "q", "r", "phi", "theta", "V")
    names += ("velocity_north", "velocity_east", "velocity_down")
    time = np.linspace(0.0, 10.0, 101)
    given = {name: np.zeros(101) for name in names if name not in without}
    for rate, enough in ((0.05, False), (0.2, True)):
        track = {"velocity_north": np.cos(rate * time), "velocity_east": np.sin(rate * time)}
        flight = Flight(
            "f", NAME, time, {**given, **{k: v for k, v in track.items() if k in given}}
        )
        found = unmeasured_angles_outlook(flight)
        assert found["alpha"] == {"expected": not lacking, "lacking": lacking}
        assert found["beta"]["expected"] == (enough and not lacking)
        if not lacking:
            assert found["beta"]["turn"] == pytest.approx(10.0 * rate)
    measured = Flight("f", NAME, time, {**given, "alpha": time, "beta": time})
    assert unmeasured_angles_outlook(measured) == {}


@pytest.mark.parametrize("columns", WIDTHS)
def test_a_diff_has_a_line_per_edit_and_the_curve_that_changes_most(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    code, lines = on_terminal(workspace, columns, "version", "diff", "released", "candidate")
    found = asked(workspace, "version", "diff", "released", "candidate")
    edits = [term for term in found["terms"] if term["change"] != 0.0]
    assert code == 0
    assert lines[0] == f"{NAME}: v0001 -> v0002, {len(edits)} edits"
    assert lines[place_of(lines, "next") - 1].endswith(
        f"aerodb version gate v0002 --vehicle {NAME}"
    )
    assert place_of(lines, "next") <= 5
    reaches = faded_at(found)
    around = 16 + len(reaches)
    assert len(lines) == around + len(edits), "six above the edits, ten around and below them"
    assert not [line for line in lines if len(line) > columns]
    rows = lines[place_of(lines, "axis") :][: len(edits)]
    by_share = sorted(edits, key=lambda term: -term["share"])
    for row, term in zip(rows, by_share, strict=True):
        assert row.split()[0] == term["axis"]
        assert f"{term['change']:+.3g}" in row.split()
        assert term["what"] in row
    slope = next(term for term in edits if (term["axis"], term["name"]) == ("CZ", "alpha"))
    reach = slope["envelope"]["alpha"]
    assert reach["gone_below"] < reach["low"] < reach["high"] < reach["gone_above"]
    told = lines[place_of(lines, "axes") :][: len(reaches)]
    (of_alpha,) = [line for line in told if "CZ" in line and "alpha [deg]" in line]
    ends = [
        f"{math.degrees(reach[end]):.3g}" for end in ("low", "high", "gone_below", "gone_above")
    ]
    assert "{} to {} {} and {}".format(*ends) in " ".join(of_alpha.split())
    largest = max(abs(reach["low"]), abs(reach["high"])) * abs(slope["change"])
    before = asked(
        workspace, "version", "evaluate", "released", "--at", f"alpha={reach['high']},V=20"
    )
    assert slope["share"] == pytest.approx(largest / abs(before["coefficients"]["CZ"]), rel=0.02)


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_curve_of_a_diff_is_that_of_the_versions(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    _, lines = on_terminal(workspace, columns, "version", "diff", "released", "candidate")
    curve = asked(workspace, "version", "diff", "released", "candidate")["curve"]
    first = place_of(lines, curve["variable"] + " [") - 1
    at, before, change, flown = (line.split() for line in lines[first : first + 4])
    assert (before[0], change[0], flown[0]) == (curve["axis"], "change", "flown")
    assert 4 <= len(curve["points"]) <= 10
    assert {"yes", "no"} >= set(flown[1:])
    for place, point in enumerate(curve["points"]):
        assert float(at[2 + place]) == pytest.approx(curve["factor"] * point["at"], abs=1e-9)
        assert float(change[1 + place]) == pytest.approx(point["change"], abs=6e-5)
        held = {**curve["held"], curve["variable"]: point["at"]}
        held.pop("q_hat", None)  # q is beside it
        words = ",".join(f"{name}={value!r}" for name, value in held.items())
        old, new = (
            asked(workspace, "version", "evaluate", version, "--at", words)["coefficients"]
            for version in ("released", "candidate")
        )
        axis = curve["axis"]
        assert old[axis] == pytest.approx(point["before"], abs=1e-9)
        assert new[axis] - old[axis] == pytest.approx(point["change"], abs=1e-9)


def test_nothing_edited_is_one_line_and_nodes_are_asked_for(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    assert on_terminal(workspace, 80, "version", "diff", "v0002", "candidate") == (
        0,
        [f"{NAME}: v0002 -> v0002: no difference"],
    )
    _, short = on_terminal(workspace, 80, "version", "diff", "released", "candidate")
    _, whole = on_terminal(workspace, 80, "version", "diff", "released", "candidate", "--nodes")
    assert not any("at the breakpoints of" in line for line in short)
    assert any("CZ at the breakpoints of CZ0" in line for line in whole)
    assert any("alpha [deg]" in line and "sigma" in line for line in whole)


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_gate_recommends_and_shows_every_check_with_its_limit(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    code, lines = on_terminal(workspace, columns, "version", "gate", "candidate")
    found = asked(workspace, "version", "gate", "candidate")
    assert (code, found["passed"], found["acceptable"]) == (0, True, [])
    assert found["released"]["label"] == "v0001"
    since = found["released"]["since"][:10]
    assert lines[0] == f"{NAME}: v0002 can be released (today v0001, since {since})"
    assert place_of(lines, "next") <= 5
    promote = f'aerodb version promote v0002 --vehicle {NAME} --reason "..."'
    assert lines[place_of(lines, "next") - 1].endswith(promote)
    assert not [line for line in lines if len(line) > columns and "aerodb " not in line]
    checks = found["checks"]
    assert f"gate     {len(checks)} of {len(checks)} checks pass" in "\n".join(lines)
    assert [line.split()[0] for line in lines[-len(checks) :]] == ["pass"] * len(checks)
    assert place_of(lines, "proved") < place_of(lines, "gate")
    assert len(lines) <= 7 + len(checks)
    (cases,) = [check for check in checks if check["label"] == "check cases"]
    assert [(m["of"], m["value"], m["limit"]) for m in cases["measures"]] == [
        ("cases", 25, None),
        ("values that differ", 0, 0),
    ]
    (error,) = [check for check in checks if check["label"] == "held-out error"]
    whole = error["measures"][0]
    assert whole["value"] < whole["before"] == whole["limit"]
    row = next(line for line in lines if "held-out error" in line)
    assert f"{whole['before']:.3g} -> {whole['value']:.3g} noise floors" in row
    history = asked(workspace, "version", "history", "--name", "released")
    assert [move["to"] for move in history] == [found["released"]["version"]], "nothing moved"
    asked(workspace, "version", "promote", "candidate", "--reason", "the gate said so")
    _, done = on_terminal(workspace, columns, "version", "gate", "v0002")
    assert place_of(done, "next") == len(done) <= 3
    assert done[0].startswith(f"{NAME}: v0002 is released, since ")


def test_the_gate_says_what_a_person_would_have_to_accept(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    (workspace / "settings.toml").write_text(
        f"[vehicles.{NAME}.gate]\nlargest_change = 1e-4\n", encoding="utf-8"
    )
    gate = ("version", "gate", "candidate")
    code, lines = on_terminal(workspace, 100, *gate)
    found = json.loads(
        CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *gate]).stdout
    )
    assert (code, found["passed"]) == (1, False)
    assert found["acceptable"], "changed derivatives"
    accept = [word for name in found["acceptable"] for word in ("--accept", name)]
    assert lines[0].startswith(f"{NAME}: v0002 would be refused (")
    assert (
        " ".join(["promote v0002 --vehicle", NAME, *accept]) in lines[place_of(lines, "next") - 1]
    )
    (failed,) = [check for check in found["checks"] if not check["passed"]]
    worst = max(failed["measures"], key=lambda measure: measure["value"])
    row = next(k for k, line in enumerate(lines) if line.strip().startswith("FAIL"))
    assert lines[row].split()[1] == failed["label"] == "derivatives"
    assert f"{worst['of']} changes by {100 * worst['value']:.3g} %" in lines[row]
    assert lines[row].endswith("at most 0.01 %")
    assert lines[row + 1].strip()[:40] == failed["reasons"][0][:40]
    assert on_terminal(workspace, 100, *gate, *accept)[0] == 0
    moved = asked(workspace, "version", "promote", "candidate", *accept, "--reason", "small ones")
    assert moved["moved"], "what the gate said beforehand is what it says"


def test_what_nobody_can_accept_is_said_with_its_reason(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    flight = asked(workspace, "version", "lineage", "candidate")["flights"][0]["flight"]
    asked(workspace, "flight", "retract", flight, "--reason", "icing")
    gate = ("version", "gate", "candidate")
    code, lines = on_terminal(workspace, 100, *gate)
    found = json.loads(
        CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *gate]).stdout
    )
    assert (code, found["acceptable"]) == (1, None)
    (stale,) = [check for check in found["checks"] if check["label"] == "not stale"]
    assert not stale["passed"]
    assert stale["measures"][0]["value"] == len(stale["reasons"]) == 1
    assert lines[place_of(lines, "next") - 1].endswith(f"update --like v0002 --vehicle {NAME}")
    refused = CliRunner().invoke(
        app, ["--workspace", str(workspace), "version", "promote", "candidate", "--reason", "r"]
    )
    assert isinstance(refused.exception, GateRefusal)
    assert list(refused.exception.reasons) == [
        reason for check in found["checks"] for reason in check["reasons"]
    ]


def test_tables_of_coefficients_say_where_data_end(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.updated(tmp_path / "w")[0].root
    told = "the change fades to nothing at"
    for command in (
        ("evaluate", "candidate", "--at", "alpha=40deg,V=25"),
        ("show", "candidate"),
    ):
        _, lines = on_terminal(workspace, 100, "version", *command)
        said = " ".join(" ".join(lines).split())
        assert "beyond the flown range (alpha < " in said
        assert told in said
    _, inside = on_terminal(
        workspace, 100, "version", "evaluate", "candidate", "--at", "alpha=5deg,V=25"
    )
    assert told not in " ".join(" ".join(inside).split())


def test_commands_that_a_loop_proposes_repeat_its_options(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """On the terminal and on the console's page; against another version it names the baseline."""
    workspace = shared.ingested(tmp_path / "w")
    given = ("close-loop", "--vehicle", NAME, "--hold-out", "none")
    _, lines = on_terminal(workspace.root, 100, *given, "--direct", "-v")
    proposed = [line for line in lines if f"aerodb close-loop --vehicle {NAME}" in line]
    assert len(proposed) >= 2, "the next command, and the one below the findings"
    asked_for = " ".join(given)
    assert all(f"aerodb {asked_for} --measured" in line for line in proposed)
    assert {line[line.index("aerodb close-loop") :] for line in proposed} == {
        proposed[0][proposed[0].index("aerodb close-loop") :]
    }
    found = asked(workspace.root, *given, "--direct")
    assert contradictions(found, ("--hold-out none",)) == []
    page = client_of(workspace).get(f"/findings/{found['report']}")
    assert f"aerodb {asked_for} --measured" in page.text
    report = Path(found["page"]).read_text("utf-8")
    assert f"aerodb {asked_for} --measured" in report
    later = write_csv(tmp_path / "later.csv", channels(41))
    asked(workspace.root, "flight", "ingest", str(later), "--vehicle", NAME, "--direct")
    assert client_of(workspace).get(f"/findings/{found['report']}").text.count("--flights") == 0
    some = [row["flight"] for row in asked(workspace.root, "flight", "list")][:4]
    chosen = [word for flight in some for word in ("--flights", flight)]
    _, lines = on_terminal(workspace.root, 100, *given, *chosen, "--direct")
    (step,) = [line for line in lines if f"aerodb close-loop --vehicle {NAME}" in line]
    assert all(f"--flights {flight[:12]}" in step for flight in some)
