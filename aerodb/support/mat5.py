"""Elements of MAT-files of versions 5 to 7: arrays, their headers, numbers, text and field names.

Damaged bytes can crash scipy's reader with a segmentation fault. This parser is plain Python on
bounded slices: every declared size is checked against the available bytes before memory is
allocated, and no bytes cause more than a ValueError or an OverflowError.

Source: MathWorks, "MAT-File Format" (version 5).
"""

import math
import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

#: Deflate cannot expand more than this; what declares more is damaged.
MOST_EXPANSION: Final = 1032

#: Type of an element that is an array.
_MATRIX: Final = 14
#: Type of an element that is compressed.
_COMPRESSED: Final = 15
_NUMBERS: Final = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_TEXT: Final = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_COMPLEX: Final = 0x0800


class MatClass(IntEnum):
    """Classes of arrays that are not numbers; functions and opaque objects have no shape."""

    CELL = 1
    STRUCT = 2
    CHAR = 4
    FUNCTION = 16
    OPAQUE = 17


@dataclass(frozen=True)
class MatHeader:
    """Name, class and shape (rows, columns, ...) of an array."""

    name: str
    kind: int
    shape: tuple[int, ...]
    is_complex: bool

    @property
    def is_number(self) -> bool:
        """Whether the array is of floating-point or integer numbers."""
        return 6 <= self.kind <= 15


class Malformed(ValueError):
    """Bytes that are not a valid element."""


def is_mat5(data: bytes) -> bool:
    """Return whether the bytes begin like a MAT-file of version 5 to 7."""
    return len(data) >= 128 and data[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


class MatElements:
    """Successive elements of a slice of a file.

    data : the bytes; order : ``<`` or ``>``, their byte order; at : where the next element begins.
    Each method reads the next element and raises ValueError for one that is not of its kind.
    """

    def __init__(self, data: memoryview, order: str, at: int = 0) -> None:
        self.data, self.order, self.at = data, order, at

    @classmethod
    def of_file(cls, data: bytes) -> "MatElements":
        """Return the variables of a file that `is_mat5`."""
        return cls(memoryview(data), "<" if data[126:128] == b"IM" else ">", 128)

    def element(self) -> tuple[int, memoryview]:
        """Type and content; a small element has its content in the tag."""
        if self.at + 8 > len(self.data):
            raise Malformed("an element ends early")
        kind, size = struct.unpack_from(self.order + "II", self.data, self.at)
        start = self.at + 8
        after = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if kind >> 16:
            kind, size, start, after = kind & 0xFFFF, kind >> 16, self.at + 4, start
            if size > 4:
                raise Malformed("a small element of more than 4 bytes")
        if start + size > len(self.data):
            raise Malformed(f"{size} bytes declared, {len(self.data) - start} present")
        self.at = min(after, len(self.data))
        return kind, self.data[start : start + size]

    def array(self, most_bytes: int = 0) -> "MatElements":
        """The elements of an array; a compressed one expands to `most_bytes` at the most.

        Raises OverflowError beyond them.
        """
        kind, content = self.element()
        if kind == _COMPRESSED:
            return MatElements(_expanded(content, self.order, most_bytes), self.order)
        if kind != _MATRIX:
            raise Malformed(f"an element of type {kind} in place of an array")
        return MatElements(content, self.order)

    def numbers(self) -> NDArray[Any]:
        """Numbers (n,) as they are stored (in no known unit); raises Malformed for a type that
        holds none."""
        kind, content = self.element()
        if kind not in _NUMBERS:
            raise Malformed(f"numbers of type {kind}")
        return np.frombuffer(content, self.order + _NUMBERS[kind])

    def shaped(self, header: MatHeader) -> NDArray[Any]:
        """Numbers in the shape of `header`, as they are stored."""
        values = self.numbers()
        if values.size != math.prod(header.shape):
            shape = " x ".join(map(str, header.shape))
            raise Malformed(f"{values.size} numbers for an array of {shape}")
        return values.reshape(header.shape, order="F")

    def text(self, errors: str = "strict") -> str:
        """Text; `errors` as in bytes.decode."""
        kind, content = self.element()
        if kind not in _TEXT:
            raise Malformed(f"text of type {kind}")
        encoding = _TEXT[kind]
        if encoding in ("utf-16", "utf-32"):
            encoding += "-le" if self.order == "<" else "-be"
        return bytes(content).decode(encoding, errors)

    def header(self) -> MatHeader:
        """The header of the array that these elements belong to."""
        flags = self.numbers()
        if len(flags) != 2:
            raise Malformed("an array without flags")
        kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) & _COMPLEX)
        if kind in (MatClass.FUNCTION, MatClass.OPAQUE):
            return MatHeader("", kind, (), is_complex)
        shape = tuple(int(n) for n in self.numbers())
        if len(shape) < 2 or min(shape) < 0:
            raise Malformed("an array without shape")
        return MatHeader(bytes(self.element()[1]).decode("latin-1"), kind, shape, is_complex)

    def fields(self) -> list[str]:
        """Names of the fields of a struct."""
        width, (_, names) = self.numbers(), self.element()
        if len(width) != 1 or width[0] <= 0 or len(names) % int(width[0]):
            raise Malformed("a struct without names of fields")
        return [
            bytes(names[start : start + int(width[0])]).split(b"\0")[0].decode("latin-1")
            for start in range(0, len(names), int(width[0]))
        ]


def _expanded(content: memoryview, order: str, most_bytes: int) -> memoryview:
    """The array in a compressed element; its declared size is checked before decompression."""
    unpacker = zlib.decompressobj()
    try:
        tag = unpacker.decompress(content, 8)
        if len(tag) < 8:
            raise Malformed("a compressed array without a tag")
        kind, size = struct.unpack(order + "II", tag)
        if kind != _MATRIX or size > MOST_EXPANSION * len(content):
            raise Malformed(f"a compressed array declares {size} bytes in {len(content)}")
        if size > most_bytes:
            raise OverflowError("content is too large")
        body = unpacker.decompress(unpacker.unconsumed_tail, size) if size else b""
        unpacker.decompress(unpacker.unconsumed_tail, 16)
    except zlib.error as error:
        raise Malformed(f"damaged: {error}") from error
    if len(body) != size or not unpacker.eof:
        raise Malformed("a compressed array does not have the declared size")
    return memoryview(body)
