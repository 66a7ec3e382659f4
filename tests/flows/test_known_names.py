"""Names that help lists: those of the code, all of them; and what takes its vehicle from the
workspace."""

from pathlib import Path

import pytest

from aerodb.effects import library
from aerodb.errors import InputError
from aerodb.flows.cli import known_names
from aerodb.identification import METHODS, chosen_methods
from aerodb.storage.readers import any_format
from aerodb.tasks.steps import importing
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, VEHICLE


def test_help_lists_the_methods_and_effects_that_there_are() -> None:
    assert ", ".join(METHODS) == known_names.METHODS
    effects = dict.fromkeys(template.effect for template in library.TEMPLATES)
    assert ", ".join(effects) == known_names.EFFECTS


def test_help_lists_every_format_that_is_read() -> None:
    logs = Path(any_format.__file__).read_text("utf-8")
    for name in ("ULog", "DataFlash", "MCAP"):
        assert f"read_{name.lower()}" in logs
        assert name in known_names.LOGS
    databases = Path(importing.__file__).read_text("utf-8")
    for name in ("DAVE-ML", "JSBSim", "CSV", "MAT", "NetCDF", "native"):
        assert name.lower().replace("-", "") in databases
        assert name in known_names.DATABASES


def test_an_unknown_method_lists_all_that_exist() -> None:
    with pytest.raises(InputError) as error:
        chosen_methods(["zzz"])
    assert all(name in error.value.remedy for name in METHODS)


def test_the_only_vehicle_need_not_be_named(tmp_path: Path, shared: SharedWorkspaces) -> None:
    workspace, folder = shared.ingested(tmp_path / "w").root, shared.logs[0].parent
    model = str(folder / "model.toml")
    assert asked(workspace, "estimate", "--model", model)["methods"]
    assert asked(workspace, "update", "--model", model, "--direct")["candidate"]
    other = tmp_path / "other.toml"
    other.write_text(VEHICLE.replace(NAME, "another"), "utf-8")
    asked(workspace, "vehicle", "add", str(other))
    log = str(shared.logs[0])
    for command in (
        ["close-loop"],
        ["update", "--model", model],
        ["estimate", "--model", model],
        ["estimate-online", "--model", model],
        ["recalibrate", "--reason", "x"],
        ["database", "import", str(folder / "database.toml")],
        ["flight", "ingest", log],
    ):
        done = aerodb(workspace, *command)
        assert done.returncode == 2, command
        assert "which vehicle?" in done.stderr
        assert f"--vehicle another or {NAME}" in done.stderr


def test_flights_have_the_names_that_lists_show(tmp_path: Path, shared: SharedWorkspaces) -> None:
    workspace = shared.ingested(tmp_path / "w").root
    rows = {row["flight"] for row in asked(workspace, "flight", "list")}
    named = [
        asked(workspace, "flight", "show", name)["flight"]
        for log in shared.logs
        for name in (log.name, log.stem)
    ]
    assert named[::2] == named[1::2]
    assert set(named) == rows


def test_a_list_marks_verdicts_by_limits_wider_than_usual(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    usual, workspace = shared.ingested(tmp_path / "w").root, tmp_path / "other"
    assert "wide limits" not in aerodb(usual, "flight", "list").stdout
    wide = tmp_path / "wide.toml"
    wide.write_text(VEHICLE.replace(NAME, "wide") + '\n[accuracy]\nattitude = "300 deg"\n', "utf-8")
    asked(workspace, "vehicle", "add", str(wide))
    assert aerodb(workspace, "flight", "ingest", str(shared.logs[0])).returncode == 0
    said = aerodb(workspace, "flight", "list").stdout
    rows = [line for line in said.splitlines() if ", wide limits" in line]
    assert [" wide " in row for row in rows] == [True]
    assert "wide limits: [accuracy] of the vehicle allows far more than usual" in said
