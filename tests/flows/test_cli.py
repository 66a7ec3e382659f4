"""The command line: one JSON document, exit codes, two-line refusals, examples in every help,
hostile names harmless.

What needs a process of its own (exit codes, the two streams) runs the installed command's entry;
the rest goes through the runner of the library that the command line is made with, which calls the
same application.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.recording import Topic
from aerodb.storage.writers.ulog import write_ulog
from aerodb.tasks.actors import user
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb, asked, document
from tests.support.paths import ROOT
from tests.support.set_clock import Clock, can_be_set, set_clock
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, state_of, write_files

COMMANDS = [
    ["vehicle", "init"],
    ["vehicle", "add"],
    ["vehicle", "list"],
    ["vehicle", "show"],
    ["database", "import"],
    ["database", "inputs"],
    ["log", "inspect"],
    ["log", "show"],
    ["schema"],
    ["flight", "ingest"],
    ["flight", "list"],
    ["flight", "show"],
    ["flight", "retract"],
    ["flight", "compare"],
    ["flight", "frequency-response"],
    ["flight", "turbulence"],
    ["flight", "wake"],
    ["mapping", "init"],
    ["calibration", "list"],
    ["calibration", "show"],
    ["recalibrate"],
    ["estimate"],
    ["derivatives"],
    ["estimate-online"],
    ["update"],
    ["close-loop"],
    ["demo"],
    ["serve"],
    ["nightly"],
    ["retry"],
    ["dismiss"],
    ["status"],
    ["web"],
    ["verify"],
    ["backup"],
    ["restore"],
    ["version", "list"],
    ["version", "tag"],
    ["version", "comment"],
    ["version", "show"],
    ["version", "design"],
    ["version", "expand"],
    ["version", "history"],
    ["version", "lineage"],
    ["version", "impact"],
    ["version", "diff"],
    ["version", "evaluate"],
    ["version", "fly"],
    ["version", "validate"],
    ["version", "trim"],
    ["version", "modes"],
    ["version", "sweep"],
    ["version", "back-out"],
    ["version", "tabulate"],
    ["version", "export"],
    ["version", "gate"],
    ["version", "promote"],
    ["version", "rollback"],
    ["report", "flight"],
    ["report", "update"],
    ["report", "version"],
    ["store", "push"],
    ["store", "pull"],
    ["store", "trim"],
    ["user", "add"],
    ["user", "token"],
    ["user", "list"],
    ["user", "remove"],
]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path], dict[str, Any]]:
    return from_logs_to_proof(
        tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("made") / "w"
    )


def from_logs_to_proof(folder: Path, workspace: Path) -> tuple[Path, list[Path], dict[str, Any]]:
    """Workspace, logs and the update's answer, made by the command as people type it."""
    logs = write_files(folder)
    assert asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))["vehicle"] == NAME
    assert (
        asked(workspace, "database", "import", str(folder / "database.toml"), "--vehicle", NAME)[
            "label"
        ]
        == "v0001"
    )
    ingested = aerodb(
        workspace, "--json", "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct"
    )
    assert ingested.returncode == 0, ingested.stderr
    assert [outcome["status"] for outcome in document(ingested.stdout)] == ["stored"] * 6
    assert "6 of 6 logs stored" in ingested.stderr
    update = aerodb(
        workspace,
        "--json",
        "update",
        "--vehicle",
        NAME,
        "--model",
        str(folder / "model.toml"),
        "--direct",
    )
    assert update.returncode == 0, update.stderr
    assert "proved" in update.stderr
    return workspace, logs, document(update.stdout)


def test_update_answers_with_the_document_of_the_contract(
    made: tuple[Path, list[Path], dict[str, Any]],
) -> None:
    update = made[2]
    for key in (
        "vehicle",
        "baseline",
        "candidate",
        "flights",
        "axes",
        "findings",
        "not_found",
        "next_flight",
    ):
        assert key in update
    assert set(update["flights"]) == {"identified", "held_out", "excluded"}
    wanted = {
        "rms_before",
        "rms_after",
        "held_out_rms_before",
        "held_out_rms_after",
        "theil",
        "noise_floor",
    }
    assert all(wanted <= set(entry) for entry in update["axes"].values())
    assert set(update["axes"]["CZ"]["theil"]) == {"fit_percent", "bias", "variance", "covariance"}


def test_every_command_of_the_list_is_there_and_no_other() -> None:
    groups = {
        group.typer_instance.info.name: group.typer_instance for group in app.registered_groups
    }
    there = [
        [str(name), command.name or command.callback.__name__]
        for name, group in groups.items()
        for command in group.registered_commands
    ]
    there += [[command.name] for command in app.registered_commands]
    assert sorted(there) == sorted(COMMANDS)


@pytest.mark.parametrize("command", [[], *COMMANDS], ids=" ".join)
def test_help_shows_an_example(command: list[str]) -> None:
    result = CliRunner().invoke(app, [*command, "--help"])
    assert result.exit_code == 0
    example = re.search(r"Example: (aerodb .*)", result.stdout)
    assert example, result.stdout
    if command:
        assert example[1].startswith("aerodb " + " ".join(command))


def test_vehicle_init_add_list_show(tmp_path: Path) -> None:
    workspace = tmp_path / "w"
    made = aerodb(workspace, "--json", "vehicle", "init", "my-glider", folder=tmp_path)
    assert (made.returncode, document(made.stdout)) == (0, {"file": "my-glider.toml"})
    text = (tmp_path / "my-glider.toml").read_text(encoding="utf-8")
    assert parse_vehicle(text).name == "my-glider"
    again = aerodb(workspace, "vehicle", "init", "my-glider", folder=tmp_path)
    assert (again.returncode, again.stderr.splitlines()[0]) == (
        3,
        "aerodb: my-glider.toml: the file exists already",
    )
    added = asked(workspace, "vehicle", "add", str(tmp_path / "my-glider.toml"))
    assert [entry["vehicle"] for entry in asked(workspace, "vehicle", "list")] == ["my-glider"]
    assert asked(workspace, "vehicle", "show", "my-glider") == {**added, "text": text}
    people = aerodb(workspace, "vehicle", "show", "my-glider")
    assert people.stdout.strip() == text.strip()
    assert people.stderr == ""


def test_queries_about_versions(made: tuple[Path, list[Path], dict[str, Any]]) -> None:
    workspace, _, update = made
    baseline, candidate = asked(workspace, "version", "list", "--vehicle", NAME)
    assert (baseline["names"], candidate["names"]) == (["released"], ["candidate"])
    assert (candidate["version"], candidate["parent"]) == (update["candidate"], baseline["version"])
    for reference in ("candidate", "v0002", candidate["version"], candidate["version"][:10]):
        assert asked(workspace, "version", "show", reference)["version"] == candidate["version"]
    assert asked(workspace, "version", "show", "candidate")["report"]["axes"] == update["axes"]
    moves = asked(workspace, "version", "history")
    assert [(move["name"], move["to"], move["from"]) for move in moves] == [
        ("released", baseline["version"], None),
        ("candidate", candidate["version"], None),
    ]
    lineage = asked(workspace, "version", "lineage", "candidate")
    assert [row["label"] for row in lineage["line"]] == ["v0002", "v0001"]
    assert (
        sorted(use["role"] for use in lineage["flights"]) == ["held_out"] * 2 + ["identified"] * 4
    )
    assert all(use["log_sha256"] == use["flight"] for use in lineage["flights"])
    impact = asked(workspace, "version", "impact", update["flights"]["held_out"][0][:12])
    assert impact["versions"] == [
        {"version": candidate["version"], "role": "held_out", "through": candidate["version"]}
    ]


def test_evaluate_gives_the_handbook_value_and_the_increment(
    made: tuple[Path, list[Path], dict[str, Any]],
) -> None:
    """At 4 degrees the table holds -0.65; the update adds its constant and its slope in alpha
    there."""
    workspace, _, update = made
    at = ("--at", "alpha=4deg,V=25")
    before = asked(workspace, "version", "evaluate", "released", *at)
    after = asked(workspace, "version", "evaluate", "candidate", *at)
    assert before["coefficients"]["CZ"] == pytest.approx(-0.65, abs=1e-12)
    assert before["coefficients"]["Cm"] == pytest.approx(-0.6 * 0.06981317, rel=1e-6)
    terms = {
        t["term"]: t["value"] for e in update["increments"] if e["axis"] == "CZ" for t in e["terms"]
    }
    assert after["coefficients"]["CZ"] == pytest.approx(
        -0.65 + terms["1"] + terms["alpha"] * 0.0698131700797, rel=1e-9
    )
    assert (before["standard_errors"]["CZ"], before["places"]["CZ"]) == (None, "inside tables"), (
        "nobody has quantified it"
    )
    assert after["places"]["CZ"] == "inside data"
    assert 0.0 < after["standard_errors"]["CZ"] < 0.1
    assert (after["standard_errors"]["Cl"], after["places"]["Cl"]) == (None, "inside tables")
    assert before["taken_as_zero"] == ["beta", "delta_elevator", "p", "q"]
    assert not before["outside_tables"]
    assert asked(workspace, "version", "evaluate", "released", "--at", "alpha=0.5,V=25")[
        "outside_tables"
    ]
    apart = asked(
        workspace, "version", "evaluate", "candidate", "--at", "alpha=4deg", "--at", "V=25"
    )
    assert apart["coefficients"] == after["coefficients"]


def test_a_version_is_shown_layered_or_consolidated(
    made: tuple[Path, list[Path], dict[str, Any]],
) -> None:
    workspace, _, _ = made
    layered = asked(workspace, "version", "show", "candidate")
    shown = asked(workspace, "version", "show", "candidate", "--consolidated")
    assert {key: shown[key] for key in layered} == layered
    folded = {fold["regressor"]: fold["table"] for fold in shown["folds"] if fold["axis"] == "CZ"}
    assert folded["alpha"] == folded["1"] != folded.get("q_hat")
    assert all(bool(fold["table"]) != bool(fold["reason"]) for fold in shown["folds"])
    assert any(increment["folded"] for increment in shown["consolidated"]["increments"])


def test_inspect_stores_nothing_and_says_what_is_missing(
    made: tuple[Path, list[Path], dict[str, Any]], tmp_path: Path
) -> None:
    workspace, logs, _ = made
    before = state_of(workspace, but=("catalogue.sqlite",))
    found = asked(workspace, "log", "inspect", str(logs[0]))
    assert found["mapping"] == "canonical"
    assert {"alpha", "qbar", "az", "delta_elevator"} <= set(found["channels"])
    assert "mass" in found["missing"]
    assert state_of(workspace, but=("catalogue.sqlite",)) == before
    asked(tmp_path / "none", "log", "inspect", str(logs[0]))
    assert not (tmp_path / "none").exists()


def test_retracting_a_flight_makes_versions_stale(tmp_path: Path, shared: SharedWorkspaces) -> None:
    opened, first = shared.updated(tmp_path / "w", flights=3)
    workspace, model = opened.root, shared.logs[0].parent / "model.toml"
    update = ("update", "--vehicle", NAME, "--model", str(model), "--direct")
    assert first["validation"]["kind"] == "cross-validated"
    flight = first["flights"]["identified"][0]
    assert asked(workspace, "version", "show", "candidate")["stale"] == []
    retracted = asked(
        workspace, "flight", "retract", flight[:12], "--reason", "pitot cover left on"
    )
    command = f"aerodb update --vehicle {NAME} --like v0002 --baseline v0001"
    assert retracted == {
        "flight": flight,
        "reason": "pitot cover left on",
        "user": user(),
        "stale": [first["candidate"]],
        "names": {"candidate": first["candidate"]},
        "rebuild": [{"version": first["candidate"], "label": "v0002", "command": command}],
    }
    assert "pitot cover left on" in asked(workspace, "version", "show", "candidate")["stale"][0]
    assert asked(workspace, "version", "show", "released")["stale"] == []
    shown = asked(workspace, "flight", "show", flight)
    assert shown["retracted"] == "pitot cover left on"
    assert {"flight": flight, "reason": "retracted: pitot cover left on"} in asked(
        workspace, *update
    )["flights"]["excluded"]
    again = asked(workspace, *command.split()[1:], "--direct")
    assert again["flights"]["identified"] == first["flights"]["identified"][1:]
    assert asked(workspace, "version", "show", "candidate")["stale"] == []


@pytest.mark.parametrize(
    ("arguments", "code", "first", "second"),
    [
        (
            ["version", "show", "relased"],
            2,
            "vehicle small-glider: unknown version 'relased'",
            "did you mean 'released'?",
        ),
        (
            ["vehicle", "show", "small-glidr"],
            2,
            "unknown vehicle 'small-glidr'",
            "did you mean 'small-glider'?",
        ),
        (["flight", "show", "zzz"], 2, "unknown flight 'zzz'", "known names: "),
        (
            ["version", "evaluate", "released", "--at", "alhpa=5deg"],
            3,
            "--at: 'alhpa=5deg' is not an input",
            "did you mean 'alpha'?",
        ),
        (
            ["version", "evaluate", "released", "--at", "alpha=1deg", "--at", "alpha=2deg"],
            3,
            "--at: alpha stands twice",
            "give each input once",
        ),
        (
            ["version", "evaluate", "released", "--at", "alpha=nan"],
            3,
            "--at: 'alpha=nan' is not a finite number",
            "give a number",
        ),
        (
            ["version", "evaluate", "released", "--at", "alpha=five"],
            3,
            "'five' is not a quantity",
            "write a number (in rad)",
        ),
        (
            ["version", "show", "released", "--as-of", "soon"],
            3,
            "--as-of: 'soon' is not a date",
            "for example 2026-05-31",
        ),
        (
            ["database", "import", "none.toml", "--vehicle", NAME],
            3,
            "none.toml: no such file",
            "check the path",
        ),
        (["log", "inspect", "none.ulg"], 3, "none.ulg: no such file", "check the path"),
        (
            ["vehicle", "add", "none.toml"],
            3,
            "none.toml: No such file or directory",
            "check the path",
        ),
        (
            ["flight", "ingest", "none.ulg", "--vehicle", NAME, "--direct"],
            3,
            "none.ulg: No such file",
            "check the path",
        ),
        (
            ["flight", "ingest", "none.ulg", "--vehicle", "nobody"],
            2,
            "unknown vehicle 'nobody'",
            "known names: small-glider",
        ),
    ],
)
def test_refusals_are_two_lines_and_an_exit_code(
    made: tuple[Path, list[Path], dict[str, Any]],
    tmp_path: Path,
    arguments: list[str],
    code: int,
    first: str,
    second: str,
) -> None:
    done = aerodb(made[0], *arguments, folder=tmp_path)
    lines = done.stderr.splitlines()
    assert (done.returncode, len(lines)) == (code, 2), done.stderr
    assert lines[0].startswith(f"aerodb: {first}")
    assert lines[1].startswith(second)
    assert done.stdout == ""


def test_wrong_usage_and_an_absent_workspace(tmp_path: Path) -> None:
    unknown = aerodb(tmp_path / "w", "nonsense")
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert "No such command 'nonsense'" in unknown.stderr
    lacking = aerodb(tmp_path / "w", "recalibrate")
    assert lacking.returncode == 2
    assert "--reason" in lacking.stderr
    assert lacking.stderr.splitlines()[-1].startswith("Example: aerodb recalibrate ")
    assert "Example" not in unknown.stderr
    absent = aerodb(tmp_path / "w", "version", "list")
    assert absent.returncode == 3
    assert absent.stderr.splitlines()[1] == (
        "name an existing workspace with --workspace or $AERODB_WORKSPACE, or make one: aerodb"
        " demo, or aerodb vehicle init"
    )
    assert not (tmp_path / "w").exists(), "a query makes no workspace"


@pytest.mark.skipif(not can_be_set(), reason="needs a C compiler to set the clock")
def test_a_clock_that_python_cannot_count_is_the_computers_fault(tmp_path: Path) -> None:
    clock = Clock(tmp_path / "clock")
    set_clock(clock.added, 251_600_000_000)  # the year 9998
    done = subprocess.run(
        [Path(sys.executable).with_name("aerodb"), "--workspace", str(tmp_path), "status"],
        env={**os.environ, "PYTHONPATH": str(ROOT), **clock.environment},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == [
        "aerodb: this computer: its clock is after the year 2262, where Python's time ends",
        "set the clock",
    ]


@pytest.mark.parametrize(
    "arguments", [["--help"], ["version", "list"], ["nonsense"], ["--debug", "flight", "list"]]
)
def test_a_forked_command_ends_as_the_installed_one(tmp_path: Path, arguments: list[str]) -> None:
    """Output, errors and exit code (0, 3, 2, and 1 with a traceback) of the script ``aerodb``."""
    script = Path(sys.executable).with_name("aerodb")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AERODB_")}
    environment = {**kept, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    installed = subprocess.run(
        [script, "--workspace", str(tmp_path), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    forked = aerodb(tmp_path, *arguments)
    assert (forked.returncode, forked.stdout) == (installed.returncode, installed.stdout)
    last = [done.stderr.splitlines()[-1:] for done in (forked, installed)]
    assert last[0] == last[1]
    assert ("Traceback" in forked.stderr) == ("Traceback" in installed.stderr)


def test_help_waits_for_no_catalogue_and_no_science() -> None:
    code = (
        "import sys; from aerodb.flows.cli.main import app; app(['--help'], standalone_mode=False);"
        " heavy = {'numpy', 'sqlalchemy', 'pydantic', 'pyarrow', 'prefect'} & set(sys.modules);"
        " sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=600
    )
    assert done.returncode == 0, done.stderr


def test_debug_shows_the_traceback(made: tuple[Path, list[Path], dict[str, Any]]) -> None:
    done = aerodb(made[0], "--debug", "vehicle", "show", "nobody")
    assert done.returncode != 0
    assert "Traceback" in done.stderr
    assert "UnknownNameError" in done.stderr


def test_headings_keep_their_units(made: tuple[Path, list[Path], dict[str, Any]]) -> None:
    """``[s]`` in a heading was once read as markup and vanished."""
    assert "duration [s]" in aerodb(made[0], "flight", "list").stdout
    assert "longest [s]" in aerodb(made[0], "log", "inspect", "-v", str(made[1][0])).stdout


def test_numbers_that_json_lacks_are_null(tmp_path: Path) -> None:
    """A topic with one sample has no rate: it once came out as NaN, which no JSON parser has to
    take."""
    topics = [
        Topic("once", np.array([1.0]), {"x": np.array([1.0])}),
        Topic("more", np.arange(5.0), {"x": np.arange(5.0)}),
    ]
    write_ulog(tmp_path / "log.ulg", topics, metadata={"sys_name": "TEST"})
    found = asked(tmp_path / "none", "log", "inspect", str(tmp_path / "log.ulg"))
    assert {topic["topic"]: topic["rate"] for topic in found["topics"]} == {
        "once": None,
        "more": 1.0,
    }
