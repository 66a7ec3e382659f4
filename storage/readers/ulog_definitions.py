"""Validity checks of ULog messages other than data, and the sizes of topic data.

The checks tell records from noise after damaged bytes. Source of all rules: the ULog file format
specification of PX4 (docs.px4.io, dev_log/ulog_file_format). No file access here.
"""

import re
from dataclasses import dataclass, field

#: Bytes of the basic types.
SIZES = {
    **dict.fromkeys(("int8_t", "uint8_t", "bool", "char"), 1),
    **dict.fromkeys(("int16_t", "uint16_t"), 2),
    **dict.fromkeys(("int32_t", "uint32_t", "float"), 4),
    **dict.fromkeys(("int64_t", "uint64_t", "double"), 8),
}
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
#: The size of a message has 16 bits, so no topic can be larger. Valid formats are not deep.
LARGEST = 0xFFFF
_DEEPEST = 16

_FORMAT = re.compile(r"([\w\-/]+):((?:[\w/]+(?:\[\d{1,5}\])? \w+;?)+)", re.ASCII)
_FIELD = re.compile(r"([\w/]+?)(?:\[(\d+)\])? (\w+)", re.ASCII)
_KEY = re.compile(rb"(\w+?)(?:\[(\d{1,5})\])? [\w\-.\[\]/ ]+")


@dataclass(frozen=True)
class Layout:
    """Size of a topic's data in bytes, with trailing padding (`full`) and without (`trimmed`), and
    the offset of its 64-bit timestamp (`stamp`, -1 if there is none)."""

    full: int
    trimmed: int
    stamp: int


@dataclass
class Formats:
    """The formats read so far: name -> ((type, count, field), ...), count 1 for scalars."""

    fields: dict[str, tuple[tuple[str, int, str], ...]] = field(default_factory=dict)

    def add(self, text: str) -> None:
        """Register one format message, ``name:type field;type[3] field;``, already checked by
        `is_format`."""
        name, body = text.split(":", 1)
        matches = _FIELD.finditer(body)
        self.fields[name] = tuple(
            (m[1], int(m[2]) if m[2] is not None else 1, m[3]) for m in matches
        )

    def layout(self, name: str) -> Layout | None:
        """Layout of topic `name`; None if its format is missing, refers to a missing format or to
        itself, or is too large."""
        sizes = [self._bytes(kind, count, 0) for kind, count, _ in self.fields.get(name, ())]
        if not sizes or None in sizes:
            return None
        whole = [size for size in sizes if size is not None]
        names = [f for _, _, f in self.fields[name]]
        kinds = [(kind, f) for kind, _, f in self.fields[name]]
        kept = len(names)
        while kept and names[kept - 1].startswith("_padding"):
            kept -= 1
        stamp = sum(whole[: names.index("timestamp")]) if ("uint64_t", "timestamp") in kinds else -1
        full = sum(whole)
        return Layout(full, sum(whole[:kept]), stamp) if 0 < full <= LARGEST - 2 and kept else None

    def _bytes(self, kind: str, count: int, depth: int) -> int | None:
        if count * SIZES.get(kind, 1) > LARGEST or depth > _DEEPEST:
            return None
        if kind in SIZES:
            return count * SIZES[kind]
        total = 0
        for inner, n, _ in self.fields.get(kind, ()):
            size = self._bytes(inner, n, depth + 1)
            total += LARGEST + 1 if size is None else size
            if total * count > LARGEST:
                return None
        return total * count if total else None


def is_format(body: bytes) -> bool:
    """Return whether `body` is the text of a format message."""
    return body.isascii() and _FORMAT.fullmatch(body.decode("ascii")) is not None


def is_key_value(body: bytes) -> bool:
    """Return whether `body` consists of key length, ``type key``, and a value of exactly that type
    (information, parameter)."""
    if len(body) < 2 or not 0 < body[0] < len(body):
        return False
    match = _KEY.fullmatch(body[1 : 1 + body[0]])
    if match is None:
        return False
    size = SIZES.get(match[1].decode("latin-1"))
    count = int(match[2]) if match[2] is not None else 1
    return size is not None and len(body) == 1 + body[0] + size * count


def is_logged_text(body: bytes, prefix: int) -> bool:
    """Return whether `body` consists of level, (tag,) time and a text without control characters;
    `prefix` bytes precede the text."""
    return len(body) >= prefix and body[0] in b"01234567" and min(body[prefix:], default=32) >= 8


def is_subscription(body: bytes) -> bool:
    """Return whether `body` announces a topic: instance, id and a name."""
    return len(body) > 3 and re.fullmatch(rb"[\w\-/]+", body[3:]) is not None


def is_record(kind: int, body: bytes) -> bool:
    """Return whether a message of type `kind` (not data) conforms to the ULog specification,
    section "Definitions" or "Data"; no error for any bytes."""
    match chr(kind):
        case "F":
            return is_format(body)
        case "I" | "P":
            return is_key_value(body)
        case "M" | "Q":
            return is_key_value(body[1:])
        case "A":
            return is_subscription(body)
        case "L":
            return is_logged_text(body, 9)
        case "C":
            return is_logged_text(body, 11)
        case "S":
            return body == SYNC
        case "O" | "R":
            return len(body) == 2
        case "B":
            return 40 <= len(body) <= 64
    return False
