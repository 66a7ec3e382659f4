"""`aerodb verify`: no problem in a sound workspace; each planted fault found and named once, with a
remedy that works."""

import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.file_identity import measured
from aerodb.storage.catalogue.seal import seal_of
from aerodb.storage.files.flights import INDEX
from aerodb.storage.upkeep.backup import back_up, restore
from aerodb.storage.upkeep.problems import VerificationReport
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.support.glider_runs import stored
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Path, list[Path]]:
    """A workspace after ingestion, update and closed loop, with a log in quarantine; and its
    logs."""
    workspace, document = shared.updated(tmp_path_factory.mktemp("w"), flights=3)
    flights = [*document["flights"]["identified"], *document["flights"]["held_out"]]
    loop = {"vehicle": NAME, "baseline": document["baseline"], "flights": flights}
    loop["accept_ambiguous"] = ["alpha_slope"]
    run_flow(close_loop_flow, loop, workspace, "direct")
    bad = tmp_path_factory.mktemp("bad") / "bad.csv"
    bad.write_text("no numbers\n")
    run_flow(flight_flow, {"logs": [str(bad)], "vehicle": NAME}, workspace, "direct")
    return workspace.root, shared.logs[:3]


@pytest.fixture
def workspace(made: tuple[Path, list[Path]], tmp_path: Path) -> Workspace:
    return Workspace.open(Path(shutil.copytree(made[0], tmp_path / "w")))


def report_of(workspace: Workspace) -> VerificationReport:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return verify(workspace, catalogue)


def kinds(workspace: Workspace) -> list[tuple[str, str]]:
    return [(problem.kind, problem.where) for problem in report_of(workspace).problems]


def file_of(workspace: Workspace, step: str) -> Path:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return workspace.resolve(catalogue.results_of(catalogue.flights(NAME)[0].id, step)[0].path)


def by_hand(workspace: Workspace, statement: str) -> None:
    """Changes the catalogue as only somebody can who takes its triggers away."""
    seal_of(workspace.catalogue).unlink(missing_ok=True)
    raw = sqlite3.connect(workspace.catalogue)
    triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    for name, _ in triggers:
        raw.execute(f"DROP TRIGGER {name}")
    assert raw.execute(statement).rowcount == 1
    for _, sql in triggers:
        raw.execute(sql)
    raw.commit()
    raw.close()


def test_a_sound_workspace_is_clean_and_everything_was_looked_at(workspace: Workspace) -> None:
    report = report_of(workspace)
    assert report.problems == []
    files = [
        path
        for folder in ("flights", "results", "logs")
        for path in (workspace.root / folder).rglob("*")
        if path.is_file()
    ]
    quarantined = list((workspace.root / "quarantine").glob("*/log*"))
    assert report.checked["files"] == len(files) + len(quarantined)
    assert report.checked["bytes"] == sum(path.stat().st_size for path in [*files, *quarantined])
    assert (report.checked["flights"], report.checked["versions"], report.pending) == (3, 3, 0)
    assert report.checked["edges"] > 20


@pytest.mark.parametrize(
    "step", ["ingest", "conditioning", "consistency", "coefficients", "compare", "gram"]
)
def test_one_flipped_bit_in_any_kind_of_result_is_found(workspace: Workspace, step: str) -> None:
    path = file_of(workspace, step)
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    assert kinds(workspace) == [("changed", workspace.relative(path))]


def test_what_is_damaged_is_made_again_as_the_hint_says(
    workspace: Workspace, made: tuple[Path, list[Path]]
) -> None:
    """Results by whoever asks next, topics by taking the log in again; ids and keys stay."""
    kept = stored(workspace)
    results = [
        file_of(workspace, step)
        for step in ("ingest", "conditioning", "consistency", "coefficients", "compare")
    ]
    topics = next((workspace.root / "flights").glob("*/*.topics"))
    for path in results:
        path.write_bytes(b"\0")
    (topics / "0000.parquet").write_bytes(b"\0")
    problems = report_of(workspace).problems
    assert sorted(problem.where for problem in problems) == sorted(
        [*map(workspace.relative, results), workspace.relative(topics / "0000.parquet")]
    )
    for problem in problems:
        place = workspace.resolve(problem.where)
        assert problem.remedy.startswith("remove")
        shutil.rmtree(place.parent) if "this folder" in problem.remedy else place.unlink()
    assert {kind for kind, _ in kinds(workspace)} == {"missing"}
    run_flow(
        flight_flow, {"logs": [str(log) for log in made[1]], "vehicle": NAME}, workspace, "direct"
    )
    assert kinds(workspace) == []
    assert stored(workspace) == kept


def test_missing_orphan_and_half_written_files_are_told_apart(workspace: Workspace) -> None:
    gone = file_of(workspace, "coefficients")
    gone.unlink()
    orphan = workspace.result_path("ab" * 32)
    orphan.write_bytes(b"whole, but without a row")
    command = [sys.executable, "-c", _HALF, str(workspace.result_path("cd" * 32))]
    assert subprocess.run(command, capture_output=True, cwd=ROOT).returncode == 9
    half = next((workspace.root / "results").rglob(".*.tmp"))
    long_ago = time.time() - 3600
    os.utime(orphan, (long_ago, long_ago))
    expected = [("half-written", half), ("missing", gone), ("orphan", orphan)]
    assert sorted(kinds(workspace)) == [(kind, workspace.relative(path)) for kind, path in expected]


_HALF = """
import os, sys, pathlib
from aerodb.storage.workspace import write_atomically
write_atomically(pathlib.Path(sys.argv[1]), lambda temporary: (temporary.write_bytes(b"half"), os._exit(9)))
"""


def test_what_is_being_written_now_is_no_fault(workspace: Workspace) -> None:
    workspace.result_path("ab" * 32).write_bytes(b"its row comes in a moment")
    seen: list[VerificationReport] = []

    def write(temporary: Path) -> None:
        temporary.write_bytes(b"half")
        seen.append(report_of(workspace))

    from aerodb.storage.workspace import write_atomically

    write_atomically(workspace.result_path("cd" * 32), write)
    assert (seen[0].problems, seen[0].pending) == ([], 2)


def test_a_topic_that_is_gone_or_does_not_belong_is_found(workspace: Workspace) -> None:
    folder = next((workspace.root / "flights").glob("*/*.topics"))
    (folder / "0000.parquet").rename(folder / "0001.parquet")
    found = kinds(workspace)
    assert ("missing", workspace.relative(folder / "0000.parquet")) in found
    assert ("orphan", workspace.relative(folder / "0001.parquet")) in found
    assert len(found) == 2
    (folder / "link").symlink_to("nowhere")
    assert set(kinds(workspace)) == {*found, ("orphan", workspace.relative(folder / "link"))}


def test_what_was_stored_before_hashes_were_kept_is_told_and_backed_up(
    workspace: Workspace, tmp_path: Path
) -> None:
    folder = next((workspace.root / "flights").glob("*/*.topics"))
    index = json.loads((folder / INDEX).read_text())
    names = sorted(path.name for path in folder.glob("*.parquet"))
    (folder / INDEX).write_text(
        json.dumps({key: value for key, value in index.items() if key != "files"})
    )
    by_hand(
        workspace, f"DELETE FROM stored_files WHERE path = '{workspace.relative(folder / INDEX)}'"
    )
    (deleted,) = [each for each in kinds(workspace) if each[0] == "chain"]  # for this test
    assert kinds(workspace) == [deleted, ("no hash", workspace.relative(folder / INDEX))]
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_file(workspace.relative(folder / INDEX), *measured(folder / INDEX))
    unknown = [("no hash", workspace.relative(folder / name)) for name in names]
    assert kinds(workspace) == [deleted, *unknown]
    assert back_up(workspace, tmp_path / "b").problems == ()
    assert (tmp_path / "b" / workspace.relative(folder / names[0])).is_file()
    left = restore(tmp_path / "b", tmp_path / "new")["problems"]
    assert [(problem["kind"], problem["where"]) for problem in left] == kinds(workspace)


def test_quarantined_logs_are_what_their_names_say(workspace: Workspace) -> None:
    log = next((workspace.root / "quarantine").glob("*/log.csv"))
    log.write_text("no numberz\n")
    assert kinds(workspace) == [("changed", workspace.relative(log))]
    log.unlink()
    assert kinds(workspace) == [("missing", workspace.relative(log.parent))]


def test_logs_as_they_came_are_what_their_names_say(
    workspace: Workspace, made: tuple[Path, list[Path]]
) -> None:
    """Also one whose hash was not noted any more when its run was killed."""
    sha256 = hashlib.sha256(made[1][0].read_bytes()).hexdigest()
    kept = workspace.log_path(sha256, ".csv")
    shutil.copyfile(made[1][0], kept)
    assert kinds(workspace) == []
    kept.write_text("something else")
    assert kinds(workspace) == [("changed", workspace.relative(kept))]


@pytest.mark.parametrize(
    ("statement", "where"),
    [
        ("UPDATE versions SET settings = '{}' WHERE number = 2", f"v0002 of {NAME}"),
        (
            "UPDATE versions SET content = replace(content, '-0.65', '-0.66') WHERE number = 1",
            f"v0001 of {NAME}",
        ),
        (
            "UPDATE versions SET content = replace(content, '-0.03', '-0.04') WHERE number = 1",
            f"v0001 of {NAME}",
        ),
        (
            "DELETE FROM version_inputs WHERE rowid = (SELECT min(rowid) FROM version_inputs)",
            f"v0001 of {NAME}",
        ),
        ("UPDATE vehicle_texts SET text = text || ' '", f"vehicle {NAME}"),
        (
            (
                "UPDATE name_events SET previous = version WHERE sequence = (SELECT max(sequence)"
                " FROM name_events)"
            ),
            "'candidate'",
        ),
        (
            (
                "UPDATE result_inputs SET input_key = 'gone' WHERE rowid = (SELECT min(rowid) FROM"
                " result_inputs)"
            ),
            "result ",
        ),
        (
            (
                "UPDATE version_inputs SET input_key = 'gone' WHERE rowid = (SELECT max(rowid) FROM"
                " version_inputs)"
            ),
            f"v0003 of {NAME}",
        ),
    ],
)
def test_a_catalogue_changed_by_hand_is_found_out(
    workspace: Workspace, statement: str, where: str
) -> None:
    by_hand(workspace, statement)
    found = [place for kind, place in kinds(workspace) if kind == "catalogue"]
    assert any(where in place for place in found), found


def test_guards_and_foreign_keys(workspace: Workspace) -> None:
    raw = sqlite3.connect(workspace.catalogue)
    raw.execute("DROP TRIGGER versions_no_update")
    raw.commit()
    raw.close()
    assert kinds(workspace) == [("catalogue", "trigger versions_no_update of versions")]
    with sqlite3.connect(workspace.catalogue) as raw:
        raw.execute("PRAGMA foreign_keys = OFF")
        raw.execute("INSERT INTO run_versions VALUES ('no such run', 'no such version')")
    raw.close()
    assert ("catalogue", "table run_versions") in kinds(workspace)


def test_the_command_says_it_in_json_and_by_its_exit_code(workspace: Workspace) -> None:
    def called(*options: str) -> Any:
        return CliRunner().invoke(app, ["--workspace", str(workspace.root), *options, "verify"])

    clean = called("--json")
    assert clean.exit_code == 0
    assert json.loads(clean.stdout)["clean"] is True
    gone = file_of(workspace, "gram")
    gone.unlink()
    assert "missing: " + workspace.relative(gone) in called().stdout
    wrong = called("--json")
    assert wrong.exit_code == 1
    (problem,) = json.loads(wrong.stdout)["problems"]
    assert (problem["kind"], problem["remedy"]) == (
        "missing",
        "it is recomputed when it is needed next",
    )
