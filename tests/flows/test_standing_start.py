"""A take-off from a standstill in which the critical engine fails, by the commands: JSBSim's 737
with its own gear and engines, flown again on its imported file joined by legs as parts."""

from pathlib import Path
from typing import Any

import pytest

from tests.support.command import asked
from tests.support.jsbsim_flights import aircraft_file
from tests.support.small_glider import write_csv
from tests.support.standing_start import ROLLING, legs_text, logged, taken_off, vehicle_text

BINDINGS = ("flap-pos-norm=delta_flap", "speedbrake-pos-norm=0", "spoiler-pos-norm=0")


def imported(folder: Path, rolling: float) -> str:
    """The label of JSBSim's file joined by legs with a rolling friction."""
    legs = folder / f"legs-{rolling:g}.toml"
    legs.write_text(legs_text(rolling), encoding="utf-8")
    bind = [word for each in BINDINGS for word in ("--bind", f"fcs/{each}")]
    given = ("--vehicle", "b737", *bind)
    found = asked(folder / "w", "database", "import", str(folder / "737.xml"), str(legs), *given)
    return str(found["label"])


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("take-off")
    channels = taken_off()
    (folder / "737.xml").write_bytes(aircraft_file("737"))
    (folder / "vehicle.toml").write_text(vehicle_text(channels), encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    logs = [str(write_csv(folder / f"{seed}.csv", logged(channels, seed))) for seed in range(2)]
    given = ("--vehicle", "b737", "--mapping", "canonical", "--direct")
    asked(folder / "w", "flight", "ingest", *logs, *given)
    return folder


def checked(folder: Path, label: str) -> dict[str, dict[str, Any]]:
    """The checks of 000's take-off with an engine failure, from standstill to 200 ft, open loop."""
    how = ("--from", "0", "--to", "59", "--no-stabilise", "--tolerances", "engine-failure")
    flown = asked(folder / "w", "version", "fly", label, "--flight", "0.csv", *how)
    (stretch,) = flown["stretches"]
    assert (stretch["since"], stretch["until"]) == (0.0, 59.0)
    assert "reason" not in stretch
    return {each["check"].rpartition(" ")[2]: each for each in stretch["checks"]}


@pytest.mark.heavy
def test_it_is_within_tolerance_with_its_friction_outside_without_and_found(
    workspace: Path,
) -> None:
    right, wrong = imported(workspace, ROLLING), imported(workspace, 1.2 * ROLLING)
    within = checked(workspace, right)
    assert set(within) == {"airspeed", "altitude", "attitude", "bank"}
    assert all(each["passed"] for each in within.values())
    outside = checked(workspace, wrong)
    assert not outside["altitude"]["passed"]
    assert outside["altitude"]["share"] < 0.9
    given = ("--baseline", wrong, "--on-ground", "--direct")
    found = asked(workspace / "w", "close-loop", *given)
    assert found["added"] == ["parameter@all:mu_roll"]
    (change,) = found["parameters"]
    assert change["after"] == pytest.approx(ROLLING, rel=0.05)
    assert all(each["passed"] for each in checked(workspace, found["label"]).values())
