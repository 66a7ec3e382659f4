"""Bags of ROS 1 (``.bag``, format 2.0) and of ROS 2 in SQLite (``.db3``).

Both are read record by record with what they define themselves; bags of ROS 2 before Iron define no
messages, and of those the common types are known (`ros_types`). Sources: wiki.ros.org/Bags/Format,
the schema of rosbag2_storage_sqlite3.
"""

import bz2
import hashlib
import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, Final
from urllib.parse import quote

import lz4.frame
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording
from aerodb.storage.readers.mcap_framing import LARGEST_CHUNK
from aerodb.storage.readers.mcap_messages import Reader, message_reader
from aerodb.storage.readers.mcap_px4 import px4_topics
from aerodb.storage.readers.message_series import Collected, left_out, topics_of, words_of_error
from aerodb.storage.readers.missing_samples import missing_by_topic
from aerodb.storage.readers.ros1_messages import ros1_reader
from aerodb.storage.readers.ros_types import definition_of

_MAGIC: Final = b"#ROSBAG V2.0\n"
_LENGTH: Final = struct.Struct("<I")
_REMEDY: Final = "check that the transfer was complete, or repair it: rosbag reindex, rosbag fix"
_CONVERT: Final = (
    "convert it where its packages are installed: mcap convert, or ros2 bag convert to mcap"
)
#: Kinds of records of a bag.
_MESSAGE, _CHUNK, _CHUNK_INFO, _CONNECTION = 0x02, 0x05, 0x06, 0x07
#: Most rows of names in a bag: topics and definitions.
_MOST_TOPICS: Final = 10_000


@dataclass
class _Bag(Collected):
    """A reading of a bag of ROS 1: connections so far, and messages that its chunks count."""

    connections: dict[int, tuple[str, str, Reader | str]] = field(default_factory=dict)
    counted: int = 0
    damage: list[Damage] = field(default_factory=list)


def read_rosbag1(path: Path) -> Recording:
    """Read a bag of ROS 1: topics and fields as `read_mcap` gives them; times [s] since the first
    message.

    InputError if nothing in it can be read. Damage says how many bytes, or messages, are lost.
    """
    bag = _Bag()
    with path.open("rb") as handle:
        size = path.stat().st_size
        handle.seek(len(_MAGIC))
        _records(handle, size, bag)
        handle.seek(0)
        sha256 = hashlib.file_digest(handle, "sha256").hexdigest()
    if bag.counted > bag.seen and not bag.damage:
        what = f"{bag.seen} messages are present, but the chunks of the bag count {bag.counted}"
        bag.damage.append(Damage("values", what))
    schemas = {topic: kind for topic, kind, _ in bag.connections.values()}
    return _recording(path, size, sha256, bag, schemas, bag.damage, _REMEDY)


def _records(handle: BinaryIO, size: int, bag: _Bag) -> None:
    """Read the records of an open bag until its end, or until one that is none."""
    at = handle.tell()
    while at < size:
        try:
            fields, begin, length = _record(handle, at, size)
        except ValueError as error:
            lost = size - at
            what = f"the bag cannot be followed from byte {at} ({error}): {lost} bytes"
            bag.damage.append(Damage("lost_tail", what, "", bytes_lost=lost))
            return
        operation = fields.get(b"op", b"\xff")[0]
        if operation in (_MESSAGE, _CONNECTION):
            handle.seek(begin)
            _take(bag, operation, fields, handle.read(length))
        elif operation == _CHUNK:
            handle.seek(begin)
            _chunk(bag, fields, handle.read(length), at)
        elif operation == _CHUNK_INFO:
            handle.seek(begin)
            counts = handle.read(min(length, 8 * _MOST_TOPICS))
            whole = counts[: len(counts) // 8 * 8]
            bag.counted += sum(count for _, count in struct.iter_unpack("<II", whole))
        at = begin + length


def _record(handle: BinaryIO, at: int, size: int) -> tuple[dict[bytes, bytes], int, int]:
    """Fields of the header of a record, and place and length of its data."""
    handle.seek(at)
    head = _prefixed(handle, at, size)
    begin = at + 2 * _LENGTH.size + len(head)
    stated = handle.read(_LENGTH.size)
    if len(stated) < _LENGTH.size:
        raise ValueError("it ends inside a record")
    (length,) = _LENGTH.unpack(stated)
    if begin + length > size:
        raise ValueError("it ends inside a record")
    return dict(_fields(head)), begin, length


def _prefixed(handle: BinaryIO, at: int, size: int) -> bytes:
    stated = handle.read(_LENGTH.size)
    if len(stated) < _LENGTH.size:
        raise ValueError("it ends inside a record")
    (length,) = _LENGTH.unpack(stated)
    if at + _LENGTH.size + length > size or length > 1 << 20:
        raise ValueError("it ends inside a record")
    return handle.read(length)


def _fields(head: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and values of a header."""
    at = 0
    while at < len(head):
        if at + _LENGTH.size > len(head):
            raise ValueError("a damaged record")
        (length,) = _LENGTH.unpack_from(head, at)
        name, sign, value = head[at + 4 : at + 4 + length].partition(b"=")
        if at + 4 + length > len(head) or not sign or (not value and name == b"op"):
            raise ValueError("a damaged record")
        yield name, value
        at += 4 + length


def _chunk(bag: _Bag, fields: Mapping[bytes, bytes], packed: bytes, at: int) -> None:
    """Read the records of a chunk; what is damaged in it is lost and said."""
    try:
        data = _unpacked(fields.get(b"compression", b"none"), packed)
    except (OSError, RuntimeError, ValueError, EOFError) as error:
        what = f"a chunk at byte {at} cannot be unpacked ({error}): {len(packed)} bytes"
        bag.damage.append(Damage("framing", what, "", bytes_lost=len(packed)))
        return
    inner = 0
    while inner < len(data):
        try:
            head_end = inner + 4 + _LENGTH.unpack_from(data, inner)[0]
            (length,) = _LENGTH.unpack_from(data, head_end)
            end = head_end + 4 + length
            if end > len(data):
                raise ValueError("it ends inside a record")
            head = dict(_fields(data[inner + 4 : head_end]))
        except (struct.error, ValueError) as error:
            lost = len(data) - inner
            what = f"a chunk at byte {at} is damaged ({error}): {lost} bytes of its messages"
            bag.damage.append(Damage("framing", what, "", bytes_lost=lost))
            return
        _take(bag, head.get(b"op", b"\xff")[0], head, data[head_end + 4 : end])
        inner = end


def _unpacked(compression: bytes, packed: bytes) -> bytes:
    if compression == b"none":
        return packed
    if compression == b"bz2":
        return bz2.BZ2Decompressor().decompress(packed, LARGEST_CHUNK)
    if compression == b"lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, LARGEST_CHUNK))
    raise ValueError(f"unknown compression {compression[:20]!r}")


def _take(bag: _Bag, operation: int, fields: Mapping[bytes, bytes], data: bytes) -> None:
    """Process a message or a connection."""
    try:
        (number,) = _LENGTH.unpack(fields.get(b"conn", b""))
        if operation == _CONNECTION:
            _connect(bag, number, fields, dict(_fields(data)))
        elif operation == _MESSAGE:
            seconds, rest = struct.unpack("<II", fields.get(b"time", b""))
            topic, _, reader = bag.connections.get(number, ("", "", "their topic is not defined"))
            bag.take(topic, seconds * 10**9 + rest, reader, data)
    except (struct.error, ValueError) as error:
        bag.unread["", f"a damaged record ({words_of_error(error)})"] += 1


def _connect(
    bag: _Bag, number: int, fields: Mapping[bytes, bytes], defined: Mapping[bytes, bytes]
) -> None:
    if number in bag.connections or len(bag.connections) >= _MOST_TOPICS:
        return
    topic, kind, text = (
        value.decode("utf-8", "replace")
        for value in (
            fields.get(b"topic", b""),
            defined.get(b"type", b""),
            defined.get(b"message_definition", b""),
        )
    )
    reader: Reader | str
    try:
        reader = ros1_reader(kind, text)
    except (ValueError, RecursionError, Exception) as error:  # made of the file's own text
        reader = f"their definition cannot be read ({words_of_error(error)})"
    bag.connections[number] = (topic, kind, reader)


def read_rosbag2(path: Path) -> Recording:
    """Read a bag of ROS 2 in SQLite: topics and fields as `read_mcap` gives them; times [s] since
    the first message.

    InputError if it is no bag, or nothing in it can be read; a type that is not defined in the bag
    and not a common one is said with its topic.
    """
    collected, damage = Collected(), list[Damage]()
    kinds: dict[str, str] = {}
    place = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(place, uri=True)) as bag:
            bag.execute("PRAGMA trusted_schema = OFF")
            readers = _readers(bag, str(path), kinds)
            try:
                _messages(bag, readers, collected)
            except sqlite3.Error as error:
                damage.append(Damage("framing", f"the bag cannot be read further: {error}"))
            if not damage and (wrong := bag.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
                damage.append(Damage("framing", f"the database is damaged: {str(wrong)[:200]}"))
    except sqlite3.Error as error:
        raise InputError(f"not readable as a bag of ROS 2: {error}", str(path), _CONVERT) from error
    with path.open("rb") as handle:
        sha256 = hashlib.file_digest(handle, "sha256").hexdigest()
    return _recording(path, path.stat().st_size, sha256, collected, kinds, damage, _CONVERT)


def _readers(
    bag: sqlite3.Connection, where: str, kinds: dict[str, str]
) -> dict[int, tuple[str, Reader | str]]:
    """Number of a topic -> its name and the reader of its messages; `kinds` gets their types."""
    tables = {
        name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
    }
    if not {"topics", "messages"} <= tables:
        raise InputError(
            "an SQLite database that is no bag of ROS 2", where, "export its table as CSV"
        )
    texts: dict[str, str] = {}
    if "message_definitions" in tables:
        rows = bag.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        for kind, encoding, text in rows.fetchmany(_MOST_TOPICS):
            if encoding == "ros2msg" and isinstance(kind, str) and isinstance(text, str) and text:
                texts[kind] = text
    factory, found = DecoderFactory(), dict[int, tuple[str, Reader | str]]()
    rows = bag.execute("SELECT id, name, type, serialization_format FROM topics")
    for number, topic, kind, form in rows.fetchmany(_MOST_TOPICS):
        if not (isinstance(number, int) and isinstance(topic, str) and isinstance(kind, str)):
            continue
        kinds[topic] = kind
        text = texts.get(kind) or definition_of(kind)
        if text is None:
            found[number] = topic, f"the bag does not define their type {kind[:80]}"
            continue
        try:
            schema = Schema(number, text.encode(), "ros2msg", kind)
            channel = Channel(number, topic, str(form), {}, number)
            reader = message_reader(channel, schema, factory)
        except MemoryError:
            raise
        except Exception as error:  # made of the file's own text
            found[number] = topic, f"their definition cannot be read ({words_of_error(error)})"
            continue
        found[number] = topic, reader or f"encoding '{str(form)[:20]}' is not supported"
    return found


def _messages(
    bag: sqlite3.Connection, readers: Mapping[int, tuple[str, Reader | str]], collected: Collected
) -> None:
    for number, time, data in bag.execute("SELECT topic_id, timestamp, data FROM messages"):
        topic, reader = readers.get(number, ("", "their topic is not defined"))
        if isinstance(time, int) and isinstance(data, bytes) and 0 <= time < 2**63:
            collected.take(topic, time, reader, data)
        else:
            collected.unread[topic, "a damaged row"] += 1


def _recording(
    path: Path,
    size: int,
    sha256: str,
    collected: Collected,
    kinds: Mapping[str, str],
    losses: list[Damage],
    remedy: str,
) -> Recording:
    """The recording of what was collected; InputError if there is nothing."""
    start = collected.first or 0
    topics, damage = topics_of(collected.series, collected.unread, start)
    if not topics:
        why = "; ".join(f"{topic or 'unknown topic'}: {w}" for topic, w in [*collected.unread][:2])
        told = why or (losses[0].what if losses else "it is empty")
        what = "a bag of ROS 1" if remedy == _REMEDY else "a bag of ROS 2 (SQLite)"
        raise InputError(f"{what}: no message can be read ({told})", str(path), remedy)
    losses = [*losses, *missing_by_topic(topics, losses), *damage]
    topics, named = px4_topics(topics, kinds)
    losses = [replace(loss, topic=named.get(loss.topic, loss.topic)) for loss in losses]
    utc = datetime.fromtimestamp(start * 1e-9, UTC) if 1e18 < start < 1e19 else None
    layout = "px4" if named else "ros2"
    metadata = left_out(collected.series)
    return Recording(
        str(path), "rosbag", sha256, size, topics, metadata, tuple(losses), utc, layout
    )
