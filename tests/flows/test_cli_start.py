"""The command line at the start: options anywhere, help in sections that is not cut, one flight
beside any version, and what is said after a batch of logs."""

from pathlib import Path

from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv


def test_help_is_in_sections_and_not_cut() -> None:
    said = CliRunner().invoke(app, ["--help"]).stdout
    assert "First steps:" in said
    assert "Commands:" not in said, "every command has a section"
    assert "..." not in said.replace("[ARGS]...", "")
    assert "..." not in CliRunner().invoke(app, ["version", "--help"]).stdout.replace("...", "", 1)


def test_version_and_completion_are_offered() -> None:
    assert CliRunner().invoke(app, ["--version"]).stdout.startswith("aerodb ")
    assert "--install-completion" in CliRunner().invoke(app, ["--help"]).stdout


def test_json_may_stand_behind_the_command(tmp_path: Path, shared: SharedWorkspaces) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    before = aerodb(workspace.root, "--json", "version", "list").stdout
    assert aerodb(workspace.root, "version", "list", "--json").stdout == before
    assert aerodb(workspace.root, "version", "--json", "list", "--", "--json").returncode == 2


def test_a_flight_is_compared_with_any_version(tmp_path: Path, shared: SharedWorkspaces) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    flight = asked(workspace.root, "flight", "list")[0]["flight"]
    first = asked(workspace.root, "flight", "compare", flight, "v0001")
    second = asked(workspace.root, "flight", "compare", flight, "candidate")
    assert (first["label"], second["label"]) == ("v0001", "v0002")
    axis = {
        name: each["axes"]["CZ"]["rms_residual"] for name, each in (("1", first), ("2", second))
    }
    assert axis["2"] < axis["1"]  # the candidate has the lift slope that flies
    assert (
        "flight - database rms"
        in aerodb(workspace.root, "flight", "compare", flight, "v0001").stdout
    )
    assert aerodb(workspace.root, "flight", "compare", flight, "v0009").returncode == 2


def test_a_batch_begins_with_its_verdict_and_flights_have_the_names_of_files(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    (workspace.root / "settings.toml").write_text("[work]\ndirect = true\n", encoding="utf-8")
    good = write_csv(tmp_path / "morning.csv", channels(11))
    (tmp_path / "bad.csv").write_text("no,numbers\nhere,at all\n", encoding="utf-8")
    words = ("flight", "ingest", str(good), str(tmp_path / "bad.csv"), "--vehicle", NAME)
    done = aerodb(workspace.root, *words)
    assert done.returncode == 3
    assert done.stdout.startswith(f"{NAME}: 1 of 2 logs stored: 1 limited; 1 refused\n")
    assert done.stderr.startswith("aerodb: ")
    assert "bad.csv" in done.stderr
    assert "morning.csv" in aerodb(workspace.root, "flight", "list").stdout
    runs = aerodb(workspace.root, "version", "lineage", "released").stdout
    assert "ephemeral" not in runs
