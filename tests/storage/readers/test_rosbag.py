"""Bags of ROS 1 and ROS 2: written byte by byte after the formats' descriptions and read back; cut,
damaged and hostile ones are read as far as they go, or refused."""

import bz2
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from mcap_ros2._dynamic import serialize_dynamic

from aerodb.errors import InputError
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.ros_types import definition_of
from aerodb.vehicle import parse_vehicle
from tests.storage.readers.test_mcap import START, VEHICLE, header
from tests.support.command import aerodb

SEPARATOR = "=" * 80
HEADER_1 = "uint32 seq\ntime stamp\nstring frame_id\n"
IMU_1 = f"""# An inertial measurement unit
uint8 UNUSED=3
Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
{SEPARATOR}
MSG: std_msgs/Header
{HEADER_1}{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
JOINTS_1 = f"""std_msgs/Header header
string[] name
float64[] position
{SEPARATOR}
MSG: std_msgs/Header
{HEADER_1}"""
RATES = 0.001 * np.arange(300)


def prefixed(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def record(data: bytes, **fields: bytes) -> bytes:
    head = b"".join(prefixed(name.encode() + b"=" + value) for name, value in fields.items())
    return prefixed(head) + prefixed(data)


def stamp(ns: int) -> bytes:
    return struct.pack("<II", ns // 10**9, ns % 10**9)


def imu_1(k: int, ns: int) -> bytes:
    values = [0.0, 0.0, 0.0, 1.0, *[0.0] * 9, 0.1, 0.2, RATES[k], *[0.0] * 9, 0.5, 0.25, 9.81]
    head = struct.pack("<I", k) + stamp(ns) + prefixed(b"base_link")
    return head + struct.pack("<37d", *values, *[0.0] * 9)


def joints_1(k: int, ns: int) -> bytes:
    names = struct.pack("<I", 2) + prefixed(b"rotor") + prefixed(b"elevator")
    angles = struct.pack("<I2d", 2, 9.0, 0.01 * k)
    return struct.pack("<I", k) + stamp(ns) + prefixed(b"") + names + angles


TOPICS = (
    ("/imu/data", "sensor_msgs/Imu", IMU_1),
    ("/joint_states", "sensor_msgs/JointState", JOINTS_1),
    ("/airspeed/true", "std_msgs/Float64", "float64 data"),
)


def connection(number: int) -> bytes:
    topic, kind, text = TOPICS[number]
    defined = {"type": kind, "md5sum": "0" * 32, "message_definition": text}
    data = b"".join(prefixed(f"{name}={value}".encode()) for name, value in defined.items())
    return record(data, op=b"\x07", conn=struct.pack("<I", number), topic=topic.encode())


PACKED: dict[str, Callable[[bytes], bytes]] = {
    "none": lambda data: data,
    "bz2": bz2.compress,
    "lz4": lz4.frame.compress,
}


def bag_1(compression: str = "none", samples: int = 300, chunk: int = 50) -> bytes:
    """A bag of ROS 1: an IMU at 100 Hz, an elevator joint and an airspeed, in chunks."""
    parts, infos = [b"#ROSBAG V2.0\n", record(b" " * 40, op=b"\x03")], []
    for first in range(0, samples, chunk):
        inner, counts = [connection(n) for n in range(3)], [0, 0, 0]
        for k in range(first, min(first + chunk, samples)):
            ns = START + k * 10_000_000
            bodies = [(0, imu_1(k, ns - 5_000_000))]
            if k % 5 == 0:
                bodies += [(1, joints_1(k, ns)), (2, struct.pack("<d", 30.0 + k))]
            for number, body in bodies:
                at = {"conn": struct.pack("<I", number), "time": stamp(ns)}
                inner.append(record(body, op=b"\x02", **at))
                counts[number] += 1
        data = b"".join(inner)
        packed = {"compression": compression.encode(), "size": struct.pack("<I", len(data))}
        parts.append(record(PACKED[compression](data), op=b"\x05", **packed))
        told = b"".join(struct.pack("<II", number, n) for number, n in enumerate(counts))
        infos.append(record(told, op=b"\x06", ver=struct.pack("<I", 1)))
    return b"".join([*parts, *infos])


def encoded(kind: str, message: dict) -> bytes:
    text = definition_of(kind)
    assert text is not None
    return serialize_dynamic(kind, text)[kind](message)


def bag_2(path: Path, defines: bool = False, samples: int = 300) -> bytes:
    """A bag of ROS 2 in SQLite: the same flight; with or without definitions of its types."""
    kinds = {topic: kind.replace("/", "/msg/") for topic, kind, _ in TOPICS}
    with closing(sqlite3.connect(path)) as bag:
        bag.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT,"
                    " serialization_format TEXT, offered_qos_profiles TEXT)")  # fmt: skip
        bag.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER,"
                    " timestamp INTEGER, data BLOB)")  # fmt: skip
        if defines:
            bag.execute("CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT,"
                        " encoding TEXT, encoded_message_definition TEXT,"
                        " type_description_hash TEXT)")  # fmt: skip
            bag.executemany(
                "INSERT INTO message_definitions VALUES (NULL, ?, 'ros2msg', ?, '')",
                [(kind, definition_of(kind)) for kind in kinds.values()],
            )
        bag.executemany(
            "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')",
            [(k, topic, kind) for k, (topic, kind) in enumerate(kinds.items())],
        )
        rows = []
        for k in range(samples):
            ns = START + k * 10_000_000
            imu = {
                "header": header(ns - 5_000_000),
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                "angular_velocity": {"x": 0.1, "y": 0.2, "z": RATES[k]},
                "linear_acceleration": {"x": 0.5, "y": 0.25, "z": 9.81},
            }
            rows.append((0, ns, encoded("sensor_msgs/msg/Imu", imu)))
            if k % 5 == 0:
                joints = {"header": header(ns), "name": ["rotor", "elevator"]}
                joints |= {"position": [9.0, 0.01 * k], "velocity": [], "effort": []}
                rows.append((1, ns, encoded("sensor_msgs/msg/JointState", joints)))
                rows.append((2, ns, encoded("std_msgs/msg/Float64", {"data": 30.0 + k})))
        bag.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", rows)
        bag.commit()
    return path.read_bytes()


@pytest.fixture(params=["none", "bz2", "lz4", "db3", "db3 with definitions"])
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> Recording:
    if "db3" in request.param:
        bag_2(tmp_path / "flight_0.db3", "definitions" in request.param)
        return read_log(tmp_path / "flight_0.db3")
    (tmp_path / "flight.bag").write_bytes(bag_1(request.param))
    return read_log(tmp_path / "flight.bag")


def test_what_was_written_is_read(recording: Recording) -> None:
    assert (recording.format, recording.layout, recording.damage) == ("rosbag", "ros2", ())
    imu = recording.topics["/imu/data"]
    np.testing.assert_array_equal(imu.fields["angular_velocity.z"], RATES)
    np.testing.assert_array_equal(imu.fields["linear_acceleration.z"], np.full(300, 9.81))
    np.testing.assert_allclose(imu.time, 0.01 * np.arange(300) - 0.005, atol=1e-9)
    joints = recording.topics["/joint_states"]
    np.testing.assert_allclose(joints.fields["position.elevator"], 0.05 * np.arange(60))
    speed = recording.topics["/airspeed/true"].fields["data"]
    np.testing.assert_array_equal(speed, 30.0 + 5.0 * np.arange(60))
    assert recording.start_utc is not None
    assert recording.start_utc.timestamp() == START / 1e9


def test_a_bag_is_mapped_as_a_log_of_ros(recording: Recording) -> None:
    mapping = choose_mapping(recording, builtin_mappings().values())
    assert mapping.name == "ros2"
    flight = map_recording(recording, mapping, parse_vehicle(VEHICLE), "f")
    np.testing.assert_allclose(flight["az_imu"], -9.81)
    np.testing.assert_allclose(flight["q"], -0.2)


def test_a_bag_by_command(tmp_path: Path) -> None:
    (tmp_path / "flight.bag").write_bytes(bag_1("lz4"))
    done = aerodb(tmp_path / "w", "log", "inspect", str(tmp_path / "flight.bag"))
    assert "rosbag" in done.stdout.splitlines()[0]


def test_a_bag_that_was_cut_keeps_what_came_before(tmp_path: Path) -> None:
    data = bag_1()
    (tmp_path / "a.bag").write_bytes(data[: len(data) // 2])
    recording = read_log(tmp_path / "a.bag")
    kept = len(recording.topics["/imu/data"].time)
    assert 100 <= kept <= 150
    assert {damage.kind for damage in recording.damage} == {"lost_tail"}


def test_a_damaged_chunk_costs_its_messages(tmp_path: Path) -> None:
    data = bytearray(bag_1("bz2"))
    at = data.find(b"BZh", len(data) // 2)
    data[at + 40] ^= 0xFF
    (tmp_path / "a.bag").write_bytes(data)
    recording = read_log(tmp_path / "a.bag")
    assert len(recording.topics["/imu/data"].time) == 250
    assert any(damage.bytes_lost > 0 for damage in recording.damage)


def test_a_message_that_is_missing_is_counted(tmp_path: Path) -> None:
    """The chunks say how many there are; one whose kind was flipped is passed over."""
    data = bag_1()
    at = data.index(b"op=\x02")
    (tmp_path / "a.bag").write_bytes(data[: at + 3] + b"\x12" + data[at + 4 :])
    (said,) = [d.what for d in read_log(tmp_path / "a.bag").damage if not d.topic]
    assert said == "419 messages are present, but the chunks of the bag count 420"


def test_a_type_that_the_bag_does_not_define_is_said(tmp_path: Path) -> None:
    bag_2(tmp_path / "a.db3")
    with closing(sqlite3.connect(tmp_path / "a.db3")) as bag:
        bag.execute("UPDATE topics SET type = 'own_msgs/msg/Vane' WHERE name = '/airspeed/true'")
        bag.commit()
    recording = read_log(tmp_path / "a.db3")
    assert "/airspeed/true" not in recording.topics
    (damage,) = recording.damage
    assert (
        damage.what == "60 messages not read: the bag does not define their type own_msgs/msg/Vane"
    )


def test_another_database_is_no_bag(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "a.db3")) as other:
        other.execute("CREATE TABLE flights(id INTEGER)")
        other.commit()
    with pytest.raises(InputError, match="no bag of ROS 2"):
        read_log(tmp_path / "a.db3")


def hostile() -> Iterator[tuple[str, str]]:
    yield "itself", f"own/A a\n{SEPARATOR}\nMSG: own/A\nown/A a"
    yield "not defined", "own/B b"
    yield "a private name", "float64 __class__"
    yield "a name twice", "float64 a\nfloat64 a"
    yield "no definition", "<html>"
    yield "endless", "own/E[] e\n" + f"{SEPARATOR}\nMSG: own/E\n"
    yield "huge", "float64[999999999999] a"


@pytest.mark.parametrize(("name", "text"), list(hostile()), ids=[name for name, _ in hostile()])
def test_hostile_definitions_cost_their_topic(tmp_path: Path, name: str, text: str) -> None:
    data = b"".join(prefixed(f"{k}={v}".encode()) for k, v in
                    {"type": "own/T", "message_definition": text}.items())  # fmt: skip
    own = record(data, op=b"\x07", conn=struct.pack("<I", 9), topic=b"/own")
    at = {"conn": struct.pack("<I", 9), "time": stamp(START)}
    (tmp_path / "a.bag").write_bytes(bag_1() + own + record(b"\xff" * 64, op=b"\x02", **at))
    recording = read_log(tmp_path / "a.bag")
    assert len(recording.topics["/imu/data"].time) == 300
    assert "/own" not in recording.topics
    assert [d.topic for d in recording.damage] == ["/own"]
