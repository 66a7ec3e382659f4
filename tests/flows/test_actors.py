"""Who acts on the command line, and what the role allows once a workspace has users."""

import json
import os
import pwd
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks import actors
from aerodb.tasks.actors import NotAllowedError
from tests.support.command import aerodb, asked
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, VEHICLE

ME = pwd.getpwuid(os.getuid()).pw_name


@pytest.fixture
def workspace(shared: SharedWorkspaces, tmp_path: Path) -> Workspace:
    return shared.ingested(tmp_path / "w")


def test_nobody_acts_under_the_name_in_the_environment(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.setenv(variable, "mallory")
    given = ("version", "promote", "v0001", "--name", "mine", "--reason", "r")
    done = aerodb(workspace.root, "--json", *given)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["event"]["user"] == ME
    flight = asked(workspace.root, "flight", "list")[0]["flight"]
    assert asked(workspace.root, "flight", "retract", flight, "--reason", "r")["user"] == ME


#: Flow -> how the table of roles in docs/security.md calls its command.
NAMED = {
    "flight_flow": "flight ingest", "again_flow": "flight ingest", "compare_flow": "compare",
    "frequency_response_flow": "frequency-response", "turbulence_flow": "turbulence",
    "wake_flow": "wake", "tabulate_flow": "version tabulate", "update_flow": "update",
    "close_loop_flow": "close-loop", "estimate_flow": "estimate", "nightly_flow": "nightly",
    "recalibrate_flow": "recalibrate", "import_flow": "database import",
    "promote_flow": "version promote", "roll_back_flow": "version rollback",
    "fly_flow": "version fly", "manoeuvre_flow": "version fly", "validate_flow": "validate",
    "gate_flow": "gate", "report_flow": "reports", "inputs_flow": "queries",
    "sweep_flow": "the runs of `serve`",
}  # fmt: skip


def test_the_table_of_roles_has_every_flow() -> None:
    asks = re.compile(r'@requires\("(\w+)"\)\ndef (\w+)\(')
    found = [
        pair for file in (ROOT / "flows").glob("*.py") for pair in asks.findall(file.read_text())
    ]
    assert {flow for _, flow in found} == NAMED.keys()
    text = (ROOT / "docs" / "security.md").read_text()
    rows = {role: re.findall(rf"^\| {role} \|.*$", text, re.M) for role, _ in found}
    for role, flow in found:
        (row,) = rows[role]
        assert NAMED[flow] in row, (role, flow)


@pytest.mark.parametrize("role", ["", "read", "ingest", "release"])
def test_with_users_the_command_line_asks_for_roles(
    workspace: Workspace, tmp_path: Path, role: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_user("somebody", "release", 64 * "0", by="test")
        if role:
            catalogue.add_user(ME, role, 64 * "1", by="test")  # type: ignore[arg-type]
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text(VEHICLE)
    promote = ["version", "promote", "v0001", "--name", "mine", "--reason", "r"]
    needs = {
        "release": [
            promote,
            ["user", "add", "x", "--role", "read"],
            ["user", "remove", "somebody"],
        ],
        "ingest": [["vehicle", "add", str(vehicle)]],
        "read": [["report", "version", "v0001", "--output", str(tmp_path / "r.html")]],
        "": [["flight", "list"], ["user", "list"]],
    }
    monkeypatch.setattr(actors, "_owns", lambda _: False)
    order = ["", "read", "ingest", "release"]
    for needed, commands in needs.items():
        for command in commands:
            result = CliRunner().invoke(app, ["--workspace", str(workspace.root), *command])
            if order.index(needed) <= order.index(role):
                assert result.exit_code == 0, (command, result.exception, result.output)
            else:
                assert isinstance(result.exception, NotAllowedError), command
                with Catalogue.open(workspace.catalogue) as catalogue:
                    assert "mine" not in catalogue.names(NAME)
                    assert catalogue.user("somebody").role == "release"


def test_the_owner_of_the_folder_may_do_everything(workspace: Workspace) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_user("somebody", "release", 64 * "0", by="test")
    assert asked(workspace.root, "user", "remove", "somebody")["removed"]
    assert asked(workspace.root, "user", "list") == []
