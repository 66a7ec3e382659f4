"""MCAP reader, for ROS 2, JSON and protobuf messages.

`mcap_messages` converts messages to numbers; `mcap_framing` reads the file record by record and
finds damage. Messages contain no units; the mapping file declares them.
"""

import hashlib
import zlib
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Header, Message, Metadata, Schema, Statistics
from mcap_ros2.decoder import DecoderFactory

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording
from aerodb.storage.readers.mcap_framing import (
    MAGIC,
    Chunk,
    Hole,
    McapRecord,
    inner_records,
    open_chunk,
    read_content,
    walk,
)
from aerodb.storage.readers.mcap_messages import Reader, message_reader
from aerodb.storage.readers.mcap_px4 import px4_topics
from aerodb.storage.readers.message_series import Collected, left_out, topics_of, words_of_error
from aerodb.storage.readers.missing_samples import missing_by_topic

_REMEDY = (
    "check that the transfer was complete; `mcap recover` may still save what this reader could not"
)


_CONVERT = (
    "convert it to ROS 2 messages (cdr): rosbags-convert for ROS 1; else write it as JSON or"
    " protobuf"
)


@dataclass
class _Reading(Collected):
    """State of a reading: definitions so far, messages collected, damage found."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    readers: dict[int, Reader | str] = field(default_factory=dict)
    ros2: DecoderFactory = field(default_factory=DecoderFactory)
    metadata: dict[str, str | int | float] = field(default_factory=dict)
    damage: list[tuple[Hole | Chunk, int, int | None, int | None]] = field(default_factory=list)
    counted: int | None = None
    """Messages that the file's own statistics count."""
    is_foreign: bool = False
    """Whether another program's encoding was met."""

    def record(self, opcode: int, content: bytes) -> None:
        """Process one record; messages whose definition is damaged are lost and counted."""
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.MESSAGE:
            self._message(Message.read(stream, len(content)))
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels.setdefault(channel.id, channel)
        elif opcode == Opcode.HEADER:
            header = Header.read(stream)
            self.metadata |= {"profile": header.profile, "library": header.library}
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            self.metadata |= {
                f"{metadata.name}.{key}": value for key, value in metadata.metadata.items()
            }
        elif opcode == Opcode.STATISTICS:
            self.counted = Statistics.read(stream).message_count

    def _message(self, message: Message) -> None:
        channel = self.channels.get(message.channel_id)
        topic = channel.topic if channel is not None else ""
        self.take(topic, message.log_time, self._reader(message.channel_id), message.data)

    def _reader(self, channel_id: int) -> Reader | str:
        """The reader of a channel's messages, or the reason why there is none."""
        if channel_id not in self.readers:
            self.readers[channel_id] = self._new_reader(channel_id)
        return self.readers[channel_id]

    def _new_reader(self, channel_id: int) -> Reader | str:
        channel = self.channels.get(channel_id)
        if channel is None:
            return f"channel {channel_id} is not defined in what could be read"
        schema = self.schemas.get(channel.schema_id)
        try:
            reader = message_reader(channel, schema, self.ros2)
        except MemoryError:
            raise
        except Exception as error:  # as above
            return f"their schema cannot be parsed ({words_of_error(error)})"
        if reader is None:
            self.is_foreign = True
            kind = f"'{schema.encoding}'" if schema is not None else "no schema"
            known = "only ROS 2 (cdr, ros2msg), json, and protobuf with its descriptors"
            return f"encoding '{channel.message_encoding}' with {kind} is not supported ({known})"
        return reader


def read_mcap(path: Path) -> Recording:
    """Read an MCAP file with ROS 2, JSON or protobuf messages, damaged or not.

    Returns a Recording: nested fields joined by dots (``pose.orientation.x``), arrays as
    ``covariance[0]``, joint states by the name of the joint (``position.elevator``). Times are in s
    since the log time of the first message (`start_utc`); they are the header's stamp
    (``header.stamp``, Foxglove's ``timestamp``) if there is one on the recorder's clock, otherwise
    the log time. Values keep their bits: integers and booleans keep their type if every message has
    one. Damage with an empty topic concerns the file; entries with a topic say which of its
    messages are missing or could not be decoded.

    Raises InputError if the file is not an MCAP file, or contains no readable message. Source: MCAP
    specification.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        if size == 0:
            raise InputError("the file is empty", str(path), _REMEDY)
        if handle.read(len(MAGIC)) != MAGIC:
            raise InputError(
                "not an MCAP file: it does not start with the MCAP magic bytes",
                str(path),
                "name the format, or convert the log",
            )
        reading = _Reading()
        sum_is_wrong = _read_records(handle, size, reading)
        handle.seek(0)
        sha256 = hashlib.file_digest(handle, "sha256").hexdigest()
    start = reading.first or 0
    topics, damage = topics_of(reading.series, reading.unread, start)
    if not topics:
        why = "; ".join(
            f"{topic or 'unknown topic'}: {reason}" for topic, reason in list(reading.unread)[:2]
        )
        remedy = _CONVERT if reading.is_foreign else _REMEDY
        raise InputError(f"no message can be read{f' ({why})' if why else ''}", str(path), remedy)
    losses = [_damage(entry, start) for entry in reading.damage]
    if sum_is_wrong and not losses:
        losses.append(
            Damage(
                "values",
                "the checksum of the data does not match: some bytes differ from those written",
            )
        )
    if (
        reading.counted is not None
        and reading.counted != reading.seen
        and not losses
        and not damage
    ):
        # A chunk whose record type was flipped looks like a private record, which every reader must
        # pass over.
        losses.append(
            Damage(
                "values",
                f"{reading.seen} messages are present, but the file's own statistics count"
                f" {reading.counted}",
            )
        )
    losses += [*missing_by_topic(topics, losses), *damage]
    topics, named = px4_topics(topics, _schemas(reading))
    losses = [replace(loss, topic=named.get(loss.topic, loss.topic)) for loss in losses]
    layout = "ros2" if reading.metadata.get("profile") == "ros2" or _has_ros2(reading) else ""
    layout = "px4" if named else layout
    utc = datetime.fromtimestamp(start * 1e-9, UTC) if 1e18 < start < 1e19 else None  # 2001 to 2286
    metadata = {**reading.metadata, **left_out(reading.series)}
    return Recording(str(path), "mcap", sha256, size, topics, metadata, tuple(losses), utc, layout)


def _schemas(reading: _Reading) -> dict[str, str]:
    """Topic -> name of the type of its messages."""
    return {
        channel.topic: reading.schemas[channel.schema_id].name
        for channel in reading.channels.values()
        if channel.schema_id in reading.schemas
    }


def _has_ros2(reading: _Reading) -> bool:
    return any(schema.encoding.startswith("ros2") for schema in reading.schemas.values())


def _read_records(handle: BinaryIO, size: int, reading: _Reading) -> bool:
    """Read all records into `reading`; returns whether the checksum of the data section, if given,
    is wrong."""
    is_wrong = False
    for record in walk(handle, size):
        before = reading.last
        if isinstance(record, Hole):
            rest = _salvage(handle, record, reading) if record.tail else record
            reading.damage.append((rest, rest.end - rest.start, before, None))
            continue
        if record.opcode == Opcode.CHUNK:
            _read_chunk(record, open_chunk(read_content(handle, record)), reading)
        elif record.opcode in (
            Opcode.HEADER,
            Opcode.SCHEMA,
            Opcode.CHANNEL,
            Opcode.MESSAGE,
            Opcode.METADATA,
            Opcode.STATISTICS,
        ):
            _take(reading, record.opcode, read_content(handle, record))
        elif record.opcode == Opcode.DATA_END:
            stated = DataEnd.read(
                ReadDataStream(BytesIO(read_content(handle, record)))
            ).data_section_crc
            is_wrong = stated != 0 and stated != _crc(handle, record.start)
    return is_wrong


def _crc(handle: BinaryIO, end: int) -> int:
    handle.seek(0)
    crc, left = 0, end
    while left and (block := handle.read(min(left, 1 << 20))):
        crc, left = zlib.crc32(block, crc), left - len(block)
    return crc


def _take(reading: _Reading, opcode: int, content: bytes) -> None:
    try:
        reading.record(opcode, content)
    except MemoryError:
        raise
    except (
        Exception
    ) as error:  # mcap's records raise what struct, str and its streams raise on damaged content
        reading.unread[
            "", f"a damaged {Opcode(opcode).name.lower()} record ({type(error).__name__})"
        ] += 1


def _read_chunk(record: McapRecord, chunk: Chunk, reading: _Reading) -> None:
    reached = 0
    for opcode, content, end in inner_records(chunk.data):
        reached = end
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            _take(reading, opcode, content)
    if chunk.fault or reached < len(chunk.data):
        lost = Hole(record.start, record.end, False) if not chunk.fault else chunk
        reading.damage.append(
            (lost, record.end - record.start, chunk.first or None, chunk.last or None)
        )


def _salvage(handle: BinaryIO, hole: Hole, reading: _Reading) -> Hole:
    """Read the remaining content of a chunk that the end of the file has truncated."""
    content = (
        read_content(handle, McapRecord(Opcode.CHUNK, hole.start, hole.end))
        if hole.end > hole.start + 9
        else b""
    )
    handle.seek(hole.start)
    if handle.read(1) == bytes([Opcode.CHUNK]):
        for opcode, inner, _ in inner_records(open_chunk(content).data):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                _take(reading, opcode, inner)
    return hole


def _damage(entry: tuple[Hole | Chunk, int, int | None, int | None], start: int) -> Damage:
    lost, n, first, last = entry
    begin, end = ((t - start) * 1e-9 if t is not None else None for t in (first, last))
    if isinstance(lost, Chunk):
        return Damage("framing", f"a chunk {lost.fault}: {n} bytes", "", begin, end, n)
    if lost.tail:
        what = f"the file ends without its footer, {n} bytes inside a record at offset {lost.start}"
        return Damage("lost_tail", what, "", begin, end, n)
    return Damage(
        "framing",
        f"bytes that belong to no record: {n} bytes from offset {lost.start}",
        "",
        begin,
        end,
        n,
    )
