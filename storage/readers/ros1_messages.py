"""Messages of ROS 1 as numbers by name, by the definitions that a bag holds.

Little-endian, packed, sequences and texts behind their length in four bytes (wiki.ros.org, Messages
and Serialization). Definitions are the file's own: names, depths and counts are limited.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from aerodb.storage.readers.mcap_messages import (
    DEEPEST,
    LARGEST_SCHEMA,
    LONGEST_SEQUENCE,
    MOST_NAMES,
    MessageError,
    Reader,
    ros_numbers,
)

_PRIMITIVES: Final = {
    "bool": "?", "byte": "b", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_LENGTH: Final = struct.Struct("<I")
_TIME: Final = {"time": struct.Struct("<II"), "duration": struct.Struct("<ii")}
_FIELD: Final = re.compile(r"([A-Za-z]\w*(?:/\w+)?)(\[\d*\])?\s+([A-Za-z]\w*)")
_CONSTANT: Final = re.compile(r"\w+\s+\w+\s*=")
_SEPARATOR: Final = re.compile(r"^={20,}\s*$", re.MULTILINE)
#: A field: a value and the offset behind it, from a message and an offset.
_Field = Callable[[memoryview, int], tuple[Any, int]]


@dataclass
class Stamp:
    """A time of ROS 1, under the names that it has in ROS 2."""

    __slots__ = ("_type", "nanosec", "sec")
    sec: int
    nanosec: int
    _type: str


def ros1_reader(kind: str, definition: str) -> Reader:
    """Return the function that reads messages of a type such as ``sensor_msgs/Imu``.

    Raises MessageError for a definition that cannot be used; the function raises the same for a
    message that does not fit it.
    """
    if len(definition) > LARGEST_SCHEMA:
        raise MessageError(f"their definition is larger than {LARGEST_SCHEMA >> 20} MiB")
    first, *others = _SEPARATOR.split(definition)
    texts = {kind: first}
    for other in others:
        name, _, text = other.strip().partition("\n")
        texts[name.removeprefix("MSG:").strip()] = text
    read = _Definitions(texts).message(kind, 0)

    def numbers(data: bytes) -> Any:
        try:
            message, end = read(memoryview(data), 0)
        except (struct.error, UnicodeDecodeError) as error:
            raise MessageError("shorter than their definition") from error
        if end != len(data):
            raise MessageError("longer than their definition")
        return ros_numbers(message)

    return numbers


class _Definitions:
    """Types of a definition by name, and the functions that read them."""

    def __init__(self, texts: dict[str, str]) -> None:
        self.texts = texts
        self.known: dict[str, _Field] = {}

    def message(self, kind: str, depth: int) -> _Field:
        if depth > DEEPEST:
            raise MessageError(f"nested more than {DEEPEST} deep")
        if kind in self.known:
            return self.known[kind]
        if kind not in self.texts:
            raise MessageError("a type in their definition is not defined")
        names, readers = list[str](), list[_Field]()
        for line in self.texts[kind].splitlines():
            text = line.split("#", 1)[0].strip()
            if not text or _CONSTANT.match(text):
                continue
            match = _FIELD.fullmatch(text)
            if match is None or len(names) >= MOST_NAMES:
                raise MessageError("their definition cannot be parsed")
            names.append(match[3])
            readers.append(self._field(kind, match[1], match[2] or "", depth))
        if len(set(names)) < len(names) or any(name.startswith("_") for name in names):
            raise MessageError("their definition cannot be parsed")
        made = type("Message", (), {"__slots__": tuple(names), "_type": kind})

        def read(data: memoryview, at: int) -> tuple[Any, int]:
            message = made()
            for name, reader in zip(names, readers, strict=True):
                value, at = reader(data, at)
                setattr(message, name, value)
            return message, at

        self.known[kind] = read
        return read

    def _field(self, inside: str, kind: str, brackets: str, depth: int) -> _Field:
        count = int(brackets[1:-1]) if brackets[1:-1] else None
        if kind in _PRIMITIVES:
            letter = _PRIMITIVES[kind]
            return _sequence(letter, count) if brackets else _one(struct.Struct(f"<{letter}"))
        if kind == "string":
            element: _Field = _text
        elif kind in _TIME:
            element = _time(_TIME[kind], kind)
        else:
            element = self.message(self._whole(inside, kind), depth + 1)
        return _list(element, count) if brackets else element

    def _whole(self, inside: str, kind: str) -> str:
        """The name of a type with its package."""
        if "/" in kind:
            return kind
        beside = f"{inside.partition('/')[0]}/{kind}"
        return "std_msgs/Header" if kind == "Header" and beside not in self.texts else beside


def _one(form: struct.Struct) -> _Field:
    def read(data: memoryview, at: int) -> tuple[Any, int]:
        return form.unpack_from(data, at)[0], at + form.size

    return read


def _time(form: struct.Struct, kind: str) -> _Field:
    def read(data: memoryview, at: int) -> tuple[Any, int]:
        sec, nanosec = form.unpack_from(data, at)
        return Stamp(sec, nanosec, kind), at + form.size

    return read


def _counted(data: memoryview, at: int, count: int | None) -> tuple[int, int]:
    """Number of elements, and the offset of the first."""
    if count is not None:
        return count, at
    return _LENGTH.unpack_from(data, at)[0], at + _LENGTH.size


def _text(data: memoryview, at: int) -> tuple[str, int]:
    length, at = _counted(data, at, None)
    if at + length > len(data):
        raise MessageError("shorter than their definition")
    return bytes(data[at : at + length]).decode("utf-8"), at + length


def _sequence(letter: str, count: int | None) -> _Field:
    """Numbers of a sequence; of one that is too long for channels, only their count matters."""
    size = struct.calcsize(f"<{letter}")

    def read(data: memoryview, at: int) -> tuple[Any, int]:
        length, at = _counted(data, at, count)
        end = at + length * size
        if end > len(data):
            raise MessageError("shorter than their definition")
        if length > LONGEST_SEQUENCE:
            return range(length), end
        return struct.unpack_from(f"<{length}{letter}", data, at), end

    return read


def _list(element: _Field, count: int | None) -> _Field:
    def read(data: memoryview, at: int) -> tuple[Any, int]:
        length, at = _counted(data, at, count)
        if length > len(data) - at:
            raise MessageError("shorter than their definition")
        values = []
        for _ in range(length):
            value, at = element(data, at)
            values.append(value)
        return values, at

    return read
