"""A tilt-wing and a quadplane: what one flight tells, and what a hover does not.

The tilt-wing has the constants of Galliker (2021), appendix A. There, a flight's own fit left 1.08
m/s2, about what gravity alone leaves, and took the tail rotor for stronger than a main one. Here the
database begins with a quarter less thrust, and the pipeline sees the log alone.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.support.command import aerodb, asked
from tests.support.multicopter_flight import fly as hovered
from tests.support.multicopter_flight import write_px4
from tests.support.tiltwing import MODEL, VEHICLE, database
from tests.support.tiltwing_flight import (
    CT0,
    GRAVITY,
    MASS,
    TAIL_CT0,
    fly,
    speeds,
    static_thrust,
    write_csv,
)

#: Weight over reference pressure and area of the vehicle file: CZ of the null (0, 0, -g).
WEIGHT = MASS * GRAVITY / (100.0 * 0.52)


def test_the_simulated_rotors_are_those_of_the_appendix() -> None:
    """33.3 N at 7,113 rpm, 9.4 N at 9,200 rpm, and four that hover at a command of .55."""
    assert 60.0 * speeds(np.ones(5))[[0, 4]] == pytest.approx([7113.0, 9200.0])
    assert static_thrust(1.0) == pytest.approx((33.3, 9.4), rel=1e-3)
    assert 4.0 * static_thrust(0.55)[0] == pytest.approx(MASS * GRAVITY, rel=0.01)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose workspace has two flights, and v0002, which the first alone has made."""
    folder = tmp_path_factory.mktemp("tiltwing")
    flown = fly([1, 2], 50.0)
    for column in range(2):
        write_csv(folder / f"flight-{column + 1}.csv", flown, column)
    for name, text in (
        ("vehicle", VEHICLE), ("wing", database()), ("model", MODEL),
    ):  # fmt: skip
        (folder / f"{name}.toml").write_text(text)
    logs = ("flight-1.csv", "flight-2.csv")
    for words in (
        ("vehicle", "add", "vehicle.toml"),
        ("database", "import", "wing.toml", "--vehicle", "tilt-wing"),
        ("flight", "ingest", *logs, "--vehicle", "tilt-wing", "--mapping", "canonical"),
        ("update", "--vehicle", "tilt-wing", "--model", "model.toml", "--flights", logs[0],
         "--hold-out", "none"),
    ):  # fmt: skip
        done = aerodb(folder / "workspace", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_one_flight_predicts_another_at_half_the_error_of_the_null(trained: Path) -> None:
    shown = asked(trained / "workspace", "flight", "compare", "flight-2.csv", "v0002")
    left = {axis: each["rms_residual"] for axis, each in shown["axes"].items()}
    null = {axis: each["rms_measured"] for axis, each in shown["axes"].items()}
    mean = np.sqrt(null["CZ"] ** 2 - shown["axes"]["CZ"]["variation"] ** 2)
    null["CZ"] = np.hypot(shown["axes"]["CZ"]["variation"], WEIGHT - mean)
    for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn"):
        assert left[axis] < 0.5 * null[axis], axis


def test_thrust_at_full_command_is_told_by_the_flight(trained: Path) -> None:
    """Within 15 %, of the main rotors and of the tail's."""
    words = ("estimate", "--vehicle", "tilt-wing", "--model", str(trained / "model.toml"))
    answer = asked(trained / "workspace", *words, "--flights", "flight-1.csv")
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    for name, true in (("main_cT0", CT0), ("tail_cT0", TAIL_CT0)):
        assert found[name]["value"] == pytest.approx(true, rel=0.15), name


def test_a_wing_beyond_upright_is_no_impossible_deflection(tmp_path: Path) -> None:
    write_csv(tmp_path / "hover.csv", fly([5], 12.0, fastest=0.0))
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "wing.toml").write_text(database())
    for words in (
        ("vehicle", "add", "vehicle.toml"),
        ("database", "import", "wing.toml", "--vehicle", "tilt-wing"),
        ("flight", "ingest", "hover.csv", "--vehicle", "tilt-wing", "--mapping", "canonical"),
    ):
        done = aerodb(tmp_path / "w", *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    shown = asked(tmp_path / "w", "flight", "compare", "hover.csv", "v0001")
    assert shown["axes"]["CZ"]["samples"] > 0.9 * 12 * 50


def test_a_tilt_beyond_its_limits_is_said_of_each_rotor(tmp_path: Path) -> None:
    """A hover has the wing upright, but the rotors of this database stop at 60 deg."""
    write_csv(tmp_path / "hover.csv", fly([5], 12.0, fastest=0.0))
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    limit = 'tilt = "delta_tilt"\ntilt_limits = ["0 deg", "60 deg"]\nturns'
    (tmp_path / "wing.toml").write_text(database().replace('tilt = "delta_tilt"\nturns', limit))
    for words in (
        ("vehicle", "add", "vehicle.toml"),
        ("database", "import", "wing.toml", "--vehicle", "tilt-wing"),
        ("flight", "ingest", "hover.csv", "--vehicle", "tilt-wing", "--mapping", "canonical", "-v"),
    ):
        done = aerodb(tmp_path / "w", *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    for rotor in ("inner_left", "inner_right", "outer_left", "outer_right"):
        assert f"the tilt of {rotor} is told to be " in done.stdout, rotor
    assert "beyond its limit of 60 deg" in done.stdout


WING = """
[parts.wing]
kind = "section"
position = [0.0, 0.0, 0.0]
area = 0.3
lift = "wing_slope*alpha"
drag = 0.03
separated = { angle = "15 deg", sharpness = 30.0, lift = 0.0, drag = [0.03, 0.03] }

[parts.tailplane]
kind = "section"
position = [-0.7, 0.0, 0.0]
area = 0.06
lift = "3.5*alpha"
separated = { angle = "15 deg", sharpness = 30.0, lift = 0.0, drag = [0.0, 0.0] }
control = { delta_elevator = "elevator_part" }
"""
KNOWN = """\
[parameters]
wing_slope = { value = 4.5, bounds = [3.0, 6.0] }
elevator_part = { value = 0.5, bounds = [0.2, 0.8] }
"""
ELEVATOR = """
[surfaces.elevator]
limits = ["-30 deg", "30 deg"]
scale = "20 deg"
log = { topic = "actuator_servos", field = "control[0]" }
"""


def test_a_hover_does_not_excite_the_wing_of_a_quadplane(tmp_path: Path) -> None:
    """Its elevator moves with the pitch rate, as an autopilot moves it that mixes in hover too."""
    flight = hovered([31], 30.0, busy=0.0)
    servo = np.clip(-2.0 * flight.rates[:, 1, 0], -1.0, 1.0)
    write_px4(tmp_path / "hover.ulg", flight, servos=servo)
    done = aerodb(
        tmp_path / "w", "vehicle", "init", "plane", "--from", "hover.ulg", folder=tmp_path
    )
    assert done.returncode == 0, done.stderr
    vehicle, rotors = tmp_path / "plane.toml", tmp_path / "plane-rotors.toml"
    vehicle.write_text(vehicle.read_text() + ELEVATOR)
    rotors.write_text(rotors.read_text().replace("[parameters]\n", KNOWN) + WING)
    (tmp_path / "model.toml").write_text(
        'parameters = ["rotor_cT0", "wing_slope", "elevator_part"]\nown_constants = false\n'
    )
    for words in (
        ("vehicle", "add", "plane.toml"),
        ("database", "import", "plane-rotors.toml", "--vehicle", "plane"),
        ("flight", "ingest", "hover.ulg", "--vehicle", "plane", "--accept-placeholders"),
    ):
        done = aerodb(tmp_path / "w", *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    words = ("estimate", "--vehicle", "plane", "--model", str(tmp_path / "model.toml"))
    answer = asked(tmp_path / "w", *words)
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    standing = {name: each["standing"] for name, each in found.items()}
    assert standing == {
        "rotor_cT0": "estimated", "wing_slope": "not excited", "elevator_part": "not excited",
    }  # fmt: skip
    printed = aerodb(tmp_path / "w", *words, "-v").stdout
    assert "elevator_part by regression: not excited, what it acts on hardly moves" in printed
