"""A flight that contradicts its vehicle, or its vehicle's database, is said at ingest, and is not
good."""

from pathlib import Path
from typing import Any

import pytest

from tests.aerodb.suspicions.test_against_vehicle import VEHICLE, flown
from tests.aerodb.suspicions.test_database import database_text
from tests.support import small_glider
from tests.support.command import aerodb, asked
from tests.support.small_glider import write_csv

#: Where the command is that `scale` turns into a deflection.
LOGGED = 'log = { topic = "table", field = "delta_elevator" }\n'


def ingested(root: Path, vehicle: str, channels: dict[str, Any]) -> dict[str, Any]:
    (root / "vehicle.toml").write_text(vehicle, encoding="utf-8")
    workspace = root / "w"
    asked(workspace, "vehicle", "add", str(root / "vehicle.toml"))
    log = write_csv(root / "flight.csv", channels)
    (outcome,) = asked(workspace, "flight", "ingest", str(log), "--vehicle", "light", "--direct")
    shown: dict[str, Any] = asked(workspace, "flight", "show", outcome["flight"])
    return shown


def columns() -> dict[str, Any]:
    flight = flown()
    return {"time": flight.time, **flight.channels}


def test_a_right_flight_has_no_suspicion(tmp_path: Path) -> None:
    shown = ingested(tmp_path, VEHICLE, columns())
    assert shown["suspicions"] == []
    assert not any("sign" in reason for reason in shown["reasons"])


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        (
            "[surfaces.elevator]\n",
            "[surfaces.elevator]\nscale = -1.0\n" + LOGGED,
            "delta_elevator gives",
        ),
        (
            "[surfaces.elevator]\n",
            "[surfaces.elevator]\noffset = 1500.0\n" + LOGGED,
            "stands at its limits",
        ),
        ("mass = 600.0", "mass = 1322.8", "the normal force grows by"),
        ("area = 12.0", "area = 129.2", "the reference area is"),
        ("Ixx = 900.0", "Ixx = 9000.0", "Ixx is 9000 kg m^2, more than Iyy + Izz"),
    ],
)
def test_a_wrong_vehicle_file_is_said_and_limits_the_flight(
    tmp_path: Path, right: str, wrong: str, words: str
) -> None:
    assert right in VEHICLE
    shown = ingested(tmp_path, VEHICLE.replace(right, wrong), columns())
    assert any(words in each["sentence"] for each in shown["suspicions"])
    assert shown["verdict"] != "good"
    assert any(words in reason for reason in shown["reasons"])


def test_log_inspect_says_what_needs_no_vehicle(tmp_path: Path) -> None:
    channels = columns()
    channels["rho"] = channels["rho"] / 515.379
    log = write_csv(tmp_path / "flight.csv", channels)
    looked = asked(tmp_path / "none", "log", "inspect", str(log))
    assert any("slug/ft^3" in each["sentence"] for each in looked["suspicions"])


#: Inertia in slug ft^2: a quarter less, which no bound on aircraft of all sizes can see.
SLUG_FEET = VEHICLE
for _name, _value in (("Ixx", 900.0), ("Iyy", 1100.0), ("Izz", 1850.0)):
    SLUG_FEET = SLUG_FEET.replace(f"{_name} = {_value}", f"{_name} = {_value / 1.3558:.4g}")


def beside_its_database(root: Path, vehicle: str, text: str) -> tuple[Path, dict[str, Any]]:
    """The answer to `flight ingest` of a workspace that has the database `text`."""
    root.mkdir(exist_ok=True)
    (root / "vehicle.toml").write_text(vehicle, encoding="utf-8")
    (root / "database.toml").write_text(text, encoding="utf-8")
    workspace = root / "w"
    asked(workspace, "vehicle", "add", str(root / "vehicle.toml"))
    asked(workspace, "database", "import", str(root / "database.toml"), "--vehicle", "light")
    log = write_csv(root / "flight.csv", columns())
    (outcome,) = asked(workspace, "flight", "ingest", str(log), "--vehicle", "light", "--direct")
    return workspace, outcome


def test_a_wind_tunnel_may_be_wrong(tmp_path: Path) -> None:
    text = database_text(CZ_alpha=0.8, Cm_delta_elevator=0.5, Cl_p_hat=1.4)
    workspace, outcome = beside_its_database(tmp_path, VEHICLE, text)
    # Half the effect of a control looks like another scale of its channel: said, and limits nothing.
    (found,) = outcome["comparison"]["suspicions"]
    assert (found["channel"], found["kind"]) == ("delta_elevator", "possible")
    assert found["sentence"].endswith("or the database's effect is wrong")
    assert found["evidence"]["ratio"] == pytest.approx(2.0, rel=0.1)
    shown = asked(workspace, "flight", "show", outcome["flight"])
    assert shown["verdict"] == outcome["consistency"]["verdict"]
    assert shown["reasons"][:-1] == outcome["consistency"]["reasons"]


def test_what_contradicts_the_released_database_limits_the_flight(tmp_path: Path) -> None:
    workspace, outcome = beside_its_database(tmp_path, SLUG_FEET, database_text())
    (found,) = outcome["comparison"]["suspicions"]
    assert (found["channel"], found["kind"]) == ("Ixx", "size")
    assert found["evidence"]["factor"] == pytest.approx(1.0 / 1.3558, rel=0.06)
    shown = asked(workspace, "flight", "show", outcome["flight"])
    assert outcome["consistency"]["reasons"] == shown["reasons"]
    (listed,) = asked(workspace, "flight", "list")
    assert outcome["consistency"]["verdict"] == shown["verdict"] == listed["verdict"] != "good"
    assert shown["reasons"][-1] == f"beside version v0001: {found['sentence']}"
    again = aerodb(
        workspace,
        "flight",
        "ingest",
        str(tmp_path / "flight.csv"),
        "--vehicle",
        "light",
        "--direct",
        "-v",
    )
    assert f"suspicion: {found['sentence']}" in again.stdout
    assert asked(workspace, "flight", "show", outcome["flight"])["reasons"] == shown["reasons"]
    stored = asked(workspace, "flight", "compare", outcome["flight"], "v0001")
    assert stored["suspicions"] == outcome["comparison"]["suspicions"]


def test_what_aerodynamics_may_explain_is_said_and_limits_nothing(tmp_path: Path) -> None:
    light = VEHICLE.replace("mass = 600.0", "mass = 510.0")
    assert light != VEHICLE
    workspace, outcome = beside_its_database(tmp_path, light, database_text())
    (found,) = outcome["comparison"]["suspicions"]
    assert (found["channel"], found["kind"]) == ("mass", "possible")
    assert found["evidence"]["factor"] == pytest.approx(0.85, rel=0.03)
    shown = asked(workspace, "flight", "show", outcome["flight"])
    assert shown["verdict"] == outcome["consistency"]["verdict"]
    assert shown["reasons"][-1] == f"suspected beside version v0001: {found['sentence']}"
    assert shown["reasons"][:-1] == outcome["consistency"]["reasons"]


def test_the_gate_refuses_what_comes_from_contradicting_flights(tmp_path: Path) -> None:
    """A mass in lb: the lift of every flight is 2.2 times the database's."""
    workspace, right = tmp_path / "w", f"mass = {small_glider.MASS}"
    wrong = f"mass = {small_glider.MASS / 0.45359237}"
    assert right in small_glider.VEHICLE
    texts = {
        "vehicle.toml": small_glider.VEHICLE.replace(right, wrong),
        "database.toml": small_glider.DATABASE,
        "model.toml": small_glider.MODEL,
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    vehicle = ("--vehicle", small_glider.NAME)
    asked(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(workspace, "database", "import", str(tmp_path / "database.toml"), *vehicle)
    logs = [str(write_csv(tmp_path / f"{k}.csv", small_glider.channels(k))) for k in range(3)]
    outcomes = asked(workspace, "flight", "ingest", *logs, *vehicle, "--direct")
    said = [each["comparison"]["suspicions"][0]["sentence"] for each in outcomes]
    assert all("lift" in sentence for sentence in said)
    asked(workspace, "update", *vehicle, "--model", str(tmp_path / "model.toml"), "--direct")
    promote = ("version", "promote", "candidate", "--reason", "why not")
    refused = aerodb(workspace, *promote)
    assert refused.returncode == 4
    assert f"beside version v0001: {said[0]}" in refused.stderr
    assert "--accept contradictions" in refused.stderr
    others = aerodb(workspace, *promote, "--accept", "contradictions")
    assert "beside version v0001" not in others.stderr


def test_the_gate_refuses_what_a_contradicting_flight_validates(tmp_path: Path) -> None:
    """The specific force of the flight held out is 2.2 times too large."""
    workspace, vehicle = tmp_path / "w", ("--vehicle", small_glider.NAME)
    texts = {
        "vehicle.toml": small_glider.VEHICLE,
        "database.toml": small_glider.DATABASE,
        "model.toml": small_glider.MODEL,
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    asked(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(workspace, "database", "import", str(tmp_path / "database.toml"), *vehicle)
    tables = [small_glider.channels(k) for k in range(3)]
    tables[2] |= {name: 2.2 * tables[2][name] for name in ("ax", "az")}
    logs = [str(write_csv(tmp_path / f"{k}.csv", table)) for k, table in enumerate(tables)]
    outcomes = asked(workspace, "flight", "ingest", *logs, *vehicle, "--direct")
    said = [[each["sentence"] for each in e["comparison"]["suspicions"]] for e in outcomes]
    assert (said[0], said[1]) == ([], [])
    model = ("--model", str(tmp_path / "model.toml"))
    given = ("--hold-out", outcomes[2]["flight"], "--direct")
    asked(workspace, "update", *vehicle, *model, *given)
    refused = aerodb(workspace, "version", "promote", "candidate", "--reason", "why not")
    assert refused.returncode == 4
    assert f"(2.csv): beside version v0001: {said[2][0]}" in refused.stderr
