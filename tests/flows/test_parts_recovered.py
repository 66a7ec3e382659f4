"""Parameters of an aircraft of parts, recovered by the commands from logs of its flights."""

import json
from pathlib import Path

import pytest

from tests.support.command import asked
from tests.support.parts import TEXT, VEHICLE, aircraft, log
from tests.support.small_glider import write_csv

pytestmark = pytest.mark.campaign

WRONG = {"wing_slope": 4.5, "fin_slope": 2.4, "elevator_part": 0.65}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six flights of the true aircraft; v0001 is right, v0002 has wrong parameters."""
    folder = tmp_path_factory.mktemp("recovered")
    root = folder / "workspace"
    wrong = TEXT
    for name, value in WRONG.items():
        wrong = wrong.replace(
            f"{name} = {{ value = {aircraft().parameters[name]}", f"{name} = {{ value = {value}"
        )
    for name, text in (("vehicle", VEHICLE), ("right", TEXT), ("wrong", wrong)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    asked(root, "vehicle", "add", str(folder / "vehicle.toml"))
    for name in ("right", "wrong"):
        asked(root, "database", "import", str(folder / f"{name}.toml"))
    for seed in range(6):
        file = write_csv(folder / f"flight{seed}.csv", log(seed, aircraft()))
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("throttle [1]", "throttle [-]"), encoding="utf-8")
        answer = asked(
            root, "flight", "ingest", str(file), "--vehicle", "light-aircraft",
            "--mapping", "canonical", "--direct",
        )  # fmt: skip
        assert answer[0]["status"] == "stored", answer
    return root


def test_wrong_parameters_are_corrected_within_their_intervals(workspace: Path) -> None:
    """Fin and elevator could also be errors of sensors, and are added because they are asked for."""
    found = asked(
        workspace, "close-loop", "--baseline", "v0002", "--direct",
        "--accept-ambiguous", "parameter",
    )  # fmt: skip
    named = {each["name"]: each for each in found["parameters"]}
    assert named.keys() == WRONG.keys()
    for name, each in named.items():
        true = aircraft().parameters[name]
        assert abs(each["after"] - true) < 2.5 * each["standard_error"], name
        assert abs(each["after"] - true) < 0.1 * abs(WRONG[name] - true), name
    verdicts = {finding["subject"]: finding["verdict"] for finding in found["findings"]}
    assert verdicts["wing_slope"] == "confirmed"
    for axis in ("CY", "CZ", "Cm"):
        error = found["axes"][axis]
        assert error["held_out_rms_after"] < 0.4 * error["held_out_rms_before"], axis
    shown = asked(workspace, "version", "lineage", found["label"], "--node", "wing_slope")
    assert [each["flight"] for each in shown["parameter"]["flights"]] == found["flights"][
        "identified"
    ]


def test_nothing_is_corrected_where_all_are_right(workspace: Path) -> None:
    found = asked(workspace, "close-loop", "--baseline", "v0001", "--direct")
    confirmed = [f for f in found["findings"] if f["verdict"] == "confirmed"]
    assert confirmed == []


def test_estimate_fits_them(workspace: Path, tmp_path: Path) -> None:
    model = tmp_path / "parameters.toml"
    names = ["wing_slope", "wing_zero", "tail_slope", "elevator_part", "fin_slope", "aileron_part"]
    model.write_text(f"parameters = {json.dumps(names)}\n", encoding="utf-8")
    found = asked(
        workspace, "estimate", "--baseline", "v0002", "--model", str(model),
        "--method", "regression",
    )  # fmt: skip
    values = {each["name"]: each for each in found["methods"][0]["estimates"]}
    for name in names:
        true = aircraft().parameters[name]
        assert values[name]["value"] == pytest.approx(true, rel=0.08), name
