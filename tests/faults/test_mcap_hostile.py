"""MCAP files with hostile or damaged JSON and protobuf messages: only the affected messages are
lost, and the loss is reported."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, FileDescriptorProto, FileDescriptorSet

from aerodb.errors import InputError
from aerodb.storage.limits import Limits
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.mcap_messages import (
    DEEPEST,
    LARGEST_MESSAGE,
    LARGEST_SCHEMA,
    MOST_NAMES,
)
from aerodb.tasks.workers import parsed_log
from tests.faults.test_fuzz_readers import flip, scramble
from tests.storage.readers.test_mcap_messages import (
    DESCRIPTORS,
    EVERY,
    F,
    Messages,
    as_json,
    field,
    imu_message,
    made,
    message_type,
    write,
)


def described(*messages: DescriptorProto, name: str = "A", **file: Any) -> tuple[str, str, bytes]:
    files = FileDescriptorSet(
        file=[FileDescriptorProto(name="x", syntax="proto3", message_type=messages, **file)]
    )
    return name, "protobuf", files.SerializeToString()


def itself_deep(depth: int) -> bytes:
    """t.Every inside itself: field 25, length-delimited."""
    kind = made("t.Every")
    message = kind(int32=1)
    for _ in range(depth):
        message = kind(itself=message)
    return message.SerializeToString()


def wide(n: int) -> tuple[str, str, bytes]:
    return described(message_type("A", *(field(f"f{k}", k + 1) for k in range(n))))


CIRCLE = FileDescriptorSet(
    file=[FileDescriptorProto(name=a, dependency=[b]) for a, b in (("x", "y"), ("y", "x"))]
)
HUGE = FileDescriptorSet(file=[FileDescriptorProto(name="y" * LARGEST_SCHEMA)])
HOSTILE: dict[str, Callable[[], tuple[str, tuple[str, str, bytes] | None, Messages]]] = {
    "deep arrays": lambda: ("json", None, [b'{"x":' + b"[" * 20_000 + b"]" * 20_000 + b"}"]),
    "deep objects": lambda: ("json", None, [b'{"x":' * 20_000 + b"1" + b"}" * 20_000]),
    "rather deep": lambda: ("json", None, [b'{"x":' * (DEEPEST + 2) + b"1" + b"}" * (DEEPEST + 2)]),
    "duplicate keys": lambda: ("json", None, [b'{"x": 1, "x": 2}']),
    "one name two ways": lambda: ("json", None, [b'{"a.b": 1, "a": {"b": 2}}']),
    "no object": lambda: ("json", None, [b"[1, 2]"]),
    "no JSON": lambda: ("json", None, [b"{x: 1}"]),
    "no text": lambda: ("json", None, [b'{"x": "\xff"}']),
    "wide": lambda: ("json", None, as_json({f"f{k}": k for k in range(MOST_NAMES + 1)})),
    "wide and empty": lambda: ("json", None, as_json({f"f{k}": [] for k in range(MOST_NAMES + 1)})),
    "endless integer": lambda: ("json", None, [b'{"x": ' + b"9" * 5000 + b"}"]),
    "integer beyond floats": lambda: ("json", None, [b'{"x": ' + b"9" * 400 + b"}"]),
    "large": lambda: ("json", None, [b'{"x": "' + b"a" * LARGEST_MESSAGE + b'"}']),
    "no descriptor": lambda: ("protobuf", ("A", "protobuf", b"\xff\xfe"), [b""]),
    "empty descriptor": lambda: ("protobuf", ("A", "protobuf", b""), [b""]),
    "no schema": lambda: ("protobuf", None, [b""]),
    "type is not there": lambda: ("protobuf", described(message_type("B")), [b""]),
    "import is not there": lambda: (
        "protobuf",
        described(message_type("A"), dependency=["y"]),
        [b""],
    ),
    "files in a circle": lambda: ("protobuf", ("A", "protobuf", CIRCLE.SerializeToString()), [b""]),
    "huge descriptor": lambda: (
        "protobuf",
        (*EVERY[:2], DESCRIPTORS + HUGE.SerializeToString()),
        [b""],
    ),
    "wide descriptor": lambda: ("protobuf", wide(18_000), [b""]),
    "field is a path": lambda: ("protobuf", described(message_type("A", field("../x", 1))), [b""]),
    "field is a statement": lambda: (
        "protobuf",
        described(message_type("A", field("x; DROP TABLE logs", 1))),
        [b""],
    ),
    "number twice": lambda: (
        "protobuf",
        described(message_type("A", field("x", 1), field("y", 1))),
        [b""],
    ),
    "inside itself": lambda: ("protobuf", EVERY, [itself_deep(DEEPEST + 2)]),
    "deep inside itself": lambda: ("protobuf", EVERY, [b"\xca\x01\x7f" * 5000]),
    "cut": lambda: ("protobuf", EVERY, [b"\x09\x00"]),
    "bad text": lambda: ("protobuf", EVERY, [b"\x7a\x01\xff"]),
    "another language": lambda: ("cbor", None, [b"\xa1\x61x\x01"]),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_messages_cost_themselves_and_are_said(tmp_path: Path, case: str) -> None:
    """Beside a good topic, which stays whole and is stored; alone, a refusal. In this process and
    in the reader's own."""
    encoding, schema, messages = HOSTILE[case]()
    good = as_json(*({"x": k} for k in range(5)))
    path = write(
        tmp_path / "a.mcap", ("/good", "json", None, good), ("/bad", encoding, schema, messages)
    )
    with parsed_log(
        path, tmp_path / "topics", Limits(memory=500_000_000, processor=10.0)
    ) as parsed:
        for recording in (read_log(path), parsed.recording):
            assert set(recording.topics) == {"/good"}
            np.testing.assert_array_equal(recording.topics["/good"].fields["x"], np.arange(5))
            assert {d.topic for d in recording.damage} == {"/bad"}
    alone = write(tmp_path / "b.mcap", ("/bad", encoding, schema, messages))
    with pytest.raises(InputError, match="no message can be read") as refusal:
        read_log(alone)
    assert refusal.value.remedy


def test_hostile_names_are_names(tmp_path: Path) -> None:
    """Paths, statements and what no terminal shows come back from the store as they were; no text,
    no field."""
    names = [
        "../../x",
        "x'; DROP TABLE logs; --",
        "<script>",
        "a\u0000b",
        "\u202etxt",
        "",
        "time",
        "a" * 249,
        "$ref",
        "__class__",
    ]
    row = {name: k for k, name in enumerate(names)} | {"\ud800": 1, "a" * 251: 2}
    path = write(tmp_path / "a.mcap", ("/../v", "json", None, as_json(row)))
    with parsed_log(path, tmp_path / "topics", Limits()) as parsed:
        topic = parsed.recording.topics["/../v"]
        assert {name: values.tolist() for name, values in topic.fields.items()} == {
            name: [k] for k, name in enumerate(names)
        }
        assert "is not text" in str(parsed.recording.metadata["not read: /../v"])
    assert {entry.name for entry in tmp_path.iterdir()} == {"a.mcap"}


def test_fields_named_like_the_library_are_fields(tmp_path: Path) -> None:
    names = [
        "HasField",
        "DESCRIPTOR",
        "ListFields",
        "FromString",
        "__class__",
        "SerializeToString",
        "items",
        "None",
    ]
    optional = field("x", 20, F.TYPE_MESSAGE, type_name=".A")
    schema = described(
        message_type("A", *(field(name, k + 1) for k, name in enumerate(names)), optional)
    )
    data = b"".join(
        bytes([8 * (k + 1) + 1]) + struct.pack("<d", k + 0.5) for k in range(len(names))
    )
    found = (
        read_log(write(tmp_path / "a.mcap", ("/v", "protobuf", schema, [data]))).topics["/v"].fields
    )
    assert {name: values.tolist() for name, values in found.items()} == {
        name: [k + 0.5] for k, name in enumerate(names)
    }


def test_a_wide_type_is_left_at_its_limit(tmp_path: Path) -> None:
    """An empty message of 6 000 fields is not walked to its end: it costs no bytes, so that a small
    file may hold millions."""
    good = as_json({"x": 1})
    path = write(
        tmp_path / "a.mcap",
        ("/good", "json", None, good),
        ("/bad", "protobuf", wide(6_000), [b""] * 3),
    )
    (damage,) = read_log(path).damage
    assert damage.what == f"3 messages not read: not decodable (more than {MOST_NAMES} fields)"


def test_names_that_change_with_every_message_are_limited(tmp_path: Path) -> None:
    rows = as_json(*({f"x{k}": 1.0} for k in range(MOST_NAMES + 100)))
    recording = read_log(write(tmp_path / "a.mcap", ("/v", "json", None, rows)))
    assert len(recording.topics["/v"].fields) == MOST_NAMES
    (damage,) = recording.damage
    assert damage.what.startswith("100 messages not read")


@pytest.mark.heavy
@pytest.mark.parametrize("change", [flip, scramble])
def test_random_damage_inside_messages_and_schemas_is_read_or_said(
    tmp_path: Path,
    trials: Callable[[int, int], int],
    change: Callable[[bytes, np.random.Generator], bytes],
) -> None:
    """The file is whole and its content is not: every message is read or counted, by topic, and the
    intact topic stays."""
    rng, kind = np.random.default_rng(9), made("t.Imu")
    rows = {
        "json": as_json(*map(imu_message, range(8))),
        "protobuf": [kind(**imu_message(k)).SerializeToString() for k in range(8)],
    }
    good = as_json(*({"x": k} for k in range(5)))
    read = refused = 0
    for k in range(trials(30, 1500)):
        schema = ("t.Imu", "protobuf", change(DESCRIPTORS, rng) if k % 3 == 0 else DESCRIPTORS)
        encoding = "json" if k % 3 == 1 else "protobuf"
        messages = [change(row, rng) if rng.random() < 0.5 else row for row in rows[encoding]]
        path = write(
            tmp_path / "a.mcap",
            ("/good", "json", None, good),
            ("/bad", encoding, schema, messages),
            plain=True,
        )
        recording = read_log(path)
        np.testing.assert_array_equal(
            recording.topics["/good"].fields["x"], np.arange(5), strict=True
        )
        assert {d.topic for d in recording.damage} <= {"/bad"}
        found = recording.topics.get("/bad")
        n = 0 if found is None else len(found.time)
        lost = sum(int(d.what.split()[0]) for d in recording.damage if "not read" in d.what)
        assert n + lost == len(messages)
        assert found is None or all(
            values.shape == (n,) and values.dtype != object for values in found.fields.values()
        )
        read, refused = read + n, refused + lost
    assert read > 0
    assert refused > 0
