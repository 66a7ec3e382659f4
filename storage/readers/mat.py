"""MATLAB's MAT files, version 5 to 7.3, as named arrays and texts.

Version 5-7 is read here and not by scipy.io because a log may be damaged: every declared size is
checked against the available bytes before memory is allocated, and variables before a cut are read.
Version 7.3 is HDF5. Cells, sparse matrices, objects and arrays of structs contain no series of
samples and are listed in `skipped`.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage

#: Deflate cannot expand more than this; what declares more is damaged.
MOST_EXPANSION: Final = 1032
#: Bytes that a file may expand to.
MOST_BYTES: Final = 4 << 30
#: Most variables of a file.
_MOST_VARIABLES: Final = 20_000
#: Most structures or groups inside each other.
_DEEPEST: Final = 8

_STORED: Final = {
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
#: Type of an element that is an array.
_MATRIX: Final = 14
#: Type of an element that is compressed.
_COMPRESSED: Final = 15
#: Class of an array of structures.
_STRUCT: Final = 2
#: Class of an array of characters.
_CHAR: Final = 4
#: Classes of arrays of numbers.
_NUMERIC: Final = range(6, 16)
_UNSHAPED: Final = (16, 17)  # function handles and objects of classes: stored without a shape
_COMPLEX: Final = 0x0800


class Malformed(Exception):
    """Bytes that are not a valid element; caught where the variable is named, never raised to
    callers."""


@dataclass
class Variables:
    """Arrays and texts by dotted name, as stored in the file; names of variables that are not
    arrays; damage."""

    values: dict[str, NDArray[Any] | str] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)

    def add(self, name: str, value: NDArray[Any] | str) -> None:
        """Add one variable; Malformed if there are more than any log has."""
        if len(self.values) >= _MOST_VARIABLES:
            raise Malformed("too many variables")
        self.values[name] = value


def is_mat5(data: bytes) -> bool:
    """Whether the bytes begin like a MAT file of version 5 to 7."""
    return len(data) >= 128 and data[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def read_mat5(data: bytes) -> Variables:
    """Variables of a MAT file of version 5 to 7; a truncated or damaged variable is left out and
    reported."""
    order = "<" if data[126:128] == b"IM" else ">"
    variables = Variables()
    view, position = memoryview(data), 128
    subsystem = struct.unpack(order + "Q", data[116:124])[0]
    while position < len(view):
        try:
            kind, payload, after = _element(view, position, order)
        except Malformed as error:
            what = f"the file ends inside a variable: {error}"
            variables.damage.append(Damage("lost_tail", what, bytes_lost=len(view) - position))
            break
        try:
            if position != subsystem:
                body = _inflate(payload, order) if kind == _COMPRESSED else payload
                if kind not in (_MATRIX, _COMPRESSED):
                    raise Malformed(f"element of type {kind} where a variable should begin")
                _matrix(body, order, "", variables, 0)
        except (Malformed, zlib.error, UnicodeDecodeError, ValueError) as error:
            what = f"variable at byte {position} cannot be read: {error}"
            variables.damage.append(Damage("framing", what, bytes_lost=after - position))
        position = after
    return variables


def _element(view: memoryview, position: int, order: str) -> tuple[int, memoryview, int]:
    """Type, payload and next position of the element at `position`."""
    if position + 8 > len(view):
        raise Malformed("no room for a tag")
    first, size = struct.unpack_from(order + "II", view, position)
    if first >> 16:
        kind, size, start, after = first & 0xFFFF, first >> 16, position + 4, position + 8
        if size > 4:
            raise Malformed("small element of more than four bytes")
    else:
        kind, start = first, position + 8
        after = start + (size if kind == _COMPRESSED else -(-size // 8) * 8)
    if start + size > len(view):
        raise Malformed(f"{size} bytes declared, {len(view) - start} present")
    return kind, view[start : start + size], min(after, len(view))


def _inflate(payload: memoryview, order: str) -> memoryview:
    """The matrix inside a compressed element; its declared size is checked before decompression."""
    unpacker = zlib.decompressobj()
    tag = unpacker.decompress(payload, 8)
    if len(tag) < 8:
        raise Malformed("compressed variable without a tag")
    kind, size = struct.unpack(order + "II", tag)
    if kind != _MATRIX or size > min(MOST_BYTES, MOST_EXPANSION * len(payload)):
        raise Malformed(f"compressed variable declares {size} bytes in {len(payload)}")
    body = unpacker.decompress(unpacker.unconsumed_tail, size) if size else b""
    unpacker.decompress(unpacker.unconsumed_tail, 16)
    if len(body) != size or not unpacker.eof:
        raise Malformed("compressed variable does not have the declared size")
    return memoryview(body)


def _matrix(body: memoryview, order: str, prefix: str, variables: Variables, depth: int) -> None:
    """Add the variable in `body` under its own name, or under `prefix` if it is a member of a
    struct."""
    if not body:
        return
    parts = _elements(body, order)
    flags = np.frombuffer(next(parts)[1], order + "u4", count=1)[0]
    if int(flags & 0xFF) in _UNSHAPED:
        variables.skipped.append(prefix or "an object")
        return
    shape = tuple(int(n) for n in np.frombuffer(next(parts)[1], order + "i4"))
    own = bytes(next(parts)[1]).decode("latin-1")
    name, kind = prefix or own, int(flags & 0xFF)
    if min(shape, default=0) < 0:
        raise Malformed(f"shape {shape} of variable {name}")
    if kind == _STRUCT and shape == (1, 1) and depth < _DEEPEST:
        _struct(parts, order, name, variables, depth)
    elif kind == _CHAR and len(shape) == 2 and shape[0] <= 1:
        stored, raw = next(parts)
        text = bytes(raw).decode(_encoding(stored, order), errors="replace")
        variables.add(name, text)
    elif kind in _NUMERIC and not flags & _COMPLEX:
        stored, raw = next(parts)
        if stored not in _STORED:
            raise Malformed(f"variable {name} stored as unknown type {stored}")
        values = np.frombuffer(raw, order + _STORED[stored])
        variables.add(name, values.reshape(shape, order="F"))
    else:
        variables.skipped.append(name)


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    position = 0
    while position < len(body):
        kind, payload, position = _element(body, position, order)
        yield kind, payload
    raise Malformed("a part is missing")


def _struct(
    parts: Iterator[tuple[int, memoryview]], order: str, name: str, variables: Variables, depth: int
) -> None:
    width = int(np.frombuffer(next(parts)[1], order + "i4", count=1)[0])
    joined = bytes(next(parts)[1])
    if width <= 0 or len(joined) % width:
        raise Malformed(f"field names of struct {name}")
    for start in range(0, len(joined), width):
        member = joined[start : start + width].split(b"\x00")[0].decode("latin-1")
        kind, payload = next(parts)
        if kind != _MATRIX:
            raise Malformed(f"member {member} of struct {name} is not a matrix")
        _matrix(payload, order, f"{name}.{member}", variables, depth + 1)


def _encoding(stored: int, order: str) -> str:
    if stored not in _TEXT:
        raise Malformed(f"text stored as unknown type {stored}")
    wide = _TEXT[stored].startswith("utf-") and stored != 16
    return _TEXT[stored] + (("-le" if order == "<" else "-be") if wide else "")


def read_hdf5(data: bytes, where: str) -> Variables:
    """Variables of a MAT file of version 7.3, or of any HDF5 file: groups as structs, arrays
    transposed (MATLAB stores columns first).

    Raises InputError for bytes that are not HDF5. Arrays (n,) or matrices, in the units of the
    file.
    """
    variables = Variables()
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            _group(file, "", variables, 0)
    except Exception as error:  # h5py passes on errors of many types from the HDF5 library
        raise InputError(
            f"not readable as HDF5: {str(error)[:200]}",
            where,
            "write the log again, or cut it to whole samples",
        ) from error
    return variables


def _group(group: Any, prefix: str, variables: Variables, depth: int) -> None:
    for key in group:
        name = f"{prefix}{key}"
        if key.startswith("#"):
            continue
        try:
            item = group[key]
            if isinstance(item, h5py.Group):
                if depth < _DEEPEST:
                    _group(item, f"{name}.", variables, depth + 1)
                else:
                    variables.skipped.append(name)
            elif _is_array(item):
                _dataset(item, name, variables)
            else:
                variables.skipped.append(name)
        except Exception as error:  # as above; one damaged variable leaves the others
            variables.damage.append(
                Damage("framing", f"variable {name} cannot be read: {str(error)[:120]}")
            )


def _is_array(item: Any) -> bool:
    return (
        isinstance(item, h5py.Dataset)
        and item.dtype.kind in "fiub"
        and item.ndim >= 1
        and "MATLAB_empty" not in item.attrs
    )


def _dataset(item: Any, name: str, variables: Variables) -> None:
    declared, stored = item.size * item.dtype.itemsize, item.id.get_storage_size()
    if declared > min(MOST_BYTES, MOST_EXPANSION * (stored + 64)):
        raise Malformed(f"{declared} bytes declared, {stored} present")
    values = np.asarray(item[()]).T
    if item.attrs.get("MATLAB_class") == b"char":
        variables.add(name, "".join(chr(int(code)) for code in values.ravel(order="F")))
    else:
        variables.add(name, values)
