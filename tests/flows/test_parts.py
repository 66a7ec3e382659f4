"""An aircraft made of parts, by the commands: imported, shown, trimmed, flown and exported."""

from pathlib import Path

import pytest

from tests.support.command import aerodb, asked
from tests.support.parts import TEXT, VEHICLE

AT = ("--speed", "55", "--altitude", "1000", "--thrust", "throttle")
MANOEUVRE = """
name = "elevator and rudder"
duration = "30 s"
[trim]
V = "55 m/s"
altitude = "1000 m"
thrust = "throttle"
[[input]]
target = "delta_elevator"
amplitude = "2 deg"
start = "2 s"
[[input]]
target = "delta_rudder"
amplitude = "3 deg"
start = "12 s"
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    (folder / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (folder / "parts.toml").write_text(TEXT, encoding="utf-8")
    asked(folder / "workspace", "vehicle", "add", str(folder / "vehicle.toml"))
    asked(folder / "workspace", "database", "import", str(folder / "parts.toml"))
    return folder / "workspace"


def test_a_version_shows_its_parts_as_they_are_written(workspace: Path) -> None:
    text = aerodb(workspace, "version", "show", "v0001").stdout
    assert "propeller" in text
    assert "engine" in text
    assert "wing_right_3_lift" not in text
    assert "tail_slope" in text


def test_it_is_trimmed_by_its_throttle_and_has_modes(workspace: Path) -> None:
    found = asked(workspace, "version", "modes", "v0001", *AT)
    assert 0.3 < found["inputs"]["throttle"] < 1.0
    assert abs(found["channels"]["climb"]) < 1e-9
    names = {mode["name"]: mode for mode in found["modes"]}
    assert {"short period", "phugoid", "Dutch roll", "roll"} <= set(names)
    without = aerodb(workspace, "version", "trim", "v0001", *AT, "--glide")
    assert "--glide and --thrust together" in without.stderr


def test_it_flies_a_manoeuvre_from_its_trim(workspace: Path, tmp_path: Path) -> None:
    file = tmp_path / "manoeuvre.toml"
    file.write_text(MANOEUVRE, encoding="utf-8")
    page = tmp_path / "page.html"
    flown = asked(
        workspace, "version", "fly", "v0001", "--manoeuvre", str(file), "--output", str(page)
    )
    assert page.read_text(encoding="utf-8").count("<figure ") == 1
    assert flown["ended"] == pytest.approx(30.0)
    start, least, greatest = flown["responses"]["alpha"]
    assert least < start - 0.01
    assert greatest > start + 0.01
    assert flown["responses"]["beta"][2] > 0.005


def test_it_flies_in_turbulence(workspace: Path, tmp_path: Path) -> None:
    file = tmp_path / "turbulence.toml"
    still = MANOEUVRE.partition("[[input]]")[0]
    file.write_text(still + '[turbulence]\nintensity = "1 m/s"\nseed = 1\n', encoding="utf-8")
    flown = asked(workspace, "version", "fly", "v0001", "--manoeuvre", str(file))
    assert flown["ended"] == pytest.approx(30.0)
    least, greatest = flown["air"]["gust_w"]
    assert -5.0 < least < -0.5 < 0.5 < greatest < 5.0
    assert flown["responses"]["alpha"][2] - flown["responses"]["alpha"][1] > 0.01
    file.write_text(still, encoding="utf-8")
    calm = asked(workspace, "version", "fly", "v0001", "--manoeuvre", str(file))
    assert "air" not in calm
    assert calm["responses"]["alpha"][2] - calm["responses"]["alpha"][1] < 1e-3


def test_it_flies_through_a_wake(workspace: Path, tmp_path: Path) -> None:
    file = tmp_path / "wake.toml"
    still = MANOEUVRE.partition("[[input]]")[0].replace("30 s", "8 s")
    wake = """[wake]
circulation = "200 m^2/s"
core_radius = "1.5 m"
spacing = "17 m"
ahead = "200 m"
below = "1 m"
heading = "75 deg"
"""
    file.write_text(still + wake, encoding="utf-8")
    flown = asked(workspace, "version", "fly", "v0001", "--manoeuvre", str(file))
    assert flown["ended"] == pytest.approx(8.0)
    # The axis is below: the aircraft meets the air that is carried along with the pair and sinks.
    least, greatest = flown["air"]["gust_w"]
    assert least < -3.0
    assert 3.0 < greatest < 200.0 / (3.14 * 1.5)
    assert flown["responses"]["az"][1] < -15.0
    assert max(abs(value) for value in flown["responses"]["phi"]) > 0.02
    file.write_text(still + wake.replace("200 m^2/s", "-2 m^2/s"), encoding="utf-8")
    wrong = aerodb(workspace, "version", "fly", "v0001", "--manoeuvre", str(file))
    assert "not positive" in wrong.stderr


def test_a_point_without_stated_air_has_that_of_its_airspeed(workspace: Path) -> None:
    at = asked(workspace, "version", "evaluate", "v0001", "--at", "alpha=2deg,V=50")
    assert at["taken_as"]["qbar"] == pytest.approx(0.5 * 1.225 * 2500, rel=1e-5)
    assert "qbar" not in at["taken_as_zero"]
    assert -1.0 < at["coefficients"]["CZ"] < -0.2


def test_other_simulators_get_it(workspace: Path, tmp_path: Path) -> None:
    """The command checks each file in JSBSim, or by reading it back, before it answers."""
    for form, name in (("jsbsim", "aero.xml"), ("daveml", "aero.dml")):
        target = tmp_path / name
        asked(workspace, "version", "export", "v0001", "--format", form, "--output", str(target))
        assert "tail_slope" in target.read_text(encoding="utf-8")


def test_it_becomes_tables_that_fly_alike(workspace: Path) -> None:
    over = ("--over", "alpha=-8deg:16deg:25", "--over", "delta_elevator=-20deg:20deg:5")
    made = asked(
        workspace, "version", "tabulate", "v0001", *over, "--at", "V=55,throttle=0.75,rho=1.1116"
    )
    assert made["kept"] == ["propeller_FX", "propeller_MY"]
    assert made["nodes"] == 125
    assert 0.0 < made["errors"]["CZ"]["largest"] < 0.01 * made["errors"]["CZ"]["span"]
    before, after = (
        asked(workspace, "version", "trim", version, *AT) for version in ("v0001", made["label"])
    )
    assert after["channels"]["alpha"] == pytest.approx(before["channels"]["alpha"], abs=1e-3)
    assert after["inputs"]["throttle"] == pytest.approx(before["inputs"]["throttle"], rel=0.02)
    listed = {each["label"]: each for each in asked(workspace, "version", "list")}
    assert listed[made["label"]]["parent"] == listed["v0001"]["version"]
    again = asked(
        workspace, "version", "tabulate", "v0001", *over, "--at", "V=55,throttle=0.75,rho=1.1116"
    )
    assert again["version"] == made["version"]
    assert asked(workspace, "verify")["clean"], "its parent is what it was made of"
    text = aerodb(workspace, "version", "tabulate", "v0001", "--over", "alpha=0:1").stderr
    assert "INPUT=LEAST:GREATEST:NODES" in text


def test_a_wrong_part_is_said_with_its_place(workspace: Path, tmp_path: Path) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(TEXT.replace("position = [0.0, 0.0, 0.1]\n", ""), encoding="utf-8")
    refused = aerodb(workspace, "database", "import", str(file))
    assert refused.returncode == 3
    assert "wrong.toml: [parts.propeller]: position is missing" in refused.stderr


def test_what_no_flight_can_move_and_a_mistyped_control_are_said(
    workspace: Path, tmp_path: Path
) -> None:
    """One parameter that no expression uses, and a control whose name has a letter too many."""
    file = tmp_path / "unused.toml"
    text = TEXT.replace("[parameters]\n", "[parameters]\nspare = { value = 1.0 }\n", 1)
    file.write_text(text.replace("delta_rudder", "delta_ruddder"), encoding="utf-8")
    found = asked(workspace, "database", "import", str(file))
    assert [(each["kind"], each["name"]) for each in found["warnings"]] == [
        ("unused_parameter", "spare"), ("unknown_surface", "delta_ruddder"),
    ]  # fmt: skip
    assert found["warnings"][1]["meant"] == "delta_rudder"
    right = tmp_path / "right.toml"
    right.write_text(TEXT + 'description = "the same"\n', encoding="utf-8")
    assert asked(workspace, "database", "import", str(right))["warnings"] == []
