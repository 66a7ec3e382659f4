"""A ULog that is being written: bytes as they arrive, and the last seconds as a `Recording`.

For a pipe, which has no end to read first and cannot be read twice (`following` gives its bytes).
Memory holds the definitions,
and the data since `forget`. The framing is that of `ulog_framing`: messages that are no records are
passed over byte by byte until records follow again.
"""

import math
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pyulog import ULog

from aerodb.errors import InputError
from aerodb.recording import Recording, Topic
from aerodb.storage.readers.ulog import check_header, metadata_of, parse_definitions, places_of
from aerodb.storage.readers.ulog_definitions import Formats, is_record
from aerodb.storage.readers.ulog_framing import HEADER_BYTES, Subscription, Survey
from aerodb.storage.readers.ulog_topics import TopicRecords

_KINDS = frozenset(b"ABCDFILMOPQRS")
_DATA = ord("D")
#: Largest message [bytes] other than data that is waited for after damage.
_PATIENCE = 2000
#: Longest time between samples that is believed [s].
_LONGEST_PAUSE = 3600.0
#: Most bytes read at a time [bytes]: about half a second of a usual log, so that samples come soon.
_PIECE = 1 << 16
#: Time between two looks at a file for more [s]: short beside the flush of a logger.
_GLANCE = 0.2


class UlogStream:
    """The log of this name, so far.

    `size` : bytes taken. `lost` : bytes that belong to no record. `first`, `latest` : times of the
    data so far [s], NaN before there are any.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._pending, self._head = bytearray(), b""
        self._formats = Formats()
        self._definitions: list[bytes] = []
        self._subscriptions: dict[int, Subscription] = {}
        self._data: dict[int, bytearray] = {}
        self._parsed: tuple[ULog, dict[str, TopicRecords]] | None = None
        self._in_step = True
        self.size = self.lost = 0
        self.first = self.latest = float("nan")

    def feed(self, data: bytes) -> None:
        """Take the bytes that follow. Raises InputError if the first are not those of a ULog
        (`check_header`)."""
        self.size += len(data)
        self._pending += data
        at = 0
        if not self._head:
            if len(self._pending) < HEADER_BYTES:
                return
            self._head, at = bytes(self._pending[:HEADER_BYTES]), HEADER_BYTES
            check_header(self._head, self.size, Path(self._source))
        pending, n = self._pending, len(self._pending)
        while n - at >= 5:
            end = at + 3 + pending[at] + 256 * pending[at + 1]
            begins = self._begins(at, end)
            if begins and end > n:
                break
            # Out of step, a record counts only if another may follow it.
            follows = self._in_step or end + 3 > n or pending[end + 2] in _KINDS
            if begins and follows and self._take(pending[at + 2], bytes(pending[at + 3 : end])):
                at, self._in_step = end, True
            else:
                at, self._in_step, self.lost = at + 1, False, self.lost + 1
        del pending[:at]

    def _begins(self, at: int, end: int) -> bool:
        """Return whether a message may begin at `at` and reach to `end`, by its first five
        bytes."""
        kind = self._pending[at + 2]
        if kind != _DATA:
            return kind in _KINDS and (self._in_step or end - at < _PATIENCE)
        known = self._subscriptions.get(self._pending[at + 3] + 256 * self._pending[at + 4])
        if known is None or known.layout is None:
            return known is not None and self._in_step
        return known.layout.trimmed <= end - at - 5 <= known.layout.full

    def _take(self, kind: int, body: bytes) -> bool:
        """Process a message; false if it is no record."""
        if kind == _DATA:
            return self._sample(body)
        if not is_record(kind, body):
            return False
        if kind in b"FAIPMQB":
            if kind == ord("F"):
                self._formats.add(body.decode("ascii"))
            if kind != ord("A") or self._announce(body):
                self._definitions.append(len(body).to_bytes(2, "little") + bytes([kind]) + body)
                self._parsed = None
        return True

    def _announce(self, body: bytes) -> bool:
        identity, name = int.from_bytes(body[1:3], "little"), body[3:].decode("ascii", "replace")
        if identity in self._subscriptions:
            return False
        layout = self._formats.layout(name)
        self._subscriptions[identity] = Subscription(name, body[0], layout)
        return layout is not None

    def _sample(self, body: bytes) -> bool:
        identity = int.from_bytes(body[:2], "little")
        layout = self._subscriptions[identity].layout
        if layout is None or layout.stamp < 0:
            return True
        if identity not in self._data:
            self._data[identity], self._parsed = bytearray(), None
        self._data[identity] += body[2 : 2 + layout.trimmed]
        self._note(int.from_bytes(body[2 + layout.stamp : 10 + layout.stamp], "little") * 1e-6)
        return True

    def _note(self, stamp: float) -> None:
        """Note the time of a sample; a jump by more than an hour is a damaged stamp."""
        if math.isnan(self.latest):
            self.first = self.latest = stamp
        elif self.latest < stamp < self.latest + _LONGEST_PAUSE:
            self.latest = stamp

    def recording(self) -> Recording:
        """Return the data since `forget`, times [s] and fields (n,); topics without any are left
        out."""
        log, places = self._definition()
        topics = {}
        for name, place in places.items():
            records = np.frombuffer(bytes(self._data[place.identity]), dtype=place.record)
            if len(records):
                fields = {f: records[f] for f in records.dtype.names or () if f != "timestamp"}
                topics[name] = Topic(name, records["timestamp"] * 1e-6, fields)
        metadata = metadata_of(log)
        is_px4 = metadata.get("sys_name") == "PX4" or "sensor_combined" in places
        return Recording(
            self._source, "ulog", "", self.size, topics, metadata, layout="px4" if is_px4 else ""
        )

    def _definition(self) -> tuple[ULog, dict[str, TopicRecords]]:
        if self._parsed is None:
            count = np.zeros(65536, dtype=np.int64)
            count[list(self._data)] = 1
            seen = Survey(
                tuple(self._definitions),
                self._subscriptions,
                count,
                np.zeros((0, 2), dtype=np.int64),
                (),
                (),
                (),
            )
            log = parse_definitions(self._head, seen, Path(self._source))
            self._parsed = log, places_of(log, seen, None)
        return self._parsed

    def forget(self, before: float) -> None:
        """Let go of the data (samples of all topics) before this time [s] of the log; `recording`
        begins there."""
        for place in self._definition()[1].values():
            data = self._data[place.identity]
            stamps = np.frombuffer(bytes(data), dtype=place.record)["timestamp"]
            del data[: place.record.itemsize * int(np.searchsorted(stamps, before * 1e6))]


def following(source: str, idle: float) -> Iterator[bytes]:
    """Yield the bytes of a log that is being written, as they arrive.

    source : a pipe or a file; ``-`` is standard input. idle : time [s] without growth after which a
    file counts as complete; a pipe is complete when its writer closes it. Raises InputError where
    it cannot be opened.
    """
    try:
        descriptor = (
            0 if source == "-" else os.open(source, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        )
        waits = stat.S_ISREG(os.fstat(descriptor).st_mode)
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", source, "check the path") from error
    try:
        grew = time.monotonic()
        while True:
            piece = os.read(descriptor, _PIECE)
            if piece:
                grew = time.monotonic()
                yield piece
            elif waits and time.monotonic() - grew < idle:
                time.sleep(_GLANCE)
            else:
                return
    finally:
        if descriptor:
            os.close(descriptor)
