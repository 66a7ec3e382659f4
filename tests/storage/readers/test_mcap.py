"""MCAP with ROS 2 messages: round trip with mcap's own writer, by name and time; damage costs only
the affected records."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter
from mcap_ros2.writer import Writer

from aerodb.errors import InputError
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.mcap import read_mcap
from aerodb.storage.readers.mcap_framing import McapRecord, walk
from aerodb.vehicle import parse_vehicle
from tests.support.command import asked

START = 1_700_000_000 * 10**9
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
SEPARATOR = "\n" + "=" * 80 + "\n"
NESTED = (
    f"{SEPARATOR}MSG: std_msgs/Header\n{HEADER}"
    f"{SEPARATOR}MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    f"{SEPARATOR}MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
)
IMU = (
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9]"
    " orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3"
    " linear_acceleration\n" + NESTED
)
JOINTS = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[]"
    " effort\n" + NESTED
)
FLOAT = "float64 data\n"
VEHICLE = """
name = "wing"
[reference]
area = 1.0
chord = 0.3
span = 3.0
[points]
moment_reference = "cg"
[mass]
mass = 5.0
cg = [0, 0, 0]
Ixx = 1
Iyy = 1
Izz = 1
Ixz = 0
[surfaces.elevator]
limits = [-0.5, 0.5]
"""


def header(ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "base_link"}


def write_flight(
    path: Path,
    samples: int = 400,
    chunk: int = 8192,
    compression: CompressionType = CompressionType.ZSTD,
) -> None:
    """An IMU at 100 Hz that rests level and points east, an elevator joint and an airspeed; stamps
    5 ms before log times."""
    level_east = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=chunk, compression=compression)
        imu = writer.register_msgdef("sensor_msgs/msg/Imu", IMU)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        number = writer.register_msgdef("std_msgs/msg/Float64", FLOAT)
        for k in range(samples):
            ns = START + k * 10_000_000
            message = {
                "header": header(ns - 5_000_000),
                "orientation": level_east,
                "orientation_covariance": [float(i) for i in range(9)],
                "angular_velocity": {"x": 0.1, "y": 0.2, "z": 0.001 * k},
                "linear_acceleration": {"x": 0.5, "y": 0.25, "z": 9.81},
            }
            writer.write_message("/imu/data", imu, message, log_time=ns)
            if k % 5 == 0:
                joint = {
                    "header": header(ns),
                    "name": ["rotor", "elevator"],
                    "position": [9.0, 0.01 * k],
                    "velocity": [],
                    "effort": [],
                }
                writer.write_message("/joint_states", joints, joint, log_time=ns)
                writer.write_message("/airspeed/true", number, {"data": 30.0 + k}, log_time=ns)
        writer.finish()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    write_flight(tmp_path / "flight.mcap")
    return tmp_path / "flight.mcap"


@pytest.mark.parametrize("compression", list(CompressionType))
def test_what_was_written_is_read(tmp_path: Path, compression: CompressionType) -> None:
    write_flight(tmp_path / "a.mcap", compression=compression)
    recording = read_log(tmp_path / "a.mcap")
    assert recording.damage == ()
    assert (recording.format, recording.layout) == ("mcap", "ros2")
    imu, joints = recording.topics["/imu/data"], recording.topics["/joint_states"]
    np.testing.assert_allclose(imu.time, np.arange(400) * 0.01 - 0.005, atol=1e-9)
    np.testing.assert_array_equal(imu.fields["angular_velocity.z"], 0.001 * np.arange(400))
    np.testing.assert_array_equal(imu.fields["orientation_covariance[8]"], np.full(400, 8.0))
    np.testing.assert_array_equal(joints.fields["position.elevator"], 0.01 * np.arange(0, 400, 5))
    np.testing.assert_allclose(
        recording.topics["/airspeed/true"].time, np.arange(0, 4, 0.05), atol=1e-9
    )
    assert recording.start_utc is not None
    assert recording.start_utc.timestamp() == START * 1e-9


def test_ros2_mapping_turns_rep_103_into_flight_axes(log: Path) -> None:
    recording = read_log(log)
    mapping = choose_mapping(recording, builtin_mappings().values())
    flight = map_recording(recording, mapping, parse_vehicle(VEHICLE))
    assert mapping.name == "ros2"
    expected = {
        "p": 0.1,
        "q": -0.2,
        "ax_imu": 0.5,
        "ay_imu": -0.25,
        "az_imu": -9.81,
        "phi": 0.0,
        "theta": 0.0,
        "psi": np.pi / 2,
    }
    for name, value in expected.items():
        np.testing.assert_allclose(flight[name], value, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(flight["r"], -0.001 * np.arange(len(flight.time)), atol=1e-9)
    assert "V" in flight
    assert "delta_elevator" in flight


def test_cut_file_keeps_what_is_before_the_cut(log: Path) -> None:
    data, whole = log.read_bytes(), read_mcap(log)
    read = []
    for cut in (len(data) // 4, len(data) // 2, 3 * len(data) // 4, len(data) - 3):
        log.write_bytes(data[:cut])
        recording = read_mcap(log)
        (tail,) = [d for d in recording.damage if d.kind == "lost_tail"]
        assert tail.bytes_lost <= cut
        n = len(recording.topics["/imu/data"].time)
        np.testing.assert_array_equal(
            recording.topics["/imu/data"].time, whole.topics["/imu/data"].time[:n]
        )
        read.append(n)
    assert read == sorted(read)
    assert read[0] > 0
    assert read[-1] == 400


def test_flipped_bit_in_a_chunk_costs_that_chunk_and_is_located(log: Path) -> None:
    """The chunk's checksum tells; the messages of the other chunks are kept, the missing ones are
    counted by topic."""
    data, whole = bytearray(log.read_bytes()), read_mcap(log)
    data[len(data) // 3] ^= 0x10
    log.write_bytes(data)
    recording = read_mcap(log)
    (chunk,) = [d for d in recording.damage if not d.topic]
    assert (chunk.kind, chunk.bytes_lost > 0) == ("framing", True)
    n = len(whole.topics["/imu/data"].time) - len(recording.topics["/imu/data"].time)
    assert 0 < n < 200
    (imu,) = [d for d in recording.damage if d.topic == "/imu/data"]
    assert f"about {n} samples missing" in imu.what


def test_checksum_over_the_data_tells_of_bytes_outside_chunks(tmp_path: Path) -> None:
    """Messages without chunks have no checksum of their own; the one over all data says that
    something differs."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as out:
        writer = PlainWriter(out, use_chunking=False, enable_data_crcs=True)
        writer.start(profile="ros2", library="")
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", FLOAT.encode())
        channel = writer.register_channel("/v", "cdr", schema)
        for k in range(3):
            writer.add_message(
                channel, k * 10**9, bytes([0, 1, 0, 0]) + np.float64(k + 0.5).tobytes(), k * 10**9
            )
        writer.finish()
    assert read_mcap(path).damage == ()
    data = bytearray(path.read_bytes())
    data[data.index(np.float64(1.5).tobytes())] ^= 1
    path.write_bytes(data)
    assert [(d.kind, d.topic) for d in read_mcap(path).damage] == [("values", "")]


def test_overwritten_block_across_chunks(log: Path) -> None:
    data = bytearray(log.read_bytes())
    third = len(data) // 3
    data[third : third + 400] = bytes(400)
    log.write_bytes(data)
    recording = read_mcap(log)
    assert any(d.kind == "framing" for d in recording.damage)
    time = recording.topics["/imu/data"].time
    assert time[0] < 0.1
    assert time[-1] > 3.9


def test_other_encodings_are_named_by_topic(tmp_path: Path) -> None:
    path = tmp_path / "mixed.mcap"
    with path.open("wb") as out:
        writer = PlainWriter(out)
        writer.start(profile="", library="")
        number = writer.register_schema("std_msgs/msg/Float64", "ros2msg", FLOAT.encode())
        text = writer.register_schema("thing", "flatbuffer", b"{}")
        good = writer.register_channel("/v", "cdr", number)
        other = writer.register_channel("/j", "flatbuffer", text)
        broken = writer.register_channel(
            "/b", "cdr", writer.register_schema("pkg/msg/Bad", "ros2msg", b"Missing thing\n")
        )
        for k in range(3):
            cdr = bytes([0, 1, 0, 0]) + np.float64(k).tobytes()
            writer.add_message(good, k * 10**9, cdr, k * 10**9)
            writer.add_message(other, k * 10**9, b"{}", k * 10**9)
            writer.add_message(broken, k * 10**9, cdr, k * 10**9)
        writer.finish()
    recording = read_mcap(path)
    np.testing.assert_array_equal(recording.topics["/v"].fields["data"], [0.0, 1.0, 2.0])
    assert {(d.kind, d.topic) for d in recording.damage} == {("values", "/j"), ("values", "/b")}
    assert all(d.what.startswith("3 messages") for d in recording.damage)


def test_stamps_of_another_clock_give_way_to_log_times(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        for k in range(5):
            message = {
                "header": header(k * 10**9 + 1),
                "name": ["a"],
                "position": [1.0],
                "velocity": [],
                "effort": [],
            }
            writer.write_message("/joints", schema, message, log_time=START + k * 10**9)
        writer.finish()
    recording = read_mcap(path)
    np.testing.assert_allclose(recording.topics["/joints"].time, np.arange(5.0))
    assert [d.kind for d in recording.damage] == ["time"]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "empty"),
        (b"\x89MCAP0\r\n", "no message can be read"),
        (
            b"\x89MCAP0\r\n" + b"\x06" + (2**62).to_bytes(8, "little") + bytes(100),
            "no message can be read",
        ),
        (b"ROSBAG V2.0", "not an MCAP file"),
    ],
)
def test_refused(tmp_path: Path, content: bytes, what: str) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=what) as refusal:
        read_log(path)
    assert str(path) in str(refusal.value)
    assert refusal.value.remedy


def test_a_chunk_that_hides_as_a_private_record_is_missed(tmp_path: Path) -> None:
    """Readers must pass over record types from 128 on: a flipped bit made a whole chunk one of
    these, without a word."""
    path = tmp_path / "a.mcap"
    write_flight(path, samples=60, chunk=2048)
    data = bytearray(path.read_bytes())
    with path.open("rb") as handle:
        chunks = [
            r
            for r in walk(handle, len(data))
            if isinstance(r, McapRecord) and r.opcode == Opcode.CHUNK
        ]
    data[chunks[-1].start] |= 0x80
    path.write_bytes(data)
    (damage,) = read_log(path).damage
    assert "statistics count" in damage.what


def write_bridged(path: Path, prefix: str, stamped: bool = True) -> None:
    """px4_msgs as the bridge to ROS 2 writes them: 100 Hz on PX4's clock, delivered in pairs."""
    rates = "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\nfloat32[3] xyz_derivative\n"
    airspeed = "uint64 timestamp\nfloat32 true_airspeed_m_s\n"
    with path.open("wb") as out:
        writer = Writer(out)
        fast = writer.register_msgdef("px4_msgs/msg/VehicleAngularVelocity", rates)
        slow = writer.register_msgdef("px4_msgs/msg/AirspeedValidated", airspeed)
        for k in range(200):
            stamp = 50_000_000 + 10_000 * k if stamped else 0
            message = {
                "timestamp": stamp,
                "timestamp_sample": stamp,
                "xyz": [0.1, 0.2, 0.001 * k],
                "xyz_derivative": [0.0, 0.0, 0.0],
            }
            at = START + (k // 2) * 20_000_000
            writer.write_message(f"{prefix}vehicle_angular_velocity", fast, message, log_time=at)
            if k % 10 == 0:
                speed = {"timestamp": stamp, "true_airspeed_m_s": 20.0 + k}
                writer.write_message(f"{prefix}airspeed_validated_v1", slow, speed, log_time=at)
        writer.finish()


@pytest.mark.parametrize("prefix", ["/fmu/out/", "/uav1/fmu/out/", "/px4_1/fmu/out/", "/px4/"])
def test_messages_of_px4_are_its_topics_under_any_prefix(tmp_path: Path, prefix: str) -> None:
    write_bridged(tmp_path / "a.mcap", prefix)
    recording = read_mcap(tmp_path / "a.mcap")
    assert recording.layout == "px4"
    assert set(recording.topics) == {"vehicle_angular_velocity", "airspeed_validated"}
    topic = recording.topics["vehicle_angular_velocity"]
    np.testing.assert_allclose(topic.time, np.arange(200) * 0.01, atol=1e-9)
    mapping = choose_mapping(recording, builtin_mappings().values())
    flight = map_recording(recording, mapping, parse_vehicle(VEHICLE))
    np.testing.assert_allclose(flight["p"], 0.1, rtol=1e-6)
    np.testing.assert_allclose(flight["q"], 0.2, rtol=1e-6)  # no turned axes, as in REP 103
    assert flight["V"][0] == pytest.approx(20.0, abs=0.5)


def test_the_draft_of_a_log_that_its_reader_knows_is_the_built_in_mapping(tmp_path: Path) -> None:
    write_bridged(tmp_path / "a.mcap", "/fmu/out/")
    output = str(tmp_path / "m.toml")
    said = asked(tmp_path, "mapping", "init", str(tmp_path / "a.mcap"), "--output", output)
    found = {guess["channel"]: guess["field"] for guess in said["guesses"]}
    assert found["q"] == "xyz[1]"
    assert {guess["confidence"] for guess in said["guesses"]} == {"sure"}


def test_messages_of_px4_without_stamps_keep_the_time_of_the_recorder(tmp_path: Path) -> None:
    write_bridged(tmp_path / "a.mcap", "/fmu/out/", stamped=False)
    topic = read_mcap(tmp_path / "a.mcap").topics["vehicle_angular_velocity"]
    np.testing.assert_allclose(topic.time, (np.arange(200) // 2) * 0.02, atol=1e-9)


def test_what_another_program_wrote_is_to_be_converted(tmp_path: Path) -> None:
    path = tmp_path / "ros1.mcap"
    with path.open("wb") as out:
        writer = PlainWriter(out)
        writer.start(profile="ros1", library="")
        schema = writer.register_schema("std_msgs/Float64", "ros1msg", FLOAT.encode())
        channel = writer.register_channel("/v", "ros1", schema)
        writer.add_message(channel, 10**9, np.float64(1).tobytes(), 10**9)
        writer.finish()
    with pytest.raises(InputError) as refusal:
        read_mcap(path)
    assert "rosbags-convert" in str(refusal.value.remedy)
    assert "recover" not in str(refusal.value.remedy)
