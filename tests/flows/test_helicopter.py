"""A helicopter whose wake is distorted by its rates: what flights in hover tell, by the commands.

Published for the EC 135 in hover (DLR, flight tests): Kp 2.5, Kq 1.6. The flights are those of an
azimuth-resolved rotor (`tests.support.helicopter_flight`), with gusts that no sensor measures; the database
has the averaged equations, and begins without distortion.
"""

from pathlib import Path

import pytest

from tests.support.command import aerodb, asked
from tests.support.helicopter import VEHICLE, database
from tests.support.helicopter_flight import fly


def workspace(folder: Path, flights: list[Path], theory: str = "") -> Path:
    """A workspace in which v0001 has no wake distortion, with these flights."""
    for name, text in (
        ("vehicle", VEHICLE), ("rotor", database(0.0, 0.0, theory)), ("model", 'parameters = ["Kp", "Kq"]\n'),
    ):  # fmt: skip
        (folder / f"{name}.toml").write_text(text)
    for words in (
        ("vehicle", "add", "vehicle.toml"),
        ("database", "import", "rotor.toml", "--vehicle", "helicopter"),
        ("flight", "ingest", *(f.name for f in flights), "--vehicle", "helicopter",
         "--mapping", "canonical"),
    ):  # fmt: skip
        done = aerodb(folder / "workspace", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    return folder / "workspace"


def estimates(root: Path, flight: Path) -> dict[str, tuple[float, float]]:
    """Parameter -> value and standard error, of one flight."""
    model = str(flight.parent / "model.toml")
    words = ("estimate", "--vehicle", "helicopter", "--model", model, "--flights", flight.name)
    found = {
        each["parameter"]: each["estimates"]["regression"]
        for each in asked(root, *words)["parameters"]
    }
    return {name: (each["value"], each["standard_error"]) for name, each in found.items()}


def test_wake_distortion_is_found_and_mends_the_off_axis_response(tmp_path: Path) -> None:
    (flight,) = fly(tmp_path, [1], 30.0, kp=2.5, kq=1.6)
    root = workspace(tmp_path, [flight])
    found = estimates(root, flight)
    assert found["Kp"][0] == pytest.approx(2.5, rel=0.1)
    assert found["Kq"][0] == pytest.approx(1.6, rel=0.1)
    shown = asked(root, "flight", "compare", flight.name, "v0001")
    before = {axis: each["of_flown"] for axis, each in shown["axes"].items()}
    made = asked(
        root, "update", "--vehicle", "helicopter", "--model", str(tmp_path / "model.toml"),
        "--hold-out", "none",
    )["label"]  # fmt: skip
    shown = asked(root, "flight", "compare", flight.name, made)
    after = {axis: each["of_flown"] for axis, each in shown["axes"].items()}
    assert after["Cl"] < 0.4 * before["Cl"]
    assert after["Cm"] < 0.4 * before["Cm"]
    assert asked(root, "flight", "show", flight.name)["verdict"] == "good"


def test_at_speed_a_fit_has_what_theory_has_not(tmp_path: Path) -> None:
    """At an advance ratio of .18 the wake is skewed, which the database has not, and is not distorted.
    Published for the EC 135 there: Kp 1.1 from flight tests, 0 from theory, and "good match"."""
    flights = fly(tmp_path, [1, 2], 30.0, kp=0.0, kq=0.0, speed=38.0)
    root = workspace(tmp_path, flights, theory="0.0")
    words = ("estimate", "--vehicle", "helicopter", "--model", str(tmp_path / "model.toml"))
    done = aerodb(root, *words)
    assert done.returncode == 0, done.stderr
    (said,) = [line for line in done.stdout.splitlines() if "theory has 0" in line]
    assert "Kp is 0." in said
    assert "a good fit does not prove the name" in said
    for flight in flights:  # whose rotor damps roll more than a wing would
        shown = aerodb(root, "flight", "show", flight.name, "-v")
        assert "wing of aspect ratio" not in shown.stdout


def test_intervals_hold_nothing_where_there_is_none(tmp_path: Path) -> None:
    (flight,) = fly(tmp_path, [102], 30.0, kp=0.0, kq=0.0)
    for name, (value, error) in estimates(workspace(tmp_path, [flight]), flight).items():
        assert abs(value) < 1.96 * error, name
        assert error < 0.1, name


@pytest.mark.campaign
def test_intervals_hold_nothing_at_their_rate(tmp_path: Path) -> None:
    """Of 40 intervals of 95 %, fewer than 34 hold the truth in three of a thousand such campaigns."""
    flights = fly(tmp_path, range(200, 220), 30.0, kp=0.0, kq=0.0)
    root = workspace(tmp_path, flights)
    held = [
        abs(value) < 1.96 * error
        for flight in flights
        for value, error in estimates(root, flight).values()
    ]
    assert len(held) == 40
    assert sum(held) >= 34
