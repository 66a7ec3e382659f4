"""A planted error of hinge moments through commands: found in flights with a logged stick force,
added to the database, proved on flights that were not used, exported and read back."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.support.command import aerodb, asked
from tests.support.small_glider import DATABASE, NAME, VEHICLE, channels, write_csv

#: Area [m2] and chord [m] behind the hinge line, and hinge moment over stick force [m].
AREA, CHORD, GEARING = 0.06, 0.05, -0.4
#: Noise of the stick force [N]: a hundredth of what is flown of it.
NOISE = 0.0003
#: Part of the hinge moment that the handbook has too much: 20 % of what is flown.
PLANTED = 0.2
HANDBOOK = {"1": -0.02, "alpha": -0.15, "delta_elevator": -0.5}

HINGE = f"""
[surfaces.elevator.hinge]
area = {AREA}
chord = {CHORD}
gearing = {GEARING}
log = {{ topic = "table", field = "stick_force", unit = "N" }}
"""
MODEL = """
[[increment]]
axis = "Ch_elevator"
terms = ["1", "alpha", "delta_elevator"]
"""


def _log(path: Path, seed: int, share: float) -> Path:
    """A flight whose hinge moments are `share` of the handbook's, as force on the stick."""
    flown = channels(seed)
    one = {"1": np.ones_like(flown["alpha"]), **flown}
    moment = share * sum(value * one[name] for name, value in HANDBOOK.items())
    force = moment * flown["qbar"] * AREA * CHORD / GEARING
    force = force + NOISE * np.random.default_rng([seed, 7]).standard_normal(len(force))
    header, *rows = write_csv(path, flown).read_text().splitlines()
    lines = [f"{header},stick_force [N]"]
    lines += [f"{row},{value!r}" for row, value in zip(rows, force.tolist(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


def _workspace(folder: Path, share: float) -> Path:
    folder.mkdir()
    terms = "".join(f'"{name}" = {value}\n' for name, value in HANDBOOK.items())
    for name, text in (
        ("vehicle.toml", VEHICLE.replace("[thrust]", f"{HINGE}[thrust]")),
        ("database.toml", f"{DATABASE}[derivatives.Ch_elevator]\n{terms}"),
        ("model.toml", MODEL),
    ):
        (folder / name).write_text(text)
    logs = [str(_log(folder / f"flight{k}.csv", k, share)) for k in range(6)]
    place = folder / "workspace"
    asked(place, "vehicle", "add", str(folder / "vehicle.toml"))
    asked(place, "database", "import", str(folder / "database.toml"), "--vehicle", NAME)
    asked(place, "flight", "ingest", *logs, "--vehicle", NAME)
    return place


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with six flights that have 0.8 of the handbook's hinge moments."""
    return _workspace(tmp_path_factory.mktemp("hinges") / "wrong", 1.0 - PLANTED)


@pytest.fixture
def place(wrong: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(wrong.parent, tmp_path / "copy")) / "workspace"


def test_a_planted_error_is_found_added_proved_and_exported(place: Path, tmp_path: Path) -> None:
    compared = asked(place, "flight", "compare", "flight0", "released")["axes"]["Ch_elevator"]
    assert compared["of_flown"] > 0.2
    assert compared["rms_residual"] > 10.0 * compared["noise_floor"]

    model = str(place.parent / "model.toml")
    made = asked(place, "update", "--vehicle", NAME, "--model", model)
    (increment,) = made["increments"]
    found = {each["term"]: each for each in increment["terms"]}
    for name, value in HANDBOOK.items():
        planted, error = -PLANTED * value, found[name]["standard_error"]
        assert abs(found[name]["value"] - planted) < 4.0 * error
        assert found[name]["value"] == pytest.approx(planted, rel=0.1)
    after = made["axes"]["Ch_elevator"]
    assert after["held_out_rms_before"] > 10.0 * after["noise_floor"]
    assert after["held_out_rms_after"] < 1.25 * after["noise_floor"]
    assert after["outcome"] == "at noise floor"
    assert made["gate"]["passed"]
    for axis in ("CX", "CZ", "Cm"):
        other = made["axes"][axis]
        assert other["held_out_rms_before"] == other["held_out_rms_after"]

    at = ("--at", "alpha=5deg,delta_elevator=2deg")
    version = made["label"]
    shown = asked(place, "version", "evaluate", version, *at, "--vehicle", NAME)
    expected = HANDBOOK["1"] + np.deg2rad(5.0) * HANDBOOK["alpha"]
    expected = (1.0 - PLANTED) * (expected + np.deg2rad(2.0) * HANDBOOK["delta_elevator"])
    assert shown["coefficients"]["Ch_elevator"] == pytest.approx(expected, rel=0.02)

    file = tmp_path / "glider.dml"
    asked(place, "version", "export", version, "--format", "daveml", "--output", str(file))
    other = ("--format", "sitl", "--output", str(tmp_path / "sitl.json"))
    held = asked(place, "version", "export", version, *other)["differences"]
    assert held["Ch_elevator"] > 0.02  # what that form cannot hold
    again = asked(
        place, "database", "import", str(file), "--vehicle", NAME, "--replace", "--reason", "back"
    )
    read = asked(place, "version", "evaluate", again["label"], *at, "--vehicle", NAME)
    assert read["coefficients"] == pytest.approx(shown["coefficients"], rel=1e-12, abs=1e-15)


def test_of_a_true_database_nothing_is_released(tmp_path: Path) -> None:
    place = _workspace(tmp_path / "true", 1.0)
    compared = asked(place, "flight", "compare", "flight0", "released")["axes"]["Ch_elevator"]
    assert compared["rms_residual"] < 1.25 * compared["noise_floor"]
    model = str(place.parent / "model.toml")
    made = asked(place, "update", "--vehicle", NAME, "--model", model)
    assert not made["gate"]["passed"]
    (increment,) = made["increments"]
    for each in increment["terms"]:
        assert abs(each["value"]) < 4.0 * each["standard_error"]


def test_a_closed_loop_says_who_tells_of_hinge_moments(place: Path) -> None:
    made = aerodb(place, "close-loop", "--vehicle", NAME, "-v")
    assert made.returncode == 0, made.stderr
    assert "Declare an increment on it in a model file" in " ".join(made.stdout.split())


def test_a_method_that_flies_is_refused(place: Path) -> None:
    model = str(place.parent / "model.toml")
    made = aerodb(place, "update", "--vehicle", NAME, "--model", model, "--method", "output-error")
    assert made.returncode != 0
    assert "a hinge moment moves no aircraft" in made.stderr
