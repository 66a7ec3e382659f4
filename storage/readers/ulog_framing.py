"""Reading of a ULog file from the first byte to the last, so that no lost byte goes unnoticed.

Two compiled passes over windows of the file: `survey` follows the message headers, counts messages
and finds bytes that belong to no record; `gather` copies the data of each topic into one array. The
file is never in memory as a whole.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import BinaryIO

import numpy as np

from aerodb.errors import InputError
from aerodb.storage.readers.ulog_definitions import Formats, Layout, is_record
from aerodb.storage.readers.ulog_kernels import Bytes, candidate, copy, walk
from aerodb.support import Integers

HEADER_BYTES = 16
_DATA = ord("D")
_WINDOW = 1 << 23
#: Bytes that must be in view behind a position: enough to follow three of the largest messages.
_MARGIN = 3 * (3 + 0xFFFF)


@dataclass(frozen=True)
class Lost:
    """Bytes [start, end) that belong to no record; `tail` if the file ends inside a record.
    `before` and `after` are the timestamps [us] of the nearest data messages, -1 if there is
    none."""

    start: int
    end: int
    tail: bool
    before: int
    after: int


@dataclass(frozen=True)
class Subscription:
    """An announced topic. `layout` is None if its format is damaged; `name` is empty if the
    announcement is damaged."""

    name: str
    instance: int
    layout: Layout | None


@dataclass(frozen=True)
class Survey:
    """Positions of all messages in the file.

    `definitions` holds the messages other than data, in order, with headers. By message id, `count`
    (65536,) is the number of data messages, and `back` (65536, 2) how often their time ran
    backwards and at which timestamp first. `intact` are byte ranges of complete messages;
    `dropouts` are (timestamp before, timestamp after, reported ms).
    """

    definitions: tuple[bytes, ...]
    subscriptions: Mapping[int, Subscription]
    count: Integers
    back: Integers
    intact: tuple[tuple[int, int], ...]
    lost: tuple[Lost, ...]
    dropouts: tuple[tuple[int, int, int], ...]


class _Windows:
    """The file in windows: `view(at, end)` returns an array whose first byte is at file offset
    `base` and which reaches `end`, or at least _MARGIN bytes beyond `at`."""

    def __init__(self, handle: BinaryIO) -> None:
        self._handle, self._buffer = handle, bytearray(_WINDOW)
        self._base, self._filled = 0, 0

    def view(self, at: int, end: int) -> tuple[Bytes, int]:
        loaded = self._base + self._filled
        if at < self._base or (loaded < end and loaded < at + _MARGIN):
            self._handle.seek(at)
            self._base, self._filled = at, self._handle.readinto(self._buffer)  # type: ignore[attr-defined]
        length = min(self._filled, end - self._base)
        return np.frombuffer(self._buffer, dtype=np.uint8, count=max(length, 0)), self._base


@dataclass
class _Surveyor:
    """State of a survey: tables by message id, and the results so far."""

    windows: _Windows
    formats: Formats = field(default_factory=Formats)
    low: Integers = field(default_factory=lambda: np.full(65536, -1, dtype=np.int64))
    high: Integers = field(default_factory=lambda: np.full(65536, -1, dtype=np.int64))
    stamp: Integers = field(default_factory=lambda: np.full(65536, -1, dtype=np.int64))
    count: Integers = field(default_factory=lambda: np.zeros(65536, dtype=np.int64))
    latest: Integers = field(default_factory=lambda: np.zeros(65536, dtype=np.int64))
    back: Integers = field(default_factory=lambda: np.zeros((65536, 2), dtype=np.int64))
    subscriptions: dict[int, Subscription] = field(default_factory=dict)
    definitions: list[bytes] = field(default_factory=list)
    intact: list[tuple[int, int]] = field(default_factory=list)
    lost: list[Lost] = field(default_factory=list)
    dropouts: list[tuple[int, int, int]] = field(default_factory=list)
    last: int = -1

    def segment(self, at: int, end: int, is_file_end: bool) -> None:
        """Follow the messages of [at, end)."""
        good = at
        while at < end:
            block, base = self.windows.view(at, end)
            tables = (self.low, self.high, self.stamp, self.count, self.latest, self.back)
            here, self.last = walk(block, at - base, *tables, self.last)
            if base + here > at:
                at = base + here
                continue
            follows = self._take(at, end)
            if follows > at:
                at = follows
                continue
            resumed = self._resume(at + 1, end)
            self.intact.append((good, at))
            at, gone = (end, at) if resumed is None else (resumed, at)
            self.lost.append(
                Lost(gone, at, is_file_end and resumed is None, self.last, self._stamp_at(at, end))
            )
            good = at
        self.intact.append((good, end))

    def _message(self, at: int, end: int) -> tuple[int, bytes] | None:
        """Type and body of the message at `at`; None if it does not fit before `end`."""
        block, base = self.windows.view(at, end)
        head = block[at - base : at - base + 3]
        if len(head) < 3:
            return None
        size = int(head[0]) + 256 * int(head[1])
        body = block[at - base + 3 : at - base + 3 + size].tobytes()
        return (int(head[2]), body) if len(body) == size else None

    def _is_valid(self, kind: int, body: bytes) -> bool:
        if kind != _DATA:
            return is_record(kind, body)
        identity = int.from_bytes(body[:2], "little")
        return len(body) >= 2 and 0 <= self.low[identity] <= len(body) - 2 <= self.high[identity]

    def _chain(self, at: int, end: int) -> bool:
        """Return whether two valid messages follow from `at`, or one data message and then the
        (possibly truncated) end."""
        for links in range(2):
            message = self._message(at, end)
            if message is None:
                return links > 0
            if not self._is_valid(*message):
                return False
            at += 3 + len(message[1])
            if at == end:
                return True
        return True

    def _resume(self, at: int, end: int) -> int | None:
        """The next position from which messages follow each other again; None if there is none
        before `end`."""
        while at < end:
            block, base = self.windows.view(at, end)
            offset = candidate(block, at - base, self.low, self.high)
            if offset < 0:
                if base + len(block) >= end:
                    return None
                at = max(at + 1, base + len(block) - _MARGIN + 1)
            elif self._chain(base + offset, end):
                return base + int(offset)
            else:
                at = base + int(offset) + 1
        return None

    def _stamp_at(self, at: int, end: int) -> int:
        """Timestamp of the first data message from `at` on, among the next few messages; -1 if
        there is none."""
        for _ in range(8):
            message = self._message(at, end)
            if message is None:
                break
            kind, body = message
            if kind == _DATA and self._is_valid(kind, body):
                place = int(self.stamp[int.from_bytes(body[:2], "little")])
                stamp = (
                    int.from_bytes(body[2 + place : 10 + place], "little", signed=True)
                    if place >= 0
                    else 0
                )
                if stamp > 0:
                    return stamp
            at += 3 + len(body)
        return -1

    def _take(self, at: int, end: int) -> int:
        """Process the message at `at`; returns its end, or `at` if it is damaged."""
        message = self._message(at, end)
        if message is None:
            return at
        kind, body = message
        follows = at + 3 + len(body)
        if kind == _DATA:
            return follows if self._is_unannounced(body, follows, end) else at
        if not is_record(kind, body):
            return at
        if chr(kind) == "O":
            self.dropouts.append(
                (self.last, self._stamp_at(follows, end), int.from_bytes(body, "little"))
            )
        elif chr(kind) not in "SR":
            if chr(kind) == "F":
                self.formats.add(body.decode("ascii"))
            if chr(kind) != "A" or self._announce(body):
                self.definitions.append(len(body).to_bytes(2, "little") + bytes([kind]) + body)
        return follows

    def _announce(self, body: bytes) -> bool:
        """Add a topic to the tables; returns False if it cannot be decoded or its id is already in
        use."""
        identity, name = int.from_bytes(body[1:3], "little"), body[3:].decode("ascii", "replace")
        if identity in self.subscriptions:
            return False
        layout = self.formats.layout(name)
        self.subscriptions[identity] = Subscription(name, body[0], layout)
        self.low[identity], self.high[identity] = (
            (layout.trimmed, layout.full) if layout else (0, 0xFFFF)
        )
        self.stamp[identity] = layout.stamp if layout else -1
        return layout is not None

    def _is_unannounced(self, body: bytes, follows: int, end: int) -> bool:
        """Return whether this is valid data of a topic whose announcement was lost: its id is new,
        and it is followed by valid messages or by more of its own."""
        identity = int.from_bytes(body[:2], "little")
        if len(body) < 10 or identity in self.subscriptions:
            return False
        self.low[identity] = self.high[identity] = len(body) - 2
        if follows != end and not self._chain(follows, end):
            self.low[identity] = self.high[identity] = -1
            return False
        self.subscriptions[identity] = Subscription("", 0, None)
        self.count[identity] += 1
        return True


def survey(handle: BinaryIO, size: int, appended: Iterable[int] = ()) -> Survey:
    """Walk through the messages of an open ULog file of `size` [bytes], from its header to its end.

    `appended` are the offsets at which data were appended after a crash: a record that is truncated
    at such an offset does not hide the following ones.
    """
    surveyor = _Surveyor(_Windows(handle))
    edges = [HEADER_BYTES, *(offset for offset in appended if HEADER_BYTES < offset < size), size]
    for start, end in pairwise(edges):
        surveyor.segment(start, end, end == size)
    return Survey(
        definitions=tuple(surveyor.definitions),
        subscriptions=surveyor.subscriptions,
        count=surveyor.count,
        back=surveyor.back,
        intact=tuple((a, b) for a, b in surveyor.intact if b > a),
        lost=tuple(surveyor.lost),
        dropouts=tuple(surveyor.dropouts),
    )


def gather(handle: BinaryIO, survey: Survey, wanted: Iterable[int]) -> dict[int, Bytes]:
    """Return the data of the `wanted` message ids, by id: records without padding, one after
    another, as uint8 (n,). Raises InputError where the log changed since its survey."""
    take, cursor, limit = (np.zeros(65536, dtype=np.int64) for _ in range(3))
    total = 0
    for identity in wanted:
        layout = survey.subscriptions[identity].layout
        if layout is not None:
            take[identity], cursor[identity] = layout.trimmed, total
            total += layout.trimmed * int(survey.count[identity])
            limit[identity] = total
    starts, flat = cursor.copy(), np.empty(total, dtype=np.uint8)
    windows = _Windows(handle)
    for at, end in survey.intact:
        while at < end:
            block, base = windows.view(at, end)
            reached = base + int(copy(block, at - base, take, cursor, limit, flat))
            if reached == at:
                raise InputError(
                    "the log changed while it was read",
                    handle.name,
                    "read the log again when it is complete",
                )
            at = reached
    return {int(k): flat[starts[k] : cursor[k]] for k in np.flatnonzero(take)}
