"""Versions flown over flights."""

from pathlib import Path

from aerodb.flows.fly import validate_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import DATABASE, NAME


def test_a_version_without_inputs_is_validated(tmp_path: Path, shared: SharedWorkspaces) -> None:
    """Nothing can move it: its oscillations are looked for in the whole stretch."""
    workspace, document = shared.updated(tmp_path / "w", flights=3)
    file = tmp_path / "bare.toml"
    file.write_text(DATABASE.replace("delta_elevator = -1.1\n", ""), encoding="utf-8")
    given = {"file": str(file), "vehicle": NAME, "bindings": {}}
    bare = run_flow(import_flow, given, workspace, "direct")
    flown = run_flow(
        validate_flow,
        {
            "version": document["candidate"],
            "baseline": bare["version"],
            "flights": document["flights"]["identified"][:1],
        },
        workspace,
        "direct",
    )
    assert flown["checks"]
    q = next(row for row in flown["responses"] if row["channel"] == "q")
    assert q["rms_error"] < q["before"]["rms_error"], "without the elevator it does not follow"
