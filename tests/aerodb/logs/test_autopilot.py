"""What a PX4 log says of its aircraft: PX4's own allocation of surfaces, kinds, and a vehicle file
that reads back; measured logs of a quadrotor and a VTOL."""

from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from aerodb.logs import draft_vehicle, read_autopilot
from aerodb.recording import Recording, Topic
from aerodb.vehicle import parse_vehicle, placeholders, vehicle_template

#: The standard plane of PX4 (airframe 2100): torques as its geometry has them by default.
PLANE = {
    "CA_AIRFRAME": 1,
    "MAV_TYPE": 1,
    "CA_SV_CS_COUNT": 4,
    **{f"CA_SV_CS{k}_TYPE": kind for k, kind in enumerate((1, 2, 3, 4))},
    "CA_SV_CS0_TRQ_R": -0.5,
    "CA_SV_CS1_TRQ_R": 0.5,
    "CA_SV_CS2_TRQ_P": 1.0,
    "CA_SV_CS3_TRQ_Y": 1.0,
    "FW_AIRSPD_MIN": 10.0,
    "FW_AIRSPD_TRIM": 15.0,
    "EKF2_IMU_POS_X": 0.05,
}
TIME = np.arange(0.0, 2.0, 0.02)


def log(known: dict[str, float], topic: str = "actuator_servos") -> Recording:
    fields = {f"control[{k}]": np.zeros(TIME.size) for k in range(8)}
    metadata: dict[str, Any] = {f"param:{name}": value for name, value in known.items()}
    topics = {topic: Topic(topic, TIME, fields)}
    return Recording("flight.ulg", "ulog", "0" * 64, 1, topics, metadata)


def test_surfaces_of_the_allocator_with_their_log_lines_and_signs():
    text = draft_vehicle("plane", log(PLANE), read_autopilot(log(PLANE)))
    vehicle = parse_vehicle(text, "plane.toml")
    assert list(vehicle.surfaces) == ["aileron_left", "aileron_right", "elevator", "rudder"]
    for k, surface in enumerate(vehicle.surfaces.values()):
        assert surface.log is not None
        assert (surface.log.topic, surface.log.field) == ("actuator_servos", f"control[{k}]")
        assert surface.scale == pytest.approx(-np.deg2rad(25.0))  # up and right in PX4
    assert vehicle.combinations["aileron"].kind == "asymmetric"
    for said in ("fixed wing", "trim 15", "imu at 0.05, 0, 0 m", "actuator_servos 50"):
        assert said in text


def test_a_reversed_torque_turns_the_sign_and_none_asks_for_a_check():
    text = draft_vehicle("p", log(PLANE), read_autopilot(log({**PLANE, "CA_SV_CS2_TRQ_P": -1.0})))
    assert parse_vehicle(text, "p").surfaces["elevator"].scale > 0
    silent = read_autopilot(log({**PLANE, "CA_SV_CS3_TRQ_Y": 0.0}))
    assert "check it" in draft_vehicle("p", log(PLANE), silent)


def test_pairs_of_a_flying_wing_and_a_vtail_become_combinations():
    kinds = {"CA_SV_CS_COUNT": 4, "CA_SV_CS0_TYPE": 5, "CA_SV_CS1_TYPE": 6}
    known = {**kinds, "CA_SV_CS2_TYPE": 7, "CA_SV_CS3_TYPE": 8, "MAV_TYPE": 1}
    combinations = {row[0] for row in read_autopilot(log(known)).combinations}
    assert combinations == {"elevator", "aileron", "rudder"}
    assert parse_vehicle(draft_vehicle("w", log(known), read_autopilot(log(known))), "w")


@pytest.mark.parametrize(
    ("known", "kind", "has_wing"),
    [
        ({"CA_AIRFRAME": 0, "MAV_TYPE": 13}, "hexarotor", False),
        ({"CA_AIRFRAME": 0, "MAV_TYPE": 1}, "fixed wing", True),  # allocation never set
        ({"CA_AIRFRAME": 4, "MAV_TYPE": 20}, "tailsitter VTOL", True),
        ({}, "", True),
    ],
)
def test_kinds(known, kind, has_wing):
    found = read_autopilot(log(known))
    assert (found.kind, found.has_wing) == (kind, has_wing)


@pytest.mark.parametrize(
    ("name", "kind", "surfaces"),
    [
        ("sample", "quadrotor", None),
        ("sample_log_small", "VTOL", ("aileron", "elevator", "rudder")),
    ],
)
def test_measured_logs(measured, name, kind, surfaces):
    path = measured(f"px4_ulog/{name}.ulg")
    read = ULog(str(path))
    topics = {
        each.name: Topic(
            each.name,
            each.data["timestamp"] / 1e6,
            {key: value for key, value in each.data.items() if key != "timestamp"},
        )
        for each in read.data_list
        if each.multi_id == 0
    }
    metadata = {f"param:{key}": value for key, value in read.initial_parameters.items()}
    recording = Recording(str(path), "ulog", "0" * 64, 1, topics, metadata)
    found = read_autopilot(recording)
    assert (found.kind, found.has_wing) == (kind, surfaces is not None)
    if surfaces:
        vehicle = parse_vehicle(draft_vehicle("v", recording, found), "v")
        assert tuple(vehicle.surfaces) == surfaces
        assert vehicle.surfaces["aileron"].log.topic == "actuator_controls_1"


def test_placeholders_are_named_until_they_are_filled_in():
    text = vehicle_template("v")
    assert len(placeholders(parse_vehicle(text, "v"))) == 3
    filled = text.replace('"1.0 m^2"', '"0.6 m^2"').replace("Ixx = 0.4", "Ixx = 0.41")
    assert placeholders(parse_vehicle(filled, "v")) == ("mass = 5 kg",)
    assert placeholders(parse_vehicle(filled.replace("5.0 kg", "3.6 kg"), "v")) == ()


def ardupilot(firmware: str, **parameters: float) -> Recording:
    known = {f"param:{name}": value for name, value in parameters.items()}
    return Recording(
        "a.bin", "dataflash", "0" * 64, 1, {}, {**known, "sys_name": firmware, "ver_sw": firmware}
    )


def test_ardupilot_names_its_kind_surfaces_airspeeds_and_positions() -> None:
    servos = {"SERVO1_FUNCTION": 77.0, "SERVO2_FUNCTION": 78.0, "SERVO4_FUNCTION": 21.0}
    speeds = {"AIRSPEED_CRUISE": 16.0, "TRIM_ARSPD_CM": 1200.0, "ARSPD_FBW_MIN": 9.0}
    found = read_autopilot(ardupilot("ArduPlane", **servos, **speeds, INS_POS1_X=0.1))
    assert found.kind == "fixed wing"
    assert [(s.name, s.sign, s.stated) for s in found.surfaces] == [
        ("aileron", -1, True),
        ("elevator", -1, True),
        ("rudder", -1, True),
    ]
    assert found.airspeeds == {"MIN": 9.0, "TRIM": 16.0}
    assert found.points == {"imu": (0.1, 0.0, 0.0)}
    text = draft_vehicle("plane", ardupilot("ArduPlane", **servos, **speeds), found)
    assert set(parse_vehicle(text).surfaces) == {"aileron", "elevator", "rudder"}
    assert not read_autopilot(ardupilot("ArduCopter")).has_wing
    assert read_autopilot(ardupilot("")).surfaces == ()
