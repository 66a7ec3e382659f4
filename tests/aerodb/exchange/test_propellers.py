"""Rotors as JSBSim's propellers: flown in JSBSim against the version's own prediction."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange import (
    export_propellers,
    project_propellers,
    propeller_database,
    read_native,
    read_propellers,
)
from aerodb.tables import AeroDatabase, failed_check_cases, make_check_cases
from tests.aerodb.exchange.test_motor_model import BODY, VEHICLE
from tests.support.command import aerodb, asked
from tests.support.quadrotor import QUADROTOR

BARE = QUADROTOR.replace('drag = "rotor_drag"', "")
#: Of JSBSim's constants of units.
DIGITS = 3e-6
#: Velocities u, v, w [m/s] at the start, and throttles.
FLOWS = (
    ((0.0, 0.0, 0.0), [0.3, 0.3, 0.3, 0.3]),
    ((8.0, -3.0, 1.0), [0.9, 0.2, 0.5, 0.4]),
    ((2.0, 1.0, -24.0), [0.5, 0.6, 0.7, 0.8]),
)


def flown(file: bytes) -> list[dict[str, Any]]:
    """What JSBSim makes of a file, in a process of its own."""
    pytest.importorskip("jsbsim")
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.jsbsim_carrier"],
        input=json.dumps({"xml": file.decode(), "flows": FLOWS}),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout.splitlines()[-1])
    return found


def loads(database: AeroDatabase, at: dict[str, Any], **inputs: float) -> np.ndarray:
    """Loads (6,) [N, N m] of a version about its moment reference."""
    u, v, w = at["flow"]
    speed = float(np.linalg.norm(at["flow"]))
    channels = {
        "V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed), "p": 0.0, "q": 0.0,
        "r": 0.0, "rho": at["rho"], "qbar": 1.0, **inputs,
    }  # fmt: skip
    found = database.predict({n: np.full(1, x) for n, x in channels.items()}).coefficients
    s = database.reference
    lengths = {"CX": 1.0, "CY": 1.0, "CZ": 1.0, "Cl": s.span, "Cm": s.chord, "Cn": s.span}
    return np.array([found[axis][0] * s.area * length for axis, length in lengths.items()])


@pytest.mark.parametrize(
    "text", [BARE, BARE.replace("turns", "axis = [0.3, 0.2, -1]\nturns")], ids=["level", "canted"]
)
def test_jsbsim_has_the_loads_of_the_version(text: str) -> None:
    database = read_native(text)
    made = project_propellers(database)
    for at in flown(export_propellers(made.propellers, "quad", made.notes)):
        commands = {f"command_{k}": n / 120.0 for k, n in enumerate(at["speeds"], 1)}
        own = loads(database, at, **commands)
        assert at["loads"] == pytest.approx(own, rel=DIGITS, abs=DIGITS * np.abs(own).max())
        assert np.abs(own).max() > 5.0
    assert made.largest["FZ"] < 1e-9  # all of it is of the advance ratio


def test_the_speed_in_still_air_is_that_of_the_power() -> None:
    made = project_propellers(read_native(BARE))
    (hover, *_) = flown(export_propellers(made.propellers, "quad"))
    # It falls for two seconds: the speed is that of a slow climb of the air.
    density = (hover["rho"] / 1.225) ** (-1.0 / 3.0)
    assert hover["speeds"] == pytest.approx([120.0 * 0.3 ** (1 / 3) * density] * 4, rel=0.01)


def test_what_is_lost_is_said() -> None:
    made = project_propellers(read_native(QUADROTOR + BODY))
    drag = next(note for note in made.notes if "advance ratio" in note)
    # Rotor drag of 4 rotors at 120 rev/s in 10 m/s.
    assert f"{4 * 0.0006 * 120 * 10:.3g} N" in drag
    body = next(note for note in made.notes if "the body frame" in note)
    assert f"{0.5 * 1.225 * 0.01 * 100:.3g} N" in body


def test_a_file_is_read_back_and_a_damaged_one_refused() -> None:
    made = project_propellers(read_native(QUADROTOR)).propellers
    file = export_propellers(made, "quad")
    cases = make_check_cases(propeller_database(made, "quad"))
    assert failed_check_cases(read_propellers(file, "quad"), cases) == ()
    other = file.replace(b"<sense>-1<", b"<sense>1<")
    assert failed_check_cases(read_propellers(other, "quad"), cases) != ()
    for old, new in ((b"<sense>-1<", b"<sense>0<"), (b"C_POWER", b"C_X"), (b"pitch", b"roll")):
        with pytest.raises(InputError):
            read_propellers(file.replace(old, new), "quad")
    with pytest.raises(InputError, match="no <engine>"):
        read_propellers(b"<propulsion/>", "quad")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('torque = "0.006"', "", "without torque"),
        ('"120*command_1"', '"0"', "rev/s at the middle"),
        ("diameter", 'tilt = "0.1"\ndiameter', "a tilting rotor, which JSBSim"),
    ],
)
def test_what_has_no_propeller_is_refused(old: str, new: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        project_propellers(read_native(QUADROTOR.replace(old, new)))


def test_a_version_is_exported_by_the_command(tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "quad.toml").write_text(QUADROTOR + BODY)
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(tmp_path / "w", "database", "import", str(tmp_path / "quad.toml"), "--vehicle", "quad")
    words = ("version", "export", "v0001", "--format", "propeller", "--output")
    document = asked(tmp_path / "w", *words, str(tmp_path / "quad.xml"))
    assert document["check_cases"] > 0
    assert any("lag of 0.05 s" in note for note in document["notes"])
    inertias = [float(x.text or "") for x in etree.parse(str(tmp_path / "quad.xml")).iter("ixx")]
    assert inertias[1:] == pytest.approx([inertias[0] / 0.03 * 0.05] * 3)  # `lag` of rotor 1
    said = aerodb(tmp_path / "w", *words, str(tmp_path / "again.xml")).stdout.splitlines()
    assert "read back, " in said[1]


def test_a_version_without_rotors_is_refused(tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "quad.toml").write_text(QUADROTOR.split("[parts")[0] + BODY)
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(tmp_path / "w", "database", "import", str(tmp_path / "quad.toml"), "--vehicle", "quad")
    words = ("version", "export", "v0001", "--format", "propeller", "--output", "q.xml")
    done = aerodb(tmp_path / "w", *words, folder=tmp_path)
    assert done.returncode == 3
    assert "a version without rotors" in done.stderr
