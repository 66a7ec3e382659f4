"""A multicopter's log of PX4, from file to report by the commands of the guide.

The log is written by equations of its own (`tests.support.multicopter_flight`), and knows neither
mass, diameter nor speed of its rotors.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.coefficients import thinning
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb, asked
from tests.support.multicopter_flight import (
    CQ,
    CT0,
    CT1,
    DIAMETER,
    FASTEST,
    FRAME,
    INERTIA,
    MASS,
    MOTOR,
    ROTOR_DRAG,
    ROTORS,
    fly,
    parameters,
    write_px4,
)

MODEL = (
    'parameters = ["rotor_cT0", "rotor_cT1", "rotor_cQ", "rotor_drag",'
    ' "frame_x", "frame_y", "frame_z"]\nown_constants = false\n'
)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a vehicle, its database and one flight, all made from `quad.ulg`."""
    folder = tmp_path_factory.mktemp("px4")
    write_px4(folder / "quad.ulg", fly([11], 30.0, gusts=0.1))
    for words in (
        ("vehicle", "init", "quad", "--from", "quad.ulg"),
        ("vehicle", "add", "quad.toml"),
        ("database", "import", "quad-rotors.toml", "--vehicle", "quad"),
        ("flight", "ingest", "quad.ulg", "--vehicle", "quad"),
    ):
        done = aerodb(folder / "workspace", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_the_drafts_hold_the_autopilots_own_rotors(flown: Path) -> None:
    vehicle = parse_vehicle((flown / "quad.toml").read_text())
    assert [each.log.field for each in vehicle.rotors.values()] == [
        f"control[{k}]" for k in range(4)
    ]
    assert vehicle.rotors["1"].lag == pytest.approx(MOTOR, abs=5e-4)
    inertia = np.array([vehicle.mass.Ixx, vehicle.mass.Iyy]) / (INERTIA[:2] / MASS)
    assert np.all(np.abs(inertia - 1.0) < 0.02)
    text = (flown / "quad-rotors.toml").read_text()
    for x, y, z, _ in ROTORS:
        assert f"position = [{x:g}, {y:g}, {z:g}]" in text


def test_what_the_flight_tells_is_the_lumped_truth(flown: Path) -> None:
    (flown / "model.toml").write_text(MODEL)
    answer = asked(
        flown / "workspace", "estimate", "--vehicle", "quad", "--model", str(flown / "model.toml")
    )
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    thrust = CT0 * DIAMETER**4 * FASTEST**2 / MASS
    assert found["rotor_cT0"]["value"] == pytest.approx(thrust, rel=0.02)
    drag = ROTOR_DRAG * FASTEST / MASS
    assert found["rotor_drag"]["value"] == pytest.approx(drag, abs=0.01)


def test_in_calm_air_the_truth_is_within_three_standard_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the inertia measured: a lag of one step less, 5 ms, moves the loss by 23 of them. So it is
    where the flight counts as long and is thinned, with about the same standard errors."""
    write_px4(tmp_path / "calm.ulg", fly([11], 30.0, gusts=0.0))
    (tmp_path / "model.toml").write_text(MODEL)
    workspace = tmp_path / "workspace"
    done = aerodb(workspace, "vehicle", "init", "quad", "--from", "calm.ulg", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "quad.toml").read_text()
    for name, value in zip(("Ixx", "Iyy", "Izz"), INERTIA / MASS, strict=True):
        text = re.sub(rf"{name} = \S+", f"{name} = {value:.6g}", text)
    (tmp_path / "quad.toml").write_text(text)
    for words in (
        ("vehicle", "add", "quad.toml"),
        ("database", "import", "quad-rotors.toml", "--vehicle", "quad"),
        ("flight", "ingest", "calm.ulg", "--vehicle", "quad"),
    ):
        done = aerodb(workspace, *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    asking = ("estimate", "--vehicle", "quad", "--model")
    (tmp_path / "long.toml").write_text(f"{MODEL}# thinned\n")  # another key
    found, thin = dict[str, Any](), dict[str, Any]()
    for name, into in (("model", found), ("long", thin)):
        into |= {
            each["parameter"]: each["estimates"]["regression"]
            for each in asked(workspace, *asking, str(tmp_path / f"{name}.toml"))["parameters"]
        }
        monkeypatch.setattr(thinning, "LONG", 10.0)
    truth = {
        "rotor_cT0": CT0 * DIAMETER**4 * FASTEST**2 / MASS,
        "rotor_cT1": CT1 * DIAMETER**3 * FASTEST / MASS,
        "rotor_cQ": CQ * DIAMETER**5 * FASTEST**2 / MASS,
        "rotor_drag": ROTOR_DRAG * FASTEST / MASS,
        **{f"frame_{axis}": area / MASS for axis, area in zip("xyz", FRAME, strict=True)},
    }
    for name, value in truth.items():
        assert abs(found[name]["value"] - value) < 3.0 * found[name]["standard_error"], name
        assert abs(thin[name]["value"] - value) < 3.0 * thin[name]["standard_error"], name
        assert thin[name]["value"] != found[name]["value"], name
        ratio = thin[name]["standard_error"] / found[name]["standard_error"]
        assert 0.7 < ratio < 1.4, name


def test_intervals_without_airspeed_hold_the_truth_in_gusts(flown: Path) -> None:
    """Gusts of .3 m/s that no sensor measures: what white and coloured residuals alone leave was a
    tenth of the error that gusts make of the drag."""
    (flown / "model.toml").write_text(MODEL)
    write_px4(flown / "gusty.ulg", fly([41], 30.0, busy=0.1))
    done = aerodb(
        flown / "workspace", "flight", "ingest", "gusty.ulg", "--vehicle", "quad", folder=flown
    )
    assert done.returncode == 0, done.stderr
    words = ("estimate", "--vehicle", "quad", "--model", str(flown / "model.toml"))
    answer = asked(flown / "workspace", *words, "--flights", "gusty.ulg")
    found = {each["parameter"]: each["estimates"]["regression"] for each in answer["parameters"]}
    for name, value in (
        ("rotor_cT0", CT0 * DIAMETER**4 * FASTEST**2 / MASS),
        ("rotor_drag", ROTOR_DRAG * FASTEST / MASS),
    ):
        assert abs(found[name]["value"] - value) < 2.5 * found[name]["standard_error"], name
    printed = aerodb(flown / "workspace", *words, "--flights", "gusty.ulg", "-v").stdout
    assert "air that no sensor measures" in printed


def test_a_selection_is_stored_with_its_estimate(flown: Path) -> None:
    (flown / "model.toml").write_text(MODEL)
    words = ("estimate", "--vehicle", "quad", "--model", str(flown / "model.toml"))
    chosen = ("--select", "time > 10  s", "--select", "command_1>0.3")
    answer = asked(flown / "workspace", *words, *chosen)
    assert answer["select"] == ["time > 10 s", "command_1 > 0.3"]
    whole = asked(flown / "workspace", *words)
    assert "select" not in whole
    # Two thirds of the samples tell less; the air that standard errors include is each one's own.
    reports = [one["methods"][0]["report"] for one in (answer, whole)]
    samples = [int(re.findall(r"(\d+) samples;", each)[0]) for each in reports]
    bounds = [float(re.findall(r"rotor_cT0 .* Cramer-Rao (\S+)", each)[0]) for each in reports]
    assert 0.5 < samples[0] / samples[1] < 0.75
    assert bounds[0] > bounds[1]
    refused = aerodb(flown / "workspace", *words, "--select", "time > 1 h")
    assert (refused.returncode, "no sample is selected" in refused.stderr) == (3, True)


def test_an_update_of_a_selection_is_its_estimate_and_is_repeated_by_like(flown: Path) -> None:
    (flown / "model.toml").write_text(MODEL)
    words = ("--vehicle", "quad", "--model", str(flown / "model.toml"))
    chosen = ("--select", "command_1 > 0.3", "--select", "time>10 s")
    hold = ("--hold-out", "none", "--flights", "quad.ulg")
    made = asked(flown / "workspace", "update", *words, *hold, *chosen)
    assert made["select"] == ["command_1 > 0.3", "time > 10 s"]
    assert any("command_1 > 0.3 and time > 10 s" in each for each in made["remarks"])
    of = ("--flights", "quad.ulg")
    told = asked(flown / "workspace", "estimate", *words, *chosen, *of)["parameters"]
    alone = {each["parameter"]: each["estimates"]["regression"] for each in told}
    again = asked(flown / "workspace", "update", "--vehicle", "quad", "--like", made["label"])
    assert again["candidate"] == made["candidate"]
    whole = asked(flown / "workspace", "update", *words, *hold)
    assert "select" not in whole
    assert whole["candidate"] != made["candidate"]
    own, other = (
        {
            each["name"]: abs(each["after"] - alone[each["name"]]["value"])
            / alone[each["name"]]["standard_error"]
            for each in one["parameters"]
        }
        for one in (made, whole)
    )
    assert own.keys() == alone.keys()
    assert max(own.values()) < 0.2, own  # of a standard error, which air that nobody measures makes
    assert max(other.values()) > 4.0 * max(own.values())


def test_a_closed_loop_of_two_halves_has_the_errors_of_the_whole(flown: Path) -> None:
    """The mean square over a flight is that over its first half and that over the other."""
    words = ("close-loop", "--vehicle", "quad", "--baseline", "v0001", "--flights", "quad.ulg")
    early, late, whole = (
        asked(flown / "workspace", *words, *select)
        for select in (("--select", "time < 15 s"), ("--select", "time >= 15 s"), ())
    )
    assert (early["select"], late["select"]) == (["time < 15 s"], ["time >= 15 s"])
    for axis in ("CZ", "Cl", "Cm"):
        first, second, all_ = (each["axes"][axis]["rms_before"] for each in (early, late, whole))
        assert all_**2 == pytest.approx((first**2 + second**2) / 2.0, rel=0.03)
    done = aerodb(flown / "workspace", *words, "--select", "time < 15 s", "-v")
    assert "time < 15 s counted" in done.stdout


def test_a_weak_rotor_is_named_when_its_flight_is_ingested(flown: Path) -> None:
    write_px4(flown / "weak.ulg", fly([21], 30.0, strength=(1.0, 1.0, 0.92, 1.0)))
    done = aerodb(
        flown / "workspace", "flight", "ingest", "weak.ulg", "--vehicle", "quad", folder=flown
    )
    assert done.returncode == 0, done.stderr
    assert "the thrust of rotor_3 is" in done.stdout


def test_the_flight_is_good_and_its_report_is_written(flown: Path) -> None:
    shown = asked(flown / "workspace", "flight", "show", "quad.ulg")
    assert shown["verdict"] == "good"
    beside = asked(flown / "workspace", "flight", "compare", "quad.ulg", "released")
    assert {axis: each["of_flown"] < 0.5 for axis, each in beside["axes"].items()} == {
        "CX": False,
        "CY": False,
        "CZ": True,
        "Cl": True,
        "Cm": True,
        "Cn": True,
    }  # its drag is not known yet
    done = aerodb(
        flown / "workspace", "report", "flight", "quad.ulg", "--output", "page.html", folder=flown
    )
    assert done.returncode == 0, done.stderr
    assert "command_4" in (flown / "page.html").read_text()


def test_inspection_says_what_is_learnt_and_what_is_not_told_apart(flown: Path) -> None:
    found = asked(flown / "workspace", "log", "inspect", str(flown / "quad.ulg"))
    assert (found["usable"], found["airframe"]) == (True, "quadrotor")
    assert len(found["rotors"]["rotors"]) == 4
    assert "mass from thrust" in found["rotors"]["not_learnt"]
    assert "speed from thrust" in found["rotors"]["not_learnt"]
    assert not found["suspicions"]


def test_motors_that_never_turn_are_said(tmp_path: Path) -> None:
    flight = fly([12], 12.0)
    flight.commands[:, 2] = 0.0
    write_px4(tmp_path / "still.ulg", flight)
    done = aerodb(tmp_path / "w", "vehicle", "init", "quad", "--from", "still.ulg", folder=tmp_path)
    assert (done.returncode, "rotor 3" in done.stderr) == (3, True)


def _said_of_a_limited(flown: Path, log: str) -> str:
    """What `flight ingest` says of a log whose flight ends up limited."""
    words = ("flight", "ingest", log, "--vehicle", "quad", "-v")
    done = aerodb(flown / "workspace", *words, folder=flown)
    assert done.returncode == 0, done.stderr
    assert asked(flown / "workspace", "flight", "show", log)["verdict"] == "limited"
    return done.stdout


def test_a_motor_that_never_turned_limits_its_flight(flown: Path) -> None:
    flight = fly([22], 12.0)
    flight.commands[:, 2] = 0.0
    write_px4(flown / "dead.ulg", flight)
    said = _said_of_a_limited(flown, "dead.ulg")
    assert "rotor 3 never turns: command_3 (actuator_motors control[2])" in said
    (flown / "model.toml").write_text(MODEL)
    words = ("estimate", "--vehicle", "quad", "--model", str(flown / "model.toml"))
    of = [("--flights", "dead.ulg", "--flights", "quad.ulg"), ("--flights", "quad.ulg")]
    assert [asked(flown / "workspace", *words, *each)["limited"] for each in of] == [
        ["dead.ulg"], []
    ]  # fmt: skip
    said = aerodb(flown / "workspace", *words, *of[0]).stdout
    assert "dead.ulg: used, with reservations (why: aerodb flight show dead.ulg)" in said


def test_a_rotor_without_command_in_the_log_is_said(flown: Path) -> None:
    """A vehicle file whose rotor 2 is logged in a field that the log lacks."""
    text = (flown / "quad.toml").read_text().replace("control[1]", "control[30]")
    (flown / "other.toml").write_text(text.replace('name = "quad"', 'name = "other"'))
    write_px4(flown / "other.ulg", fly([24], 12.0))
    for words in (
        ("vehicle", "add", "other.toml"),
        ("database", "import", "quad-rotors.toml", "--vehicle", "other"),
        ("flight", "ingest", "other.ulg", "--vehicle", "other", "-v"),
    ):
        done = aerodb(flown / "workspace", *words, folder=flown)
        assert done.returncode == 0, done.stderr
    assert "rotor 2" in done.stdout
    assert "control[30]" in done.stdout


def test_the_order_of_another_frame_limits_its_flight(flown: Path) -> None:
    flight = fly([23], 20.0)
    flight.commands[:] = flight.commands[:, (3, 0, 1, 2)]
    write_px4(flown / "order.ulg", flight)
    assert "the rotors of the log are in another order" in _said_of_a_limited(flown, "order.ulg")


def test_pulses_beyond_what_the_log_states_are_said(tmp_path: Path) -> None:
    known = parameters(**{f"PWM_MAIN_MAX{k}": 1500.0 for k in range(1, 5)})
    write_px4(tmp_path / "over.ulg", fly([14], 12.0), known=known, pulses=(1100.0, 1900.0))
    words = ("vehicle", "init", "quad", "--from", "over.ulg")
    done = aerodb(tmp_path / "w", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "correct [rotors.4] range in quad.toml" in done.stdout
    shown = aerodb(tmp_path / "w", "log", "inspect", "over.ulg", folder=tmp_path).stdout
    (said,) = (line for line in shown.splitlines() if "out of range" in line)
    assert "actuator_outputs output[0] of rotor 1 reaches 1" in said
    assert "beyond 1100 to 1500, which the log's parameters state" in said
    sound = tmp_path / "sound.ulg"
    known = parameters(**{f"PWM_MAIN_MAX{k}": 1900.0 for k in range(1, 5)})
    write_px4(sound, fly([14], 12.0), known=known, pulses=(1100.0, 1900.0))
    assert asked(tmp_path / "w", "log", "inspect", str(sound))["rotors"]["beyond"] == []


def test_a_rotor_without_speed_is_refused(flown: Path) -> None:
    text = (flown / "quad-rotors.toml").read_text()
    (flown / "lame.toml").write_text(text.replace('speed = "command_3"', ""))
    words = ("database", "import", "lame.toml", "--vehicle", "quad")
    done = aerodb(flown / "workspace", *words, folder=flown)
    assert (done.returncode, "[parts.rotor_3]: a rotor without speed" in done.stderr) == (3, True)


def test_pulses_of_former_releases_are_commands_by_their_range(tmp_path: Path) -> None:
    known = parameters()
    for name in [name for name in known if name.startswith("CA_")]:
        del known[name]
    write_px4(
        tmp_path / "old.ulg", fly([13], 12.0), known={**known, "PWM_MIN": 1075, "PWM_MAX": 1950},
        pulses=(1075.0, 1950.0),
    )  # fmt: skip
    done = aerodb(tmp_path / "w", "vehicle", "init", "quad", "--from", "old.ulg", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    vehicle = parse_vehicle((tmp_path / "quad.toml").read_text())
    assert vehicle.rotors["4"].range == (1075.0, 1950.0)
    assert "those of a quad x: measure them" in (tmp_path / "quad-rotors.toml").read_text()
