"""MCAP with JSON and protobuf messages: bit-exact round trip."""

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from google.protobuf.timestamp_pb2 import DESCRIPTOR as TIMESTAMP_FILE
from mcap.writer import CompressionType, Writer

from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import parse_vehicle
from tests.storage.readers.test_mcap import START, VEHICLE, write_flight

Messages = Sequence[bytes]
STEP = 10_000_000
F = FieldDescriptorProto


def write(
    path: Path,
    *channels: tuple[str, str, tuple[str, str, bytes] | None, Messages],
    plain: bool = False,
) -> Path:
    """Channels (topic, message encoding, schema (name, encoding, data), messages), 100 messages a
    second, with mcap's own writer; `plain`: without chunks and checksums, so that decoders meet
    every damage."""
    kind = (
        {"use_chunking": False, "enable_data_crcs": False, "compression": CompressionType.NONE}
        if plain
        else {}
    )
    with path.open("wb") as out:
        writer = Writer(out, **kind)
        writer.start(profile="", library="")
        for topic, encoding, schema, messages in channels:
            number = writer.register_schema(*schema) if schema is not None else 0
            channel = writer.register_channel(topic, encoding, number)
            for k, message in enumerate(messages):
                writer.add_message(channel, START + k * STEP, message, START + k * STEP)
        writer.finish()
    return path


def field(
    name: str, number: int, kind: int = F.TYPE_DOUBLE, many: bool = False, type_name: str = ""
) -> FieldDescriptorProto:
    label = F.LABEL_REPEATED if many else F.LABEL_OPTIONAL
    return F(name=name, number=number, type=kind, label=label, type_name=type_name or None)  # type: ignore[arg-type]


def message_type(name: str, *fields: FieldDescriptorProto) -> DescriptorProto:
    return DescriptorProto(name=name, field=fields)


def flight_files() -> FileDescriptorSet:
    """sensor_msgs/Imu in protobuf, in three files, each before what it imports; and every kind of
    field."""
    vector = message_type("Vector", *(field(name, k) for k, name in enumerate("xyzw", 1)))
    stamp = message_type("Time", field("sec", 1, F.TYPE_INT32), field("nanosec", 2, F.TYPE_UINT32))
    header = message_type(
        "Header",
        field("stamp", 1, F.TYPE_MESSAGE, type_name=".t.Time"),
        field("frame_id", 2, F.TYPE_STRING),
    )
    basics = FileDescriptorProto(
        name="basics.proto", package="t", syntax="proto3", message_type=[vector, stamp, header]
    )
    nested = [
        field(name, k, F.TYPE_MESSAGE, type_name=".t.Vector")
        for k, name in enumerate(("angular_velocity", "orientation"), 2)
    ]
    imu = message_type(
        "Imu", field("header", 1, F.TYPE_MESSAGE, type_name=".t.Header"), *nested,
        field("linear_acceleration", 4, F.TYPE_MESSAGE, type_name=".t.Vector"), field("orientation_covariance", 5, many=True),
    )  # fmt: skip
    kinds = [
        "double",
        "float",
        "int32",
        "int64",
        "uint32",
        "uint64",
        "sint32",
        "sint64",
        "fixed32",
        "fixed64",
        "sfixed32",
    ]
    kinds += ["sfixed64", "bool", "bytes", "string"]
    scalars = [
        field(name, k, getattr(F, f"TYPE_{name.upper()}")) for k, name in enumerate(kinds, 1)
    ]
    state = field("state", 20, F.TYPE_ENUM, type_name=".t.Every.State")
    unset = field("unset", 21)
    unset.proto3_optional, unset.oneof_index = True, 0
    when = field("timestamp", 22, F.TYPE_MESSAGE, type_name=".google.protobuf.Timestamp")
    entry = message_type("GainEntry", field("key", 1, F.TYPE_STRING), field("value", 2))
    entry.options.map_entry = True
    gain = field("gain", 23, F.TYPE_MESSAGE, True, ".t.Every.GainEntry")
    varying, itself = (
        field("varying", 24, many=True),
        field("itself", 25, F.TYPE_MESSAGE, type_name=".t.Every"),
    )
    every = message_type("Every", *scalars, state, unset, when, gain, varying, itself)
    every.nested_type.append(entry)
    every.oneof_decl.add(name="_unset")
    states = every.enum_type.add(name="State")
    states.value.add(name="OFF", number=0)
    states.value.add(name="ON", number=7)
    top = FileDescriptorProto(
        name="top.proto", package="t", syntax="proto3", message_type=[imu, every]
    )
    top.dependency.extend(["basics.proto", "google/protobuf/timestamp.proto"])
    found = FileDescriptorSet(file=[top, basics])
    TIMESTAMP_FILE.CopyToProto(found.file.add())
    return found


FILES = flight_files()
DESCRIPTORS = FILES.SerializeToString()
EVERY = ("t.Every", "protobuf", DESCRIPTORS)


def made(name: str) -> type[Message]:
    pool = DescriptorPool()
    for file in (FILES.file[2], FILES.file[1], FILES.file[0]):
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


def as_json(*messages: Any) -> Messages:
    return [json.dumps(message).encode() for message in messages]


def one(path: Path, topic: str = "/v") -> dict[str, Any]:
    return dict(read_log(path).topics[topic].fields)


def imu_message(k: int) -> dict[str, Any]:
    """What `write_flight` writes as ROS 2."""
    ns = START + k * STEP - 5_000_000
    return {
        "header": {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "base_link"},
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": [float(i) for i in range(9)],
        "angular_velocity": {"x": 0.1, "y": 0.2, "z": 0.001 * k},
        "linear_acceleration": {"x": 0.5, "y": 0.25, "z": 9.81},
    }


@pytest.mark.parametrize("encoding", ["json", "protobuf"])
def test_the_same_flight_in_any_encoding_is_the_same_recording(
    tmp_path: Path, encoding: str
) -> None:
    """Against the ROS 2 file of the same flight, written and decoded by other code: fields, values,
    times, and what is mapped."""
    write_flight(tmp_path / "ros2.mcap", samples=100)
    expected = read_log(tmp_path / "ros2.mcap").topics["/imu/data"]
    if encoding == "json":
        schema, messages = (
            ("Imu", "jsonschema", b'{"type": "object"}'),
            as_json(*map(imu_message, range(100))),
        )
    else:
        schema, kind = ("t.Imu", "protobuf", DESCRIPTORS), made("t.Imu")
        messages = [kind(**imu_message(k)).SerializeToString() for k in range(100)]
    recording = read_log(write(tmp_path / "a.mcap", ("/imu/data", encoding, schema, messages)))
    topic = recording.topics["/imu/data"]
    assert recording.damage == ()
    np.testing.assert_array_equal(topic.time, expected.time)
    # The protobuf vector has a w everywhere; what was never set is its default.
    assert {
        name for name in topic.fields if not name.endswith(("velocity.w", "acceleration.w"))
    } == set(expected.fields)
    for name, values in expected.fields.items():
        assert topic.fields[name].tobytes() == values.tobytes()
    mapping = choose_mapping(recording, builtin_mappings().values())
    flight = map_recording(recording, mapping, parse_vehicle(VEHICLE))
    assert mapping.name == "ros2"
    np.testing.assert_allclose(flight["r"], -0.001 * np.arange(len(flight.time)), atol=1e-9)
    np.testing.assert_allclose(flight["az_imu"], -9.81)


def test_published_bytes_of_protobuf(tmp_path: Path) -> None:
    """Encoding guide of protobuf: field 1 as varint 150 is 08 96 01; zigzag 1 is -1; fixed64 is
    little-endian."""
    parts = [
        field("a", 1, F.TYPE_INT32),
        field("b", 2, F.TYPE_SINT64),
        field("c", 3),
        field("d", 4, F.TYPE_INT32, many=True),
    ]
    test = message_type("Test1", *parts)
    files = FileDescriptorSet(
        file=[FileDescriptorProto(name="x", syntax="proto3", message_type=[test])]
    )
    data = (
        bytes.fromhex("089601100119") + struct.pack("<d", 0.1) + bytes.fromhex("2206038e029ea705")
    )
    path = write(
        tmp_path / "a.mcap",
        ("/v", "protobuf", ("Test1", "protobuf", files.SerializeToString()), [data]),
    )
    found = {name: values.tolist() for name, values in one(path).items()}
    assert found == {"a": [150], "b": [-1], "c": [0.1], "d[0]": [3], "d[1]": [270], "d[2]": [86942]}


def test_every_protobuf_scalar_keeps_its_bits(tmp_path: Path) -> None:
    extremes = {
        "double": [5e-324, -0.0, float("nan"), float("inf")],
        "float": [float(np.float32(0.1)), -0.0, float("-inf"), float(np.float32(3.4e38))],
        "int32": [-(2**31), 2**31 - 1, 0, 1],
        "int64": [-(2**63), 2**63 - 1, 2**53 + 1, 0],
        "uint32": [2**32 - 1, 0, 1, 2],
        "uint64": [2**64 - 1, 2**63 + 1, 0, 1],
        "sint32": [-(2**31), 2**31 - 1, -1, 0],
        "sint64": [-(2**63), 2**63 - 1, -1, 0],
        "fixed32": [2**32 - 1, 0, 1, 2],
        "fixed64": [0, 1, 2, 2**64 - 1],
        "sfixed32": [-(2**31), 0, 1, 2],
        "sfixed64": [-(2**63), 0, 1, 2],
        "bool": [True, False, True, True],
        "state": [0, 7, 3, -1],
    }
    kind = made("t.Every")
    rows = [
        kind(**{name: values[k] for name, values in extremes.items()}, bytes=b"\xff", string="x")
        for k in range(4)
    ]
    recording = read_log(
        write(
            tmp_path / "a.mcap",
            ("/v", "protobuf", EVERY, [row.SerializeToString() for row in rows]),
        )
    )
    found = recording.topics["/v"].fields
    assert set(found) == set(extremes)
    for name, values in extremes.items():
        expected = np.array(values, np.uint64 if name in ("uint64", "fixed64") else None)
        assert (found[name].dtype, found[name].tobytes()) == (
            expected.dtype,
            expected.tobytes(),
        ), name
    assert recording.damage == ()
    assert recording.metadata["not read: /v"] == "bytes bytes, text string"


def test_what_is_not_set_varies_or_nests(tmp_path: Path) -> None:
    """Defaults are values, what knows it was not set is missing, maps go by key, sequences that
    change length are left out."""
    kind = made("t.Every")
    rows = [
        kind(),
        kind(
            unset=0.0,
            gain={key: float(ord(key)) for key in "bhaecgdf"},
            varying=[1.0],
            itself=kind(int32=5),
        ),
        kind(gain={"a": 3.0}, varying=[1.0, 2.0]),
    ]
    recording = read_log(
        write(
            tmp_path / "a.mcap",
            ("/v", "protobuf", EVERY, [row.SerializeToString() for row in rows]),
        )
    )
    found, nan = recording.topics["/v"].fields, np.nan
    expected = {
        "double": [0, 0, 0], "unset": [nan, 0, nan], "gain.a": [nan, 97, 3], "gain.b": [nan, 98, nan],
        "itself.int32": [nan, 5, nan]
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)
    assert [name for name in found if name.startswith("gain")] == [
        f"gain.{key}" for key in "abcdefgh"
    ]
    assert not any(name.startswith("varying") for name in found)
    assert recording.metadata["not read: /v"] == "varying of changing length"


@pytest.mark.parametrize("schema", [None, ("Any", "jsonschema", b"{}"), ("Any", "", b"")])
def test_json_keeps_its_bits(tmp_path: Path, schema: tuple[str, str, bytes] | None) -> None:
    numbers = np.random.default_rng(1).standard_normal(200) * 10.0 ** np.random.default_rng(
        2
    ).integers(-300, 300, 200)
    rows = [
        {
            "x": float(x),
            "n": 2**53 + k,
            "on": k % 2 == 0,
            "a": [[k, 1], [2, 3]],
            "varying": [0] * (k % 3),
            "name": "x",
            "none": None,
        }
        | ({"b.c": 1} if k == 7 else {"some": k})
        for k, x in enumerate(numbers)
    ]
    recording = read_log(write(tmp_path / "a.mcap", ("/v", "json", schema, as_json(*rows))))
    found = recording.topics["/v"].fields
    assert set(found) == {"x", "n", "on", "a[0][0]", "a[0][1]", "a[1][0]", "a[1][1]", "some", "b.c"}
    assert found["x"].tobytes() == numbers.tobytes()
    np.testing.assert_array_equal(found["n"], 2**53 + np.arange(200), strict=True)
    assert (found["on"].dtype, found["on"][:2].tolist()) == (np.dtype(bool), [True, False])
    assert np.flatnonzero(np.isnan(found["some"])).tolist() == [7]
    assert recording.damage == ()
    assert recording.metadata["not read: /v"] == "text name, varying of changing length"
    np.testing.assert_allclose(recording.topics["/v"].time, np.arange(200) * 0.01)


@pytest.mark.parametrize(
    ("seconds", "rest"),
    [("sec", "nsec"), ("sec", "nanosec"), ("seconds", "nanos"), ("secs", "nsecs")],
)
def test_timestamps_of_foxglove_and_protobuf_are_the_time(
    tmp_path: Path, seconds: str, rest: str
) -> None:
    stamps = [START + k * STEP - 3_000_000 for k in range(5)]
    if seconds == "seconds":
        kind = made("t.Every")
        rows = [
            kind(timestamp={"seconds": ns // 10**9, "nanos": ns % 10**9}).SerializeToString()
            for ns in stamps
        ]
        path = write(tmp_path / "a.mcap", ("/v", "protobuf", EVERY, rows))
    else:
        rows = as_json(
            *({"timestamp": {seconds: ns // 10**9, rest: ns % 10**9}, "v": 1} for ns in stamps)
        )
        path = write(tmp_path / "a.mcap", ("/v", "json", None, rows))
    topic = read_log(path).topics["/v"]
    np.testing.assert_allclose(topic.time, np.arange(5) * 0.01 - 0.003, atol=1e-12)
    assert not any(name.startswith("timestamp") for name in topic.fields)


@pytest.mark.parametrize(
    "stamp",
    [
        {"sec": 2**80, "nsec": 0},
        {"sec": "1", "nsec": 0},
        {"sec": True, "nsec": 0},
        {"sec": -1, "nsec": 0},
        1.5,
        [],
    ],
)
def test_what_is_no_stamp_does_not_become_the_time(tmp_path: Path, stamp: Any) -> None:
    topic = read_log(
        write(tmp_path / "a.mcap", ("/v", "json", None, as_json({"timestamp": stamp, "v": 1})))
    ).topics["/v"]
    assert topic.time.tolist() == [0.0]


def test_numbers_that_json_does_not_have_are_missing_and_said(tmp_path: Path) -> None:
    """NaN and Infinity, as many writers write them, cost themselves and not their message; so does
    a number beyond all bounds."""
    rows = [
        b'{"x": NaN, "y": 1}',
        b'{"x": Infinity, "y": 2}',
        b'{"x": 1e999, "y": 3}',
        b'{"x": 4.5, "y": 36893488147419103233}',
    ]
    recording = read_log(write(tmp_path / "a.mcap", ("/v", "json", None, rows)))
    np.testing.assert_array_equal(recording.topics["/v"].fields["x"], [np.nan, np.nan, np.nan, 4.5])
    np.testing.assert_array_equal(recording.topics["/v"].fields["y"], [1, 2, 3, 2.0**65])
    (damage,) = recording.damage
    assert (damage.kind, damage.topic, damage.what[:9]) == ("values", "/v", "3 numbers")


def test_empty_messages_and_times_beyond_all_clocks(tmp_path: Path) -> None:
    recording = read_log(write(tmp_path / "a.mcap", ("/v", "json", None, [b"{}", b'{"x": 1}'])))
    np.testing.assert_array_equal(recording.topics["/v"].fields["x"], [np.nan, 1])
    with (tmp_path / "b.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start(profile="", library="")
        channel = writer.register_channel("/v", "json", 0)
        for time in (START, 2**64 - 1):
            writer.add_message(channel, time, b'{"x": 1}', time)
        writer.finish()
    late: Recording = read_log(tmp_path / "b.mcap")
    assert late.topics["/v"].time.tolist() == [0.0]
    assert ["damaged message record" in d.what for d in late.damage] == [True]
