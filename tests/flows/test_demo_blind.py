"""The demo without its own knowledge: what nobody declared is found by the product alone; and a
planted error is seen, and gone after the loop."""

import json
import subprocess
import sys

import pytest

from aerodb.examples.phoenix import read_example
from aerodb.examples.phoenix.truth import Effect
from aerodb.flows.demo import (
    ENVELOPE,
    LAGS,
    beside_truth,
    open_envelope,
    run_demo,
    write_database,
    write_logs,
)
from aerodb.flows.fly import validate_flow
from aerodb.flows.run import run_flow
from aerodb.storage.workspace import Workspace

#: The product's own part of the demo, in a process that has the logs and what any user would have.
BLIND = """
import json
import sys
from pathlib import Path

from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace

folder, root, vehicle = map(Path, sys.argv[1:])
workspace = Workspace.open(root)
Catalogue.open(workspace.catalogue).add_vehicle("phoenix", vehicle.read_text())
logs = sorted(map(str, folder.glob("*.ulg")))


def run(flow, **given):
    return run_flow(flow, {"vehicle": "phoenix", **given}, workspace, "direct")


baseline = run(import_flow, file=str(folder / "preflight.toml"), bindings={})["version"]
flights = [outcome["flight"] for outcome in run(flight_flow, logs=logs)]
document = run(close_loop_flow, baseline=baseline, flights=flights)
print(json.dumps([sorted(sys.modules), document]))
"""

#: The suite closes the loop of `test_demo.py`.
pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def blind(tmp_path_factory):
    """A campaign with undeclared effects that nobody knows: modules that the process of the product
    imported, and what was found, the envelope opened afterwards."""
    folder = tmp_path_factory.mktemp("blind")
    logs = folder / "logs"
    write_logs(logs, flights=5, seed=5)
    write_database(logs)
    (folder / "vehicle.toml").write_text(read_example("vehicle.toml"), encoding="utf-8")
    effects = open_envelope(logs)
    lags = json.loads((logs / LAGS).read_text())
    (logs / ENVELOPE).unlink()
    (logs / LAGS).unlink()
    given = [logs, folder / "workspace", folder / "vehicle.toml"]
    command = [sys.executable, "-c", BLIND, *map(str, given)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    modules, document = json.loads(done.stdout.splitlines()[-1])
    return modules, beside_truth(Workspace.open(folder / "workspace"), document, effects, lags)


def test_an_undeclared_effect_is_found_named_added_and_proved(blind):
    _, demo = blind
    document = demo.document
    assert document["candidate"]
    assert {effect["agreement"] for effect in demo.truth} == {"named"}
    confirmed = [f for f in document["findings"] if f["verdict"] == "confirmed"]
    assert {f["hypothesis"] for f in confirmed} == set(document["added"])
    for effect in demo.truth:
        finding = next(f for f in confirmed if f["parameter"] == effect["parameter"])
        assert finding["ci95"][0] <= effect["value"] <= finding["ci95"][1]
    # named, and nothing else claimed of the aerodynamics
    assert {f["parameter"] for f in confirmed} == {effect["parameter"] for effect in demo.truth}
    for axis, rms in demo.floors.items():
        assert rms["after"] <= 1.05 * rms["floor"], axis


def test_a_claimed_sensor_is_a_lag_that_flew(blind):
    """The vanes of every drawn flight are 2 to 4 ms late: whatever sensor is claimed is one of these
    lags, and its interval holds it."""
    _, demo = blind
    assert all(0.002 <= lag["value"] <= 0.004 for lag in demo.lags)
    claimed = {f["parameter"] for f in demo.document["findings"] if f["verdict"] == "sensor"}
    assert claimed == {lag["parameter"] for lag in demo.lags} == {"alpha_delay"}
    for lag in demo.lags:
        assert lag["ci95"][0] <= lag["value"] <= lag["ci95"][1], lag


def test_the_product_cannot_see_the_truth(blind):
    """The envelope was not there to be read; nothing of the example was imported, nor what flew
    it."""
    modules, _ = blind
    assert "aerodb.flows.close_loop" in modules
    assert not [
        name for name in modules if name.startswith(("aerodb.examples", "aerodb.simulation"))
    ]


def test_a_planted_error_is_seen_by_validate_and_gone_after_the_loop(tmp_path):
    """Stiffness about the CG 10 % too large (0.0091 1/rad) and roll damping by 20 %."""
    planted = (
        Effect("alpha_slope", "Cm", "Cm_alpha", "alpha", 0.0091),
        Effect("roll_damping", "Cl", "Cl_p", "p_hat", -0.0456),
    )
    logs = tmp_path / "logs"
    write_logs(logs, flights=8, seed=3, effects=planted)
    workspace = Workspace.open(tmp_path / "workspace")
    result = run_demo(
        workspace,
        sorted(logs.glob("*.ulg")),
        lambda body, given: run_flow(body, given, workspace, "direct"),
        lambda _: None,
    )
    given = {
        "version": result.document["candidate"],
        "baseline": result.document["baseline"],
        "flights": result.document["flights"]["held_out"],
    }
    responses = run_flow(validate_flow, given, workspace, "direct")
    assert responses["passed"], responses["failed"]
    checks = {c["check"]: c["before"] for c in responses["checks"]}
    for name in ("short period: normal acceleration", "roll response: roll rate"):
        assert checks[name]["passed"] < 0.7 * checks[name]["manoeuvres"], name
    for channel in ("alpha", "q", "p"):
        row = next(r for r in responses["responses"] if r["channel"] == channel)
        assert row["rms_error"] < 0.35 * row["before"]["rms_error"], channel
