"""A quadplane's log of PX4 that hovers and flies slowly, from file to report by the commands of the
multicopter guide.

The simulated quadplane (`tests.support.multicopter_flight`) has a wing of a flat plate, an elevator
that follows the pitch rate, a pusher that stands still, and a pitot tube.
"""

from pathlib import Path

import numpy as np
import pytest

from aerodb.recording import Topic
from aerodb.support import Array
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb, asked
from tests.support.multicopter_flight import (
    CT0,
    DIAMETER,
    FASTEST,
    MASS,
    RHO,
    TRAVEL,
    Flown,
    elevator,
    fly,
    parameters,
    write_px4,
)

#: Of PX4: standard VTOL, a pusher, an elevator whose positive command turns it up, its airspeed.
QUADPLANE = {
    "MAV_TYPE": 22.0, "CA_AIRFRAME": 2.0, "CA_ROTOR_COUNT": 5.0, "CA_ROTOR4_PX": -0.4,
    "CA_ROTOR4_AX": 1.0, "CA_ROTOR4_AZ": 0.0, "CA_SV_CS_COUNT": 1.0, "CA_SV_CS0_TYPE": 3.0,
    "CA_SV_CS0_TRQ_P": 1.0, "FW_AIRSPD_TRIM": 14.0,
}  # fmt: skip
#: vehicle_vtol_state: rotors alone, the wing alone.
ROTORS, WING = 3, 4
MODEL = (
    'parameters = ["rotor_cT0", "rotor_cT1", "rotor_cQ", "rotor_drag", "wing_slope",'
    ' "elevator_moment"]\nown_constants = false\n'
)


def write_quadplane(
    path: Path, flown: Flown, states: tuple[int, ...] = (ROTORS,), pusher: Array | None = None
) -> None:
    """A flight as PX4 logs it, with these states of the VTOL, equally long, and the commands (n,)
    of the pusher, which is stopped unless they are given."""
    time = 100.0 + flown.time[::25]
    noise = np.random.default_rng(5).standard_normal(len(time))
    pressure = np.maximum(0.5 * RHO * flown.velocity[::25, 0, 0] ** 2 + 1.5 * noise, 0.0)
    speed = np.sqrt(2.0 / RHO * pressure).astype(np.float32)
    starts = 100.0 + flown.time[-1] * np.arange(len(states)) / len(states)
    write_px4(
        path,
        flown,
        known=parameters(**QUADPLANE),
        pusher=np.full(len(flown.time), np.nan) if pusher is None else pusher,
        servos=-elevator(flown.rates[:, 1, 0]) / TRAVEL,
        more=[
            Topic("vtol_vehicle_status", starts, {"vehicle_vtol_state": np.array(states, "u1")}),
            Topic(
                "airspeed_validated",
                time,
                {"calibrated_airspeed_m_s": speed, "true_airspeed_m_s": speed},
            ),
        ],
    )


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a vehicle, its database and one flight, all made from `plane.ulg`."""
    folder = tmp_path_factory.mktemp("quadplane")
    write_quadplane(folder / "plane.ulg", fly([11], 30.0, gusts=0.1, busy=0.05, wing=0.2))
    for words in (
        ("vehicle", "init", "plane", "--from", "plane.ulg"),
        ("vehicle", "add", "plane.toml"),
        ("database", "import", "plane-rotors.toml", "--vehicle", "plane"),
        ("flight", "ingest", "plane.ulg", "--vehicle", "plane"),
    ):
        done = aerodb(folder / "workspace", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_inspection_says_what_a_hover_tells(flown: Path) -> None:
    found = asked(flown / "workspace", "log", "inspect", str(flown / "plane.ulg"))
    assert (found["usable"], found["airframe"]) == (True, "standard VTOL")
    assert [each["field"] for each in found["rotors"]["rotors"]] == [
        f"control[{k}]" for k in range(4)
    ]
    assert found["hover"] == "it only hovers: rotors are learnt, wing and control surfaces are not"


def test_the_drafts_hold_rotors_that_turn_and_the_elevator(flown: Path) -> None:
    vehicle = parse_vehicle((flown / "plane.toml").read_text())
    assert list(vehicle.rotors) == ["1", "2", "3", "4"]
    assert list(vehicle.surfaces) == ["elevator"]
    assert vehicle.surfaces["elevator"].scale < 0.0  # a positive command turns it up


def test_its_rotors_are_identified_and_wing_and_elevator_are_not_excited(flown: Path) -> None:
    (flown / "model.toml").write_text(MODEL)
    words = ("estimate", "--vehicle", "plane", "--model", str(flown / "model.toml"))
    answer = asked(flown / "workspace", *words)
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    thrust = CT0 * DIAMETER**4 * FASTEST**2 / MASS
    assert found["rotor_cT0"]["value"] == pytest.approx(thrust, rel=0.02)
    for name in ("wing_slope", "elevator_moment"):
        assert found[name]["standing"] == "not excited", name
        assert found[name]["value"] is None, name
    printed = aerodb(flown / "workspace", *words, "-v").stdout
    assert "elevator_moment by regression: not excited" in printed
    assert "wing_slope by regression: not excited" in printed


def test_its_report_is_written(flown: Path) -> None:
    shown = asked(flown / "workspace", "flight", "show", "plane.ulg")
    assert shown["verdict"] == "good"
    done = aerodb(
        flown / "workspace", "report", "flight", "plane.ulg", "--output", "page.html", folder=flown
    )
    assert done.returncode == 0, done.stderr
    assert "command_4" in (flown / "page.html").read_text()


def test_a_flight_on_wings_leaves_its_hover_out_as_before(tmp_path: Path) -> None:
    write_quadplane(tmp_path / "both.ulg", fly([12], 20.0, wing=0.2), (ROTORS, WING))
    found = asked(tmp_path / "w", "log", "inspect", str(tmp_path / "both.ulg"))
    assert "left out by its modes from 100.0 to 110.0 s" in found["hover"]
    done = aerodb(tmp_path / "w", "vehicle", "init", "both", "--from", "both.ulg", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "both-rotors.toml").exists()
    assert not parse_vehicle((tmp_path / "both.toml").read_text()).rotors


def test_a_pusher_that_turns_has_parameters_of_its_own(tmp_path: Path) -> None:
    flight = fly([13], 12.0, wing=0.2)
    write_quadplane(tmp_path / "pushed.ulg", flight, pusher=0.2 + 0.1 * np.sin(flight.time))
    done = aerodb(
        tmp_path / "w", "vehicle", "init", "plane", "--from", "pushed.ulg", folder=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert list(parse_vehicle((tmp_path / "plane.toml").read_text()).rotors) == list("12345")
    text = (tmp_path / "plane-rotors.toml").read_text()
    assert 'thrust = ["pusher_cT0", "pusher_cT1"]' in text
    assert "strength_5" not in text
    for words in (
        ("vehicle", "add", "plane.toml"),
        ("database", "import", "plane-rotors.toml", "--vehicle", "plane"),
    ):
        done = aerodb(tmp_path / "w", *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
