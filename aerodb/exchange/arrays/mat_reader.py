"""Read MAT-files of versions 5 to 7 element by element: structs, cells, text and numbers.

Damaged bytes can crash scipy's reader with a segmentation fault, and a database file may come from
any source. This reader is plain Python on bounded slices: no bytes can cause more than a
ValueError.

Source: MathWorks, "MAT-File Format" (version 5).
"""

import math
import struct
import zlib
from typing import Any, Final

import numpy as np

_MATRIX: Final = 14
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
_ENCODINGS: Final = {
    1: "latin-1",
    2: "latin-1",
    4: "utf-16",
    16: "utf-8",
    17: "utf-16",
    18: "utf-32",
}
#: Array class of a cell array.
_CELL: Final = 1
#: Array class of a structure.
_STRUCT: Final = 2
#: Array class of text.
_CHAR: Final = 4
#: Array class of doubles, the first of numbers.
_DOUBLE: Final = 6
#: Last array class of numbers.
_LAST_NUMBER: Final = 15
_MAX_DEPTH: Final = 20


def read_mat(data: bytes, limit: int) -> dict[str, Any]:
    """Return the variables of a MAT-file by name, at most `limit` bytes when expanded.

    Numbers are float64 arrays, text is str, a cell is a flat list, and a struct (of any size) is a
    flat list of dicts.

    Raises ValueError for anything that is not such a file, and OverflowError beyond the limit.
    """
    if data.startswith(b"MATLAB 7.3"):
        raise ValueError("a MAT-file of version 7.3 (in MATLAB: save with -v7)")
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        raise ValueError("not a MAT-file of version 5 to 7 (in MATLAB: save with -v7)")
    order, variables, at = "<" if data[126:128] == b"IM" else ">", dict[str, Any](), 128
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        body = data[at + 8 : at + 8 + size]
        if len(body) < size:
            raise ValueError("the file ends early")
        if kind == _COMPRESSED:
            expanded = _expanded(body, limit)
            limit -= len(expanded)
            reader = _Reader(expanded, order)
            kind, body = reader.element()
        if kind == _MATRIX:
            name, value = _Reader(body, order).matrix(0)
            variables[name] = value
        at += 8 + size
    return variables


def _expanded(body: bytes, limit: int) -> bytes:
    try:
        expanded = zlib.decompressobj().decompress(body, limit + 1)
    except zlib.error as error:
        raise ValueError(f"damaged: {error}") from error
    if len(expanded) > limit:
        raise OverflowError("content is too large")
    return expanded


class _Reader:
    """Successive elements of a slice of the file."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data, self._order, self._at = data, order, 0

    def element(self) -> tuple[int, bytes]:
        """Type and content of the next element; a small element has its content in the tag."""
        if self._at + 8 > len(self._data):
            raise ValueError("an element ends early")
        kind, size = struct.unpack_from(f"{self._order}II", self._data, self._at)
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, self._at + 4
            self._at += 8
            if size > 4:
                raise ValueError("a small element of more than 4 bytes")
        else:
            start = self._at + 8
            self._at = start + size + -size % 8
        content = self._data[start : start + size]
        if len(content) < size:
            raise ValueError("an element ends early")
        return kind, content

    def numbers(self) -> Any:
        """The next element as a flat array."""
        kind, content = self.element()
        if kind not in _NUMBERS:
            raise ValueError(f"numbers of type {kind}")
        return np.frombuffer(content, dtype=self._order + _NUMBERS[kind])

    def matrix(self, depth: int) -> tuple[str, Any]:
        """Name and value of the array that this reader contains."""
        if depth > _MAX_DEPTH:
            raise ValueError("structs are nested too deeply")
        if not self._data:
            return "", np.empty((0, 0))
        flags, shape = self.numbers(), [int(n) for n in self.numbers()]
        name = bytes(self.element()[1]).decode("ascii")
        if len(flags) != 2 or len(shape) < 2 or min(shape) < 0:
            raise ValueError("an array without shape")
        kind, count = int(flags[0]) & 0xFF, math.prod(shape)
        if kind == _CELL:
            return name, [self._inner(depth) for _ in range(count)]
        if kind == _STRUCT:
            fields = self._fields()
            return name, [
                {field: self._inner(depth) for field in fields}
                for _ in range(count if fields else 0)
            ]
        if kind == _CHAR:
            return name, self._text(shape)
        if _DOUBLE <= kind <= _LAST_NUMBER:
            values = self.numbers()
            if values.size != count:
                raise ValueError(
                    f"{values.size} numbers for an array of {' x '.join(map(str, shape))}"
                )
            return name, np.array(values.reshape(shape, order="F"), dtype=np.float64, order="C")
        raise ValueError(
            f"an array of class {kind}, which is neither struct, cell, text nor numbers"
        )

    def _inner(self, depth: int) -> Any:
        kind, content = self.element()
        if kind != _MATRIX:
            raise ValueError(f"an element of type {kind} in place of an array")
        return _Reader(content, self._order).matrix(depth + 1)[1]

    def _fields(self) -> list[str]:
        length, (_, names) = self.numbers(), self.element()
        if len(length) != 1 or not 0 < length[0] <= 64 or len(names) % int(length[0]):
            raise ValueError("a struct without names")
        step = int(length[0])
        return [
            names[k : k + step].split(b"\0")[0].decode("ascii") for k in range(0, len(names), step)
        ]

    def _text(self, shape: list[int]) -> str:
        kind, content = self.element()
        if kind not in _ENCODINGS:
            raise ValueError(f"text of type {kind}")
        if shape[0] > 1:
            raise ValueError("text of several rows")
        encoding = _ENCODINGS[kind]
        return content.decode(
            f"{encoding}-{'le' if self._order == '<' else 'be'}"
            if encoding in ("utf-16", "utf-32")
            else encoding
        )
