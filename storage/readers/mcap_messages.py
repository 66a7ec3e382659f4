"""Conversion of MCAP messages (ROS 2 CDR, JSON, protobuf) to numbers by name.

Nested fields are joined by dots (``pose.orientation.x``), array elements are ``covariance[0]``.
Texts and bytes are not channels; omitted fields are listed. Names, depths and counts come from the
untrusted file, so all of them are limited.
"""

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding
from mcap_ros2.decoder import DecoderFactory

from aerodb.storage.readers.mcap_protobuf import protobuf_parts, protobuf_type

#: Longer sequences (images, point clouds) are not channels.
LONGEST_SEQUENCE: Final = 64
#: Maximum number of fields, sequences and omitted fields of one topic, together.
MOST_NAMES: Final = 2000
LONGEST_NAME: Final = 250
DEEPEST: Final = 32
#: Larger JSON or protobuf messages [bytes] hold images or point clouds; a larger schema is invalid.
LARGEST_MESSAGE: Final = 1 << 24
LARGEST_SCHEMA: Final = 1 << 22
_SECONDS: Final = ("sec", "secs", "seconds")
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs", "nanos")

Values = dict[str, float | int | bool]
Parts = Iterable[tuple[str, Any]]


class MessageError(Exception):
    """A message or schema that is not used; its texts are from a fixed set, because messages are
    counted by them."""


@dataclass
class MessageContent:
    """Content of one message: numbers by name, the header's stamp [ns] (0 if absent), the lengths
    of its sequences, omitted fields, and the number of NaN or infinite values in an encoding that
    does not allow them."""

    values: Values = field(default_factory=dict)
    stamp: int = 0
    lengths: dict[str, int] = field(default_factory=dict)
    skipped: set[str] = field(default_factory=set)
    not_finite: int = 0

    def names(self) -> set[str]:
        return {*self.values, *self.lengths, *self.skipped}


Reader = Callable[[bytes], MessageContent]


def message_reader(channel: Channel, schema: Schema | None, ros2: DecoderFactory) -> Reader | None:
    """Function that reads the messages of `channel`; None if the encoding is not supported.

    Raises MessageError, or an error of the decoding library, for an unusable schema. The returned
    function raises the same errors for messages.
    """
    if (
        channel.message_encoding == MessageEncoding.JSON
    ):  # describes itself: the schema is not needed
        return _json_numbers
    if schema is None:
        return None
    if channel.message_encoding == schema.encoding == MessageEncoding.Protobuf:
        if len(schema.data) > LARGEST_SCHEMA:
            raise MessageError(f"their schema is larger than {LARGEST_SCHEMA >> 20} MiB")
        parse = protobuf_type(schema.name, schema.data)
        return lambda data: _numbers(parse(_limited(data)), protobuf_parts, needs_finite=False)
    decode = ros2.decoder_for(channel.message_encoding, schema)
    return None if decode is None else lambda data: ros_numbers(decode(data))


def _limited(data: bytes) -> bytes:
    if len(data) > LARGEST_MESSAGE:
        raise MessageError(f"larger than {LARGEST_MESSAGE >> 20} MiB")
    return data


def _json_numbers(data: bytes) -> MessageContent:
    message = json.loads(_limited(data).decode("utf-8"), object_pairs_hook=_once)
    if not isinstance(message, dict):
        raise MessageError("not a JSON object")
    return _numbers(message, _json_parts, needs_finite=True)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) < len(pairs):
        raise MessageError("a name occurs twice in them")
    return fields


def _json_parts(value: Any) -> Parts | None:
    return value.items() if isinstance(value, dict) else None


def _numbers(
    message: Any, parts: Callable[[Any], Parts | None], needs_finite: bool
) -> MessageContent:
    """The numbers of a nested message; `parts` returns names and values of a nested value, None for
    any other value."""
    numbers = MessageContent()

    def collect(value: Any, name: str, depth: int) -> None:
        if isinstance(value, (bool, int, float)):
            _put(numbers, name, value, needs_finite)
        elif isinstance(value, (str, bytes)):
            if value and not name.endswith("frame_id"):
                numbers.skipped.add(f"{'text' if isinstance(value, str) else 'bytes'} {name}")
        elif value is None:
            return
        elif depth > DEEPEST:
            raise MessageError(f"nested more than {DEEPEST} deep")
        elif (inner := parts(value)) is not None:
            nested(inner, name, depth)
        elif len(value) > LONGEST_SEQUENCE:
            numbers.skipped.add(f"{name} of {len(value)} elements")
        else:
            numbers.lengths[name] = len(value)
            for k, element in enumerate(value):
                collect(element, f"{name}[{k}]", depth + 1)
        if len(numbers.values) + len(numbers.lengths) + len(numbers.skipped) > MOST_NAMES:
            raise MessageError(f"more than {MOST_NAMES} fields")

    def nested(inner: Parts, name: str, depth: int) -> None:
        if name in ("header.stamp", "timestamp"):
            fields = dict(inner)
            if not numbers.stamp and (stamp := _nanoseconds(fields)) is not None:
                numbers.stamp = stamp
                return
            inner = fields.items()
        for part, value in inner:
            longer = f"{name}.{part}" if name else part
            if len(longer) > LONGEST_NAME or not _is_text(longer):
                numbers.skipped.add(
                    f"a name that is not text, or longer than {LONGEST_NAME} characters"
                )
            else:
                collect(value, longer, depth + 1)

    collect(message, "", 0)
    return numbers


def _put(numbers: MessageContent, name: str, value: float | int | bool, needs_finite: bool) -> None:
    if name in numbers.values:  # {"a.b": 1, "a": {"b": 2}}
        raise MessageError("a name occurs twice in them")
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        value = float(value)
    if needs_finite and not math.isfinite(value):
        value, numbers.not_finite = math.nan, numbers.not_finite + 1
    numbers.values[name] = value


def _is_text(name: str) -> bool:
    """Return whether a name can be encoded: JSON may contain unpaired surrogates."""
    return name.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in name)


def _nanoseconds(stamp: dict[str, Any]) -> int | None:
    """A time stamp [ns] from whole seconds and nanoseconds under their usual names (ROS, Foxglove,
    protobuf); None for anything else."""
    if len(stamp) != 2:
        return None
    seconds = next((stamp[name] for name in _SECONDS if name in stamp), None)
    rest = next((stamp[name] for name in _NANOSECONDS if name in stamp), None)
    if (
        type(seconds) is not int
        or type(rest) is not int
        or not (0 <= seconds < 2**33 and 0 <= rest < 2**32)
    ):
        return None
    return seconds * 10**9 + rest


def ros_numbers(message: Any) -> MessageContent:
    """Return the numbers of a decoded message of ROS; joint states by the name of the joint
    (``position.elevator``)."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    numbers = MessageContent(
        stamp=int(stamp.sec) * 10**9 + int(stamp.nanosec) if stamp is not None else 0
    )
    _flatten(message, "", numbers.values, numbers.skipped)
    return numbers


def _flatten(value: Any, name: str, into: Values, skipped: set[str]) -> None:
    """Numbers of a ROS 2 message by dotted name; texts and long sequences are listed in
    `skipped`."""
    if isinstance(value, (bool, int, float)):
        into[name] = value
    elif isinstance(value, str):
        if value and not name.endswith("frame_id"):
            skipped.add(f"text {name}")
    elif hasattr(type(value), "__slots__") and hasattr(value, "_type"):
        joints: list[str] | None = value.name if value._type.endswith("JointState") else None
        for part in type(value).__slots__:
            inner: Any = getattr(value, part)
            if joints is not None and hasattr(inner, "__len__") and len(inner) == len(joints):
                if part != "name":
                    into |= {
                        f"{part}.{joint}": number
                        for joint, number in zip(joints, inner, strict=True)
                    }
            elif not (part == "stamp" and name == "header"):
                _flatten(inner, f"{name}.{part}" if name else part, into, skipped)
    elif len(value) > LONGEST_SEQUENCE:
        skipped.add(f"{name} of {len(value)} elements")
    else:
        for k, element in enumerate(value):
            _flatten(element, f"{name}[{k}]", into, skipped)
