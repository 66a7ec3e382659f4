"""Parameters through the commands: JSBSim's T-38 flies, against its own file with named numbers of
which three are wrong."""

import json
from pathlib import Path
from typing import Any

import pytest

from aerodb.report import decision
from tests.campaigns.closed_loop import measured_wrongly
from tests.campaigns.fleet import airframe
from tests.campaigns.planted import measured_text
from tests.campaigns.runs import asked, prepared
from tests.support.build_up import T38, with_named_numbers
from tests.support.command import aerodb

pytestmark = pytest.mark.campaign

WRONG = {"lift_scale": 0.87, "elevator_power": -0.15, "aileron_power": 0.015}
VEHICLE = ("--vehicle", "t38")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    craft, folder = airframe("T38"), tmp_path_factory.mktemp("parameters")
    seen = measured_wrongly(craft, 11)
    numbers = [(55 + k) % 16 for k in range(6)]
    more = measured_text(craft)
    ready = prepared(craft, "declared", numbers, 11, folder / "all", folder / "flown", more, seen)
    file = folder / "named.toml"
    file.write_text(with_named_numbers(craft.database(), WRONG), encoding="utf-8")
    asked(ready.workspace, "database", "import", str(file), *VEHICLE)
    return ready.workspace


@pytest.fixture(scope="module")
def closed(workspace: Path) -> dict[str, Any]:
    found: dict[str, Any] = asked(
        workspace, "close-loop", *VEHICLE, "--baseline", "v0002", "--direct"
    )
    return found


def test_what_is_wrong_is_corrected_and_nothing_else(closed: dict[str, Any]) -> None:
    named = {each["name"]: each for each in closed["parameters"]}
    assert named.keys() == WRONG.keys()
    for name, each in named.items():
        true = T38[name][0]
        assert each["before"] == WRONG[name]
        assert abs(each["after"] - true) < 2.5 * each["standard_error"], name
        assert abs(each["after"] - true) < 0.2 * abs(WRONG[name] - true), name
    assert {f["verdict"] for f in closed["findings"] if f["effect"] == "parameter"} == {"confirmed"}
    for axis in ("CZ", "Cm", "Cl"):
        error = closed["axes"][axis]
        assert error["held_out_rms_after"] < 0.7 * error["held_out_rms_before"], axis


def test_a_version_tells_of_its_parameters(workspace: Path, closed: dict[str, Any]) -> None:
    changed = asked(workspace, "version", "diff", "v0002", closed["label"], *VEHICLE)
    edits = {term["name"]: term for term in changed["terms"]}
    assert edits.keys() == WRONG.keys()
    assert {term["kind"] for term in edits.values()} == {"parameter"}
    power = asked(
        workspace, "version", "lineage", closed["label"], "--node", "elevator_power", *VEHICLE
    )["parameter"]
    assert [flight["flight"] for flight in power["flights"]] == closed["flights"]["identified"]
    assert power["label"] == closed["label"]
    assert power["flown"]["alpha"][0] < power["flown"]["alpha"][1]
    before = asked(workspace, "version", "lineage", "v0002", "--node", "elevator_power", *VEHICLE)
    assert (before["parameter"]["value"], before["parameter"]["flights"]) == (-0.15, [])


def test_the_loop_says_what_the_gate_then_refuses(workspace: Path, closed: dict[str, Any]) -> None:
    """The database that it corrects was never released, of which the loop itself knows nothing."""
    reasons = [reason for check in closed["gate"]["checks"] for reason in check["reasons"]]
    assert any("made on v0002, but v0001 is released" in reason for reason in reasons)
    assert "the gate refuses it" in decision(closed).verdict
    asked_for = ("version", "promote", closed["label"], *VEHICLE, "--reason", "closed")
    refused = aerodb(workspace, *asked_for)
    assert refused.returncode == 4
    assert all(reason in refused.stderr for reason in reasons)


def test_other_simulators_get_them(workspace: Path, closed: dict[str, Any], tmp_path: Path) -> None:
    """Both files are read back, and JSBSim computes the check cases."""
    for form, name in (("jsbsim", "aero.xml"), ("daveml", "aero.dml")):
        target = tmp_path / name
        done = asked(
            workspace, "version", "export", closed["label"], *VEHICLE,
            "--format", form, "--output", str(target),
        )  # fmt: skip
        assert "elevator_power" in target.read_text(encoding="utf-8")
        assert "fail" not in json.dumps(done)


def test_estimate_prints_all_of_them(workspace: Path, tmp_path: Path) -> None:
    """Two methods of equation error, each within a few per cent of JSBSim's own numbers, but for the
    damping in roll, which the aileron's stops share."""
    model = tmp_path / "parameters.toml"
    model.write_text(f"parameters = {json.dumps(list(T38))}\n", encoding="utf-8")
    found = asked(
        workspace, "estimate", *VEHICLE, "--baseline", "v0002", "--model", str(model),
        "--method", "regression", "--method", "frequency-domain",
    )  # fmt: skip
    for method in found["methods"]:
        values = {each["name"]: each["value"] for each in method["estimates"]}
        assert values.keys() == T38.keys()
        for name, (true, _, _) in T38.items():
            assert values[name] == pytest.approx(true, rel=0.15 if "roll" in name else 0.05), name


def test_an_update_of_declared_parameters_is_a_version(workspace: Path, tmp_path: Path) -> None:
    """`update` with all of them declared: as near as the vehicle file says that mass, inertia, CG and
    deflections are known, which are wrong by as much."""
    model = tmp_path / "all.toml"
    model.write_text(f"parameters = {json.dumps(list(T38))}\n", encoding="utf-8")
    found = asked(
        workspace, "update", *VEHICLE, "--baseline", "v0002", "--model", str(model), "--direct"
    )
    assert found["increments"] == []
    named = {each["name"]: each for each in found["parameters"]}
    assert named.keys() == T38.keys()
    for name, each in named.items():
        true = T38[name][0]
        assert abs(each["after"] - true) < 2.5 * each["standard_error"], name
        assert each["standard_error"] < 0.1 * abs(true), name
    for name, before in WRONG.items():
        true = T38[name][0]
        assert abs(named[name]["after"] - true) < 0.2 * abs(before - true), name
    for axis in ("CZ", "Cm", "Cl"):
        error = found["axes"][axis]
        assert error["held_out_rms_after"] < 0.7 * error["held_out_rms_before"], axis
    words = decision(found)
    lines = dict(words.lines)
    assert "9 parameters" in words.verdict
    assert any("->" in line for line in lines["found"])
    assert "error of" in lines["proved"][0]
