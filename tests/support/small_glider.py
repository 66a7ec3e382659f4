"""A small glider whose flights are written as CSV tables in a moment: what the tests of flows and
commands fly.

Pitching motion only. The flown aircraft differs from its handbook database by known amounts on CX
and CZ, so that an update has something to find.
"""

import hashlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from aerodb.nomenclature import channel

NAME = "small-glider"
V, RHO, AREA, CHORD, MASS = 25.0, 1.1, 0.9, 0.25, 12.0

VEHICLE = f"""\
name = "{NAME}"
[reference]
area = {AREA}
chord = {CHORD}
span = 3.6
[points]
moment_reference = "cg"
[mass]
source = "constant"
mass = {MASS}
cg = [-0.4, 0.0, 0.0]
Ixx = 3.0
Iyy = 1.6
Izz = 4.4
Ixz = 0.1
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
[thrust]
source = "none"
[processing]
bandwidth = "4 Hz"
"""

DATABASE = f"""\
name = "handbook"
[reference]
area = {AREA}
chord = {CHORD}
span = 3.6
moment_reference = [-0.4, 0.0, 0.0]
[tables.CZ0]
arguments = ["alpha"]
units = ["deg"]
breakpoints = [[-4, 0, 4, 8, 12]]
values = [0.05, -0.3, -0.65, -1.0, -1.3]
[[terms]]
name = "lift_curve"
axis = "CZ"
expression = "CZ0(alpha)"
[derivatives.CX]
"1" = -0.03
alpha = 0.4
[derivatives.CY]
beta = -0.3
[derivatives.Cl]
p_hat = -0.5
[derivatives.Cm]
alpha = -0.6
q_hat = -12.0
delta_elevator = -1.1
[derivatives.Cn]
beta = 0.06
"""

#: What the flown glider has beyond its handbook.
TRUTH = {"CZ": {"1": -0.02, "alpha": -0.5, "q_hat": -4.0}, "CX": {"1": -0.008, "alpha": 0.1}}

MODEL = """\
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat"]
[[increment]]
axis = "CX"
terms = ["1", "alpha"]
"""


def channels(seed: int, seconds: float = 12.0, rate: float = 25.0) -> dict[str, np.ndarray]:
    """Canonical channels of one flight: a pitching motion of random frequencies, accelerations with
    sensor noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    alpha, alphadot = np.full_like(t, np.deg2rad(4.0)), np.zeros_like(t)
    for amplitude in np.deg2rad([1.6, 0.9, 0.5]):
        omega, phase = rng.uniform(0.8, 5.0), rng.uniform(0, 2 * np.pi)
        alpha += amplitude * np.sin(omega * t + phase)
        alphadot += amplitude * omega * np.cos(omega * t + phase)
    q = alphadot + 0.05 * np.sin(
        2.3 * t
    )  # what the flight path adds tells the pitch rate from alpha-dot
    qbar = np.full_like(t, 0.5 * RHO * V**2)
    q_hat = q * CHORD / (2 * V)
    breaks, values = np.deg2rad([-4, 0, 4, 8, 12]), [0.05, -0.3, -0.65, -1.0, -1.3]
    cz = (
        np.interp(alpha, breaks, values)
        + TRUTH["CZ"]["1"]
        + TRUTH["CZ"]["alpha"] * alpha
        + TRUTH["CZ"]["q_hat"] * q_hat
    )
    cx = -0.03 + 0.4 * alpha + TRUTH["CX"]["1"] + TRUTH["CX"]["alpha"] * alpha
    noise = 0.02 * rng.standard_normal((2, len(t)))
    zero = np.zeros_like(t)
    return {
        "time": t,
        "V": np.full_like(t, V),
        "qbar": qbar,
        "alpha": alpha,
        "beta": zero,
        "p": zero,
        "q": q,
        "r": zero,
        "ax": cx * qbar * AREA / MASS + noise[0],
        "ay": zero,
        "az": cz * qbar * AREA / MASS + noise[1],
        "delta_elevator": -0.5 * (alpha - np.deg2rad(4.0)) + 0.02 * np.sin(3.1 * t),
    }


def write_csv(path: Path, table: dict[str, np.ndarray]) -> Path:
    """`table` as CSV with units in the header and every digit; returns `path`."""
    header = ",".join(f"{name} [{channel(name).unit}]" for name in table)
    rows = [",".join(map(repr, map(float, row))) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def write_parquet(path: Path, table: dict[str, np.ndarray]) -> Path:
    """`table` as Parquet with units in the field metadata; returns `path`."""
    fields = [pa.field(name, pa.float64(), metadata={"unit": channel(name).unit}) for name in table]
    pq.write_table(pa.table(list(table.values()), schema=pa.schema(fields)), path)
    return path


def write_files(folder: Path, flights: int = 6) -> list[Path]:
    """Vehicle, database and model file, and `flights` logs, into `folder`; returns the logs in the
    order flown."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (
        ("vehicle.toml", VEHICLE),
        ("database.toml", DATABASE),
        ("model.toml", MODEL),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    return [write_csv(folder / f"flight{k + 1}.csv", channels(k)) for k in range(flights)]


def state_of(
    root: Path, but: tuple[str, ...] = ("catalogue.sqlite", "prefect", "quarantine")
) -> dict[str, str]:
    """Relative path -> sha256 of every file of a workspace, leaving out what begins with one of
    `but`."""
    found = {
        path.relative_to(root).as_posix(): path
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in found.items()
        if not name.startswith(tuple(but))
    }
