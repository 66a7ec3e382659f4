"""A published flight of a quadrotor, simulated by others: from its table to rotors by the commands.

Published (Galliker 2021, Table 8.1): c_T0 3.983, c_T1 .118, rotor drag .127, drag of the fuselage
1.33e-3, 7.50e-3, 3.18e-2; the correlation of c_T1 with the last is -.85. The published file is
resampled anew, so that its own least squares are what is met to all digits.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.support import Array
from aerodb.tasks.workspace_access import access_workspace
from tests.support.command import aerodb, asked

DATA = "ddd/quadrotor_model.csv"
PLACES = ((0.13, 0.22), (-0.13, -0.2), (0.13, -0.2), (-0.13, 0.2))
NAMES = ("cD", "cT1", "cT0", "frame_x", "frame_y", "frame_z")
REFERENCE = 'area = 0.2\nchord = 0.5\nspan = 0.5\npressure = "50 Pa"\n'
MASSES = "mass = 1.0\ncg = [0.0, 0.0, 0.0]\nIxx = 0.029\nIyy = 0.029\nIzz = 0.055\nIxz = 0.0\n"
VEHICLE = (
    f'name = "quad"\n[reference]\n{REFERENCE}[points]\nmoment_reference = [0.0, 0.0, 0.0]\n'
    f'[mass]\nsource = "constant"\n{MASSES}'
)
ROTOR = """
[parts.rotor_{k}]
kind = "rotor"
position = [{x}, {y}, -0.023]
diameter = 1.0
speed = "command_{k}"
thrust = "cT0 - cT1*abs(J)"
drag = "cD"
"""
DRAG = '[[parts.frame.load]]\naxis = "{axis}"\nexpression = "-0.5*rho*{name}*{own}*abs({own})"\n'
CHANNELS = {
    "V": "m/s", "alpha": "rad", "beta": "rad", "p": "rad/s", "q": "rad/s", "r": "rad/s",
    "rho": "kg/m^3", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2",
    **{f"command_{k}": "1" for k in range(1, 5)},
}  # fmt: skip


def database() -> str:
    start = "".join(f"{name} = {{ value = {3.0 * (name == 'cT0')} }}\n" for name in NAMES)
    head = f'name = "quad"\n[reference]\n{REFERENCE}moment_reference = [0.0, 0.0, 0.0]\n'
    rotors = "".join(ROTOR.format(k=k, x=x, y=y) for k, (x, y) in enumerate(PLACES, 1))
    frame = '[parts.frame]\nkind = "body"\nposition = [0.0, 0.0, 0.0]\n'
    frame += "".join(
        DRAG.format(axis=f"F{axis.upper()}", name=f"frame_{axis}", own=own)
        for axis, own in zip("xyz", "uvw", strict=True)
    )
    return f"{head}[parameters]\n{start}{rotors}{frame}"


def flown(path: Path) -> dict[str, Array]:
    """Channels of the published file: body axes by its quaternion, in still air."""
    lines = path.read_text("utf-8").splitlines()
    names = lines[0].split(",")
    rows = np.array([[float(x) for x in line.split(",")[: len(names)]] for line in lines[1:]])
    d = {name: rows[:, k] for k, name in enumerate(names)}
    w, x, y, z = (d[f"q{k}"] for k in range(4))
    north, east, down = d["vx"], d["vy"], d["vz"]
    u = (1 - 2 * (y * y + z * z)) * north + 2 * (x * y + w * z) * east + 2 * (x * z - w * y) * down
    v = 2 * (x * y - w * z) * north + (1 - 2 * (x * x + z * z)) * east + 2 * (y * z + w * x) * down
    n = 2 * (x * z + w * y) * north + 2 * (y * z - w * x) * east + (1 - 2 * (x * x + y * y)) * down
    speed = np.sqrt(u**2 + v**2 + n**2)
    return {
        "time": d["timestamp"] * 1e-6, "V": speed, "alpha": np.arctan2(n, u),
        "beta": np.arctan2(v, np.hypot(u, n)), "p": d["ang_vel_x"], "q": d["ang_vel_y"],
        "r": d["ang_vel_z"], "rho": np.full(len(u), 1.225), "ax": d["acc_b_x"],
        "ay": d["acc_b_y"], "az": d["acc_b_z"],
        **{f"command_{k}": (d[f"u{k - 1}"] - 1000.0) / 1000.0 for k in range(1, 5)},
    }  # fmt: skip


def by_hand(x: dict[str, Array]) -> tuple[Array, Array]:
    """Columns of the six coefficients (3, n, 6) and accelerations (3, n)."""
    a, b = x["alpha"], x["beta"]
    air = x["V"] * np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])
    rates = np.array([x["p"], x["q"], x["r"]]).T
    columns = np.zeros((3, len(a), 6))
    for k, (px, py) in enumerate(PLACES, 1):
        command = x[f"command_{k}"]
        local = air + np.cross(rates, (px, py, -0.023)).T
        columns[0, :, 0] -= command * local[0]
        columns[1, :, 0] -= command * local[1]
        columns[2, :, 1] += 1.225 * command * np.abs(local[2])
        columns[2, :, 2] -= 1.225 * command**2
    for j in range(3):
        columns[j, :, 3 + j] = -0.5 * 1.225 * air[j] * np.abs(air[j])
    return columns, np.array([x["ax"], x["ay"], x["az"]])


@pytest.fixture(scope="module")
def workspace(
    tmp_path_factory: pytest.TempPathFactory, measured: Callable[[str], Path]
) -> tuple[Path, dict[str, Array]]:
    folder = tmp_path_factory.mktemp("quadrotor")
    x = flown(measured(DATA))
    head = ",".join(f"{n} [{CHANNELS.get(n, 's')}]" for n in x)
    np.savetxt(
        folder / "hover.csv", np.column_stack([*x.values()]), "%.12g", ",", header=head, comments=""
    )
    (folder / "vehicle.toml").write_text(VEHICLE)
    (folder / "quad.toml").write_text(database())
    listed = ", ".join(f'"{name}"' for name in NAMES)
    (folder / "model.toml").write_text(f"parameters = [{listed}]\nown_constants = false\n")
    mapping = (
        'name = "quad-table"\nformats = ["tabular"]\n[time]\ntopic = "table"\nfield = "time"\n'
    )
    mapping += "".join(
        f'[[channel]]\nname = "{n}"\nsources = [{{ topic = "table", field = "{n}" }}]\n'
        for n in CHANNELS
    )
    (folder / "mapping.toml").write_text(mapping)
    for words in (
        ("vehicle", "add", "vehicle.toml"),
        ("database", "import", "quad.toml"),
        ("flight", "ingest", "hover.csv", "--vehicle", "quad", "--mapping", "mapping.toml"),
    ):
        done = aerodb(folder / "workspace", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    return folder, x


def test_rotors_are_estimated_as_published(workspace: tuple[Path, dict[str, Array]]) -> None:
    folder, x = workspace
    answer = asked(
        folder / "workspace", "estimate", "--vehicle", "quad", "--model", str(folder / "model.toml")
    )
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    value = {name: found[name]["value"] for name in NAMES}
    error = {name: found[name]["standard_error"] for name in NAMES}
    published = {
        "cT0": 3.983, "cT1": 0.118, "cD": 0.127, "frame_x": 1.332e-3, "frame_y": 7.496e-3,
        "frame_z": 3.183e-2,
    }  # fmt: skip
    for name, stated in published.items():
        assert abs(value[name] - stated) < error[name], name
    assert value["cT0"] == pytest.approx(3.983, rel=2e-3)
    assert value["cD"] == pytest.approx(0.127, rel=5e-3)
    assert value["frame_y"] == pytest.approx(7.496e-3, rel=2e-2)
    # Least squares of the same file, its axis z, which shares no coefficient with the others.
    columns, acceleration = by_hand(x)
    hand = np.linalg.lstsq(columns[2][:, [1, 2, 5]], acceleration[2], rcond=None)[0]
    assert value["cT1"] == pytest.approx(hand[0], rel=0.02)
    assert value["cT0"] == pytest.approx(hand[1], rel=1e-3)


def test_the_estimate_tells_the_other_columns_of_the_table(
    workspace: tuple[Path, dict[str, Array]],
) -> None:
    """Published: p of the frame along x .230 and along z .032, where residuals count as white;
    correlations of regressors .80 and -.85 (with the other sign of c_T1); RMSE .1141 m/s2 over the
    stacked axes. Least squares of the file: .81, .855, .1194."""
    folder, x = workspace
    words = ("estimate", "--vehicle", "quad", "--model", str(folder / "model.toml"))
    (method,) = asked(folder / "workspace", *words)["methods"]
    (told,) = method["regressors"]
    found = dict(zip(told["names"], np.array(told["correlation"]), strict=True))
    columns, acceleration = by_hand(x)
    stacked = columns.reshape(-1, 6)
    hand = np.corrcoef(stacked.T)
    assert list(found) == list(NAMES)
    assert np.abs(np.array(list(found.values())) - hand).max() < 0.01
    assert found["cD"][NAMES.index("frame_x")] == pytest.approx(0.80, abs=0.015)
    assert found["cT1"][NAMES.index("frame_z")] == pytest.approx(0.85, abs=0.01)
    loads = np.array([method["axes"][axis]["load"] for axis in ("CX", "CY", "CZ")])
    solution, *_ = np.linalg.lstsq(stacked, acceleration.ravel(), rcond=None)
    rmse = np.sqrt(np.mean((acceleration.ravel() - stacked @ solution) ** 2))
    assert np.sqrt(np.mean(loads**2)) == pytest.approx(rmse, rel=0.01)  # a mass of 1 kg
    shares = [method["axes"][axis]["r_squared"] for axis in ("CX", "CY", "CZ")]
    assert shares == pytest.approx([0.998, 0.992, 0.931], abs=1e-3)
    printed = aerodb(folder / "workspace", *words, "--report").stdout
    for line in ("cD, frame_x: +0.81", "cT1, frame_z: +0.85", "R2 0.99", "#1 CX coefficients"):
        assert line in printed, line
    assert "p 0.5" in printed


@pytest.fixture(scope="module")
def updated(workspace: tuple[Path, dict[str, Array]]) -> str:
    """Label of the version that the flight makes."""
    folder, _ = workspace
    words = ("update", "--vehicle", "quad", "--model", str(folder / "model.toml"))
    return str(asked(folder / "workspace", *words)["label"])


def test_its_error_is_told_by_axis(workspace: tuple[Path, dict[str, Array]], updated: str) -> None:
    """Beside the constant (0, 0, -g), which alone explains .98 of the stacked axes."""
    folder, x = workspace
    shown = asked(folder / "workspace", "flight", "compare", "hover.csv", updated)
    columns, acceleration = by_hand(x)
    stacked = columns.reshape(-1, 6)
    fitted = columns @ np.linalg.lstsq(stacked, acceleration.ravel(), rcond=None)[0]
    for k, axis in enumerate(("CX", "CY", "CZ")):
        left = np.sqrt(np.mean((acceleration[k] - fitted[k]) ** 2)) / np.std(acceleration[k])
        assert shown["axes"][axis]["of_flown"] == pytest.approx(left, rel=0.02), axis
    assert (1 - shown["axes"]["CX"]["of_flown"] ** 2) == pytest.approx(0.998, abs=1e-3)
    assert (1 - shown["axes"]["CY"]["of_flown"] ** 2) == pytest.approx(0.992, abs=1e-3)
    assert (1 - shown["axes"]["CZ"]["of_flown"] ** 2) == pytest.approx(0.931, abs=2e-3)


def test_the_updated_quadrotor_hovers(
    workspace: tuple[Path, dict[str, Array]], updated: str
) -> None:
    """The version that the flight has made flies level at the command that the flight had."""
    folder, x = workspace
    answer = asked(
        folder / "workspace", "version", "trim", updated, "--speed", "0", "--altitude", "0"
    )
    mean = np.mean([x[f"command_{k}"].mean() for k in range(1, 5)])
    hover = np.mean([answer["inputs"][f"command_{k}"] for k in range(1, 5)])
    assert hover == pytest.approx(mean, rel=0.02)


def test_its_motors_are_written_for_gazebo_with_the_error_over_the_flight(
    workspace: tuple[Path, dict[str, Array]], updated: str
) -> None:
    """Thrust per square of speed is that of still air; what grows with the flow along the axis stays
    out, and is told by its largest force over the samples."""
    folder, x = workspace
    output = folder / "motors.sdf"
    words = ("version", "export", updated, "--format", "gazebo", "--output", str(output))
    answer = asked(folder / "workspace", *words)
    value = access_workspace(str(folder / "workspace")).database(answer["version"]).parameters
    constants = [float(t) for t in re.findall(r"<motorConstant>(.*?)<", output.read_text())]
    assert constants == pytest.approx([1.225 * value["cT0"] / (2.0 * np.pi) ** 2] * 4, rel=1e-6)
    columns, _ = by_hand(x)
    (told,) = (note for note in answer["notes"] if "beyond the square of speed" in note)
    newtons = float(re.findall(r"([\d.]+) N,", told)[0])
    assert newtons == pytest.approx(np.max(np.abs(columns[2][:, 1])) * value["cT1"], rel=0.02)
    assert any("samples of flight" in note and "hover.csv" in note for note in answer["notes"])
