"""Rotors as Gazebo's motors: its documented formulas in numpy against the version's prediction."""

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange import (
    export_motors,
    motor_database,
    project_motors,
    project_sitl,
    read_motors,
    read_native,
)
from aerodb.support import Array
from aerodb.tables import AeroDatabase, failed_check_cases, make_check_cases
from tests.support.command import aerodb, asked
from tests.support.quadrotor import QUADROTOR

REFERENCE = (0.2, 0.5, 0.5)  # area, chord, span of the quadrotor
ROLLING = QUADROTOR.replace('drag = "rotor_drag"', 'drag = "rotor_drag"\nroll = "0.0004"')
BODY = """
[parts.frame]
kind = "body"
position = [0.0, 0.0, 0.0]
[[parts.frame.load]]
axis = "FX"
expression = "-0.5*rho*0.01*u*abs(u)"
"""
VEHICLE = """
name = "quad"
[reference]
area = 0.2
chord = 0.5
span = 0.5
[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = 1.5
cg = [0.0, 0.0, 0.0]
Ixx = 0.029
Iyy = 0.029
Izz = 0.055
Ixz = 0.0
[rotors.1]
log = { topic = "motors", field = "one" }
lag = 0.03
"""


def by_gazebo(file: bytes, turning: Array, flow: Array) -> Array:
    """Loads (6,) on body axes about the datum by gz-sim's formulas, in its own axes: x forward, y
    left, z up. turning : [rad/s] by motor number. flow : velocity through the air, body axes."""
    root = etree.fromstring(file)
    flip = np.array([1.0, -1.0, -1.0])
    force, moment = np.zeros(3), np.zeros(3)
    for plugin in root.iter("plugin"):
        k = {each.tag: each.text for each in plugin}
        pose = root.find(f".//frame[@name='{k['linkName']}_place']/pose")
        x, y, z, roll, pitch, _ = map(float, pose.text.split())
        c, s = np.cos(pitch), np.sin(pitch)
        about_x = [[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]
        axis = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array(about_x) @ [0, 0, 1]
        w = turning[int(k["motorNumber"])]
        t = {"ccw": 1.0, "cw": -1.0}[k["turningDirection"]]
        across = flip * flow - (flip * flow) @ axis * axis
        thrust = float(k["motorConstant"]) * w * w
        push = thrust * axis - abs(w) * float(k["rotorDragCoefficient"]) * across
        force += push
        moment += np.cross([x, y, z], push) - t * float(k["momentConstant"]) * thrust * axis
        moment -= abs(w) * float(k["rollingMomentCoefficient"]) * across
    return np.concatenate([flip * force, flip * moment])


def by_version(database: AeroDatabase, commands: Array, flow: Array) -> Array:
    """Loads (6,) by the version's own prediction; coefficients over 1e-3 m/s in hover."""
    speed = max(float(np.linalg.norm(flow)), 1e-9)
    channels = {
        "V": speed, "alpha": np.arctan2(flow[2], flow[0]), "beta": np.arcsin(flow[1] / speed),
        "p": 0.0, "q": 0.0, "r": 0.0, "rho": 1.225, "qbar": 1.0,
        **{f"command_{k}": c for k, c in enumerate(commands, 1)},
    }  # fmt: skip
    found = database.predict({n: np.full(1, x) for n, x in channels.items()}).coefficients
    area, chord, span = REFERENCE
    lengths = {"CX": 1.0, "CY": 1.0, "CZ": 1.0, "Cl": span, "Cm": chord, "Cn": span}
    return np.array([found[axis][0] * area * length for axis, length in lengths.items()])


@pytest.mark.parametrize(
    "text", [ROLLING, ROLLING.replace("turns", "axis = [0.3, 0.2, -1]\nturns")]
)
def test_hover_is_the_version_and_so_is_the_flow_across(text: str) -> None:
    database = read_native(text)
    file = export_motors(project_motors(database).motors, "quad")
    commands = np.array([0.5, 0.6, 0.7, 0.4])
    turning = 2.0 * np.pi * 120.0 * commands
    hover = by_version(database, commands, np.zeros(3))
    assert by_gazebo(file, turning, np.zeros(3)) == pytest.approx(hover, rel=1e-9, abs=1e-7)
    assert np.abs(hover[2]) > 5.0
    assert np.all(np.abs(hover[3:]) > 1e-3)
    if "axis" not in text:  # across, J is 0: drag and rolling moment of both turning directions
        flow = np.array([6.0, -3.0, 0.0])
        moved = by_version(database, commands, flow)
        assert by_gazebo(file, turning, flow) == pytest.approx(moved, rel=1e-9, abs=1e-9)
        assert np.abs(moved - hover)[[0, 1, 3, 4]].min() > 1e-3


def test_constants_are_those_of_the_rotor() -> None:
    motor = project_motors(read_native(ROLLING)).motors[2]
    assert motor.thrust == pytest.approx(1.225 * 0.254**4 * 0.11 / (2 * np.pi) ** 2)
    assert motor.moment == pytest.approx(0.254 * 0.006 / 0.11)
    assert motor.drag == pytest.approx(0.0006 / (2 * np.pi))
    assert motor.roll == pytest.approx(-0.0004 / (2 * np.pi))
    assert motor.fastest == pytest.approx(2 * np.pi * 120.0)


def test_the_error_in_flow_is_the_one_that_is_said() -> None:
    database = read_native(QUADROTOR + BODY)
    made = project_motors(database)
    file = export_motors(made.motors, "quad")
    worst = 0.0
    for command in (0.5, 0.75, 1.0):
        commands = np.full(4, command)
        for flow in (*(10.0 * np.eye(3)), *(-10.0 * np.eye(3))):
            error = by_gazebo(file, 2 * np.pi * 120 * commands, flow) - by_version(
                database, commands, flow
            )
            worst = max(worst, float(np.linalg.norm(error[:3])))
    # c_T1 over J, by hand: 4 rho n D^3 c_T1 u
    assert worst == pytest.approx(4 * 1.225 * 120 * 0.254**3 * 0.1 * 10)
    said = [note for note in made.notes if "cannot hold over" in note]
    assert f"{worst:.3g} N," in said[0]
    assert made.largest["FZ"] == pytest.approx(worst)
    body = next(note for note in made.notes if "the body frame" in note)
    assert f"{0.5 * 1.225 * 0.01 * 100:.3g} N" in body


def test_a_file_is_read_back_and_a_damaged_one_refused() -> None:
    motors = project_motors(read_native(ROLLING)).motors
    file = export_motors(motors, "quad")
    cases = make_check_cases(motor_database(motors, "quad"))
    assert failed_check_cases(read_motors(file, "quad"), cases) == ()
    other = file.replace(b">cw<", b">ccw<")
    assert failed_check_cases(read_motors(other, "quad"), cases) != ()
    for old, new in ((b">cw<", b">x<"), (b"_place", b""), (b"<motorNumber>3", b"<motorNumber>7")):
        with pytest.raises(InputError):
            read_motors(file.replace(old, new), "quad")


def test_what_has_no_motor_is_refused() -> None:
    tilting = QUADROTOR.replace("diameter", 'tilt = "0.1"\ndiameter', 1)
    with pytest.raises(InputError, match="a tilting rotor"):
        project_motors(read_native(tilting))
    with pytest.raises(InputError, match="thrust in still air"):
        project_motors(read_native(QUADROTOR.replace('"120*command_1"', '"0"')))


def test_a_version_is_exported_by_the_command(tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "quad.toml").write_text(QUADROTOR + BODY)
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(tmp_path / "w", "database", "import", str(tmp_path / "quad.toml"), "--vehicle", "quad")
    words = ("version", "export", "v0001", "--format", "gazebo", "--output")
    document = asked(tmp_path / "w", *words, str(tmp_path / "quad.sdf"))
    assert document["check_cases"] > 0
    assert document["differences"]["FZ"] == pytest.approx(9.6356, rel=1e-4)
    plugins = list(etree.fromstring((tmp_path / "quad.sdf").read_bytes()).iter("plugin"))
    assert [p.findtext("timeConstantUp") for p in plugins] == ["0.03", None, None, None]
    said = aerodb(tmp_path / "w", *words, str(tmp_path / "again.sdf")).stdout.splitlines()
    assert "read back, 25 check cases pass" in said[1]
    assert any("9.64 N" in line for line in said)


def test_rotors_that_lift_are_refused_for_sitl_and_a_pusher_is_not(tmp_path: Path) -> None:
    """A plane model of a quadrotor was written, all of its coefficients zero."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "quad.toml").write_text(QUADROTOR + BODY)
    pushed = QUADROTOR.replace("turns", "axis = [1.0, 0.0, -0.2]\nturns")
    (tmp_path / "pushed.toml").write_text(pushed)
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    for name in ("quad", "pushed"):
        words = ("database", "import", str(tmp_path / f"{name}.toml"), "--vehicle", "quad")
        asked(tmp_path / "w", *words)
    end = ("--format", "sitl", "--output", "plane.json")
    done = aerodb(tmp_path / "w", "version", "export", "v0001", *end, folder=tmp_path)
    assert done.returncode == 3
    assert "a rotor that lifts" in done.stderr
    assert "no advance ratio" in done.stderr
    assert not (tmp_path / "plane.json").exists()
    done = aerodb(tmp_path / "w", "version", "export", "v0002", *end, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    with pytest.raises(InputError, match="front_right"):
        project_sitl(read_native(pushed.replace("turns", 'tilt = "0.1"\nturns', 1)), {})
