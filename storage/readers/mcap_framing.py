"""Record-by-record reading of an MCAP file, so that damage costs only the affected records.

The mcap package raises at the first error and gives up the rest of the file. Here each top-level
record is checked separately, chunks are decompressed one by one and checked against their
checksums, and after invalid bytes reading resumes at the next record. Source: MCAP specification
(mcap.dev/spec).
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
#: A chunk that claims more than this is damaged: recorders write a few megabytes.
LARGEST_CHUNK = 1 << 30
_SEARCH = 1 << 20


@dataclass(frozen=True)
class McapRecord:
    """A record at file offset `start`; its content ends at `end`."""

    opcode: int
    start: int
    end: int


@dataclass(frozen=True)
class Hole:
    """Bytes [start, end) that belong to no record; `tail` if nothing follows them."""

    start: int
    end: int
    tail: bool


@dataclass(frozen=True)
class Chunk:
    """Records of a chunk, decompressed; times of its first and last message [ns]; `fault` says why
    `data` may be incomplete."""

    first: int
    last: int
    data: bytes
    fault: str = ""


def walk(handle: BinaryIO, size: int) -> Iterator[McapRecord | Hole]:
    """Yield the records of an open file of `size` [bytes], from after its magic bytes to the end,
    and the holes between them."""
    at = len(MAGIC)
    while at < size:
        record = _record(handle, at, size)
        if record is None:
            start = _resume(handle, at + 1, size)
            yield Hole(at, size if start is None else start, start is None)
            if start is None:
                return
            at = start
            continue
        yield record
        at = record.end
        if record.opcode == Opcode.FOOTER:
            handle.seek(at)
            if handle.read(len(MAGIC)) != MAGIC:
                yield Hole(at, size, True)
            return
    yield Hole(size, size, True)


def _record(handle: BinaryIO, at: int, size: int) -> McapRecord | None:
    """The record at `at`; None if its header or inner lengths contradict each other or the file."""
    handle.seek(at)
    head = handle.read(_HEAD.size + 64)
    if len(head) < _HEAD.size:
        return None
    opcode, length = _HEAD.unpack_from(head)
    end = at + _HEAD.size + length
    if end > size or not _is_plausible(opcode, length, head[_HEAD.size :]):
        return None
    return McapRecord(opcode, at, end)


def _is_plausible(opcode: int, length: int, content: bytes) -> bool:
    """Return whether the length of a record fits its type; `content` is its first bytes."""
    exact = {Opcode.FOOTER: 20, Opcode.DATA_END: 4, Opcode.SUMMARY_OFFSET: 17}
    if opcode in exact:
        return length == exact[Opcode(opcode)]
    if opcode == Opcode.MESSAGE:
        return length >= 22
    if opcode == Opcode.MESSAGE_INDEX:
        return len(content) >= 6 and length == 6 + struct.unpack_from("<I", content, 2)[0]
    if opcode == Opcode.CHUNK:
        name = struct.unpack_from("<I", content, 28)[0] if len(content) >= 32 else 99
        if name > 4 or len(content) < 40 + name:
            return False
        return bool(length == 40 + name + struct.unpack_from("<Q", content, 32 + name)[0])
    return 1 <= opcode <= 15 or opcode >= 0x80  # above: private records, which readers skip


def _resume(handle: BinaryIO, at: int, size: int) -> int | None:
    """The next offset at which three consecutive records follow (fewer only at the end of the
    file)."""
    while at < size:
        handle.seek(at)
        block = np.frombuffer(handle.read(_SEARCH + 8), dtype=np.uint8)
        # An opcode, and a length below 2**40.
        likely = (
            (block[:-8] >= 1)
            & (block[:-8] <= 15)
            & (block[6:-2] == 0)
            & (block[7:-1] == 0)
            & (block[8:] == 0)
        )
        for k in np.flatnonzero(likely):
            if _chain(handle, at + int(k), size):
                return at + int(k)
        at += _SEARCH
    return None


def _chain(handle: BinaryIO, at: int, size: int) -> bool:
    for _ in range(3):
        record = _record(handle, at, size)
        if record is None:
            return False
        if record.opcode == Opcode.FOOTER:
            return True
        at = record.end
    return True


def read_content(handle: BinaryIO, record: McapRecord) -> bytes:
    """The content of a record, without opcode and length."""
    handle.seek(record.start + _HEAD.size)
    return handle.read(record.end - record.start - _HEAD.size)


def open_chunk(content: bytes) -> Chunk:
    """Return a chunk, complete or truncated, decompressed as far as possible; records of a chunk
    with a wrong checksum (CRC-32) are not returned. No error is raised: `Chunk` says what is wrong;
    times are in [ns]."""
    if len(content) < _CHUNK.size:
        return Chunk(0, 0, b"", "cut in its header")
    first, last, expected, crc, name = _CHUNK.unpack_from(content)
    compression, packed = content[32 : 32 + name], content[40 + name :]
    if expected > LARGEST_CHUNK or name > 4:
        return Chunk(first, last, b"", f"declares {expected} bytes")
    try:
        data = _decompress(compression, packed)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError) as error:
        return Chunk(first, last, b"", f"cannot be decompressed: {error}")
    if len(data) != expected:
        return Chunk(first, last, data[:expected], f"{len(data)} of {expected} bytes")
    if crc and zlib.crc32(data) != crc:
        return Chunk(first, last, b"", "fails its checksum")
    return Chunk(first, last, data)


def _decompress(compression: bytes, packed: bytes) -> bytes:
    """Decompress as much of `packed` as possible; a truncated stream gives its intact beginning."""
    if compression == b"zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    if compression == b"lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, LARGEST_CHUNK))
    if compression == b"":
        return packed
    raise ValueError(f"unknown compression {compression!r}")


def inner_records(data: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Opcode, content and end offset of each complete record in the decompressed chunk `data`."""
    at = 0
    while at + _HEAD.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        start, at = at + _HEAD.size, at + _HEAD.size + length
        if at > len(data):
            return
        yield opcode, data[start:at], at
