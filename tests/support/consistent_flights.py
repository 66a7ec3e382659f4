"""Flights of known truth as log tables: the motion of `simulated_path` with planted sensor errors,
wind and gusts."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from aerodb.storage.files.flights import read_results
from aerodb.tasks.workspace_access import WorkspaceAccess
from tests.support.simulated_path import DENSITY, INERTIAL_NOISE, NOISE, truth
from tests.support.small_glider import write_parquet

NAME = "formula-plane"
RATE = 50.0
VEHICLE = f"""\
name = "{NAME}"
[reference]
area = 10.0
chord = 1.2
span = 9.0
[points]
moment_reference = "cg"
[mass]
mass = 800.0
cg = [0.0, 0.0, 0.0]
Ixx = 900.0
Iyy = 1500.0
Izz = 2200.0
Ixz = 60.0
[thrust]
source = "none"
"""
PLANTED = {
    "ax_bias": 0.05, "ay_bias": -0.08, "az_bias": 0.12, "p_bias": 0.003, "q_bias": -0.002, "r_bias": 0.0025,
    "alpha_bias": 0.012, "beta_bias": -0.009, "alpha_delay": 0.03, "wind_north": 6.0, "wind_east": -4.0,
}  # fmt: skip


def table(
    seed: int = 1,
    planted: Mapping[str, float] = PLANTED,
    seconds: float = 60.0,
    gusts: float = 0.0,
    start: float = 0.0,
    without: tuple[str, ...] = (),
) -> dict[str, np.ndarray]:
    """Columns of one flight; `gusts`: rms speed (m/s) of gusts with a correlation time of 1 s on V,
    alpha and beta."""
    rng = np.random.default_rng(seed)
    time = start + np.arange(round(seconds * RATE)) / RATE
    wind = tuple(planted.get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down"))
    moving = {name: gusts * _coloured(rng, len(time)) for name in ("V", "alpha", "beta")}
    columns = {"time": time - start, "rho": np.full(len(time), DENSITY)}
    noise = {**NOISE, **dict(zip(("ax", "ay", "az", "p", "q", "r"), INERTIAL_NOISE, strict=True))}
    for name, sigma in noise.items():
        shown = truth(time - planted.get(f"{name}_delay", 0.0), wind)[name]
        if name in moving:
            shown = shown + moving[name] / (1.0 if name == "V" else 60.0)
        columns[name] = (
            shown + planted.get(f"{name}_bias", 0.0) + sigma * rng.standard_normal(len(time))
        )
    columns["qbar"] = 0.5 * DENSITY * columns["V"] ** 2
    return {name: values for name, values in columns.items() if name not in without}


def _coloured(rng: np.random.Generator, n: int) -> np.ndarray:
    keep = np.exp(-1.0 / RATE)
    values, drive = np.zeros(n), np.sqrt(1 - keep**2) * rng.standard_normal(n)
    for k in range(1, n):
        values[k] = keep * values[k - 1] + drive[k]
    return values


def exact(columns: Mapping[str, np.ndarray], start: float = 0.0) -> dict[str, np.ndarray]:
    """The true channels of a table's times."""
    return truth(columns["time"] + start)


def log(folder: Path, name: str, columns: dict[str, np.ndarray]) -> Path:
    """The table as a log file."""
    return write_parquet(folder / f"{name}.parquet", columns)


def stored_sigma(access: WorkspaceAccess, key: str) -> dict[str, np.ndarray]:
    """Channel -> (n,) one standard error, of the consistent flight stored under `key`."""
    path = access.path_of(key)
    assert path is not None
    return {
        name.removeprefix("sigma_"): x
        for name, x in read_results(path)[0].items()
        if name.startswith("sigma_")
    }
