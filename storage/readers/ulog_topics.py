"""Topics of a ULog file, with a bounded memory cache.

A small log is read at once. Topics of a large log are read on demand; the most recently used stay
in memory, and iterating over all topics in order reads several per pass through the file.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.recording import Topic
from aerodb.storage.readers.ulog_framing import Survey, gather

#: Size of the memory cache [bytes] (one topic alone may be larger); a smaller log is read at once.
CACHE_BYTES = 64_000_000
_TIME_BYTES = 8


@dataclass(frozen=True)
class TopicRecords:
    """Location of the data of a topic: message id, dtype of one record, number of records."""

    identity: int
    record: np.dtype[Any]
    samples: int

    @property
    def size(self) -> int:
        """Memory [bytes] used by the topic, a scalar: records and times (n,)."""
        return self.samples * (self.record.itemsize + _TIME_BYTES)


class LoggedTopics(Mapping[str, Topic]):
    """Topics by name, in the order of their names."""

    def __init__(self, path: Path, survey: Survey, places: Mapping[str, TopicRecords]) -> None:
        self._path, self._survey, self._places = path, survey, places
        # A group is what one pass gathered into one allocation; the last used stands last.
        self._groups: list[dict[str, Topic]] = []
        self._previous = ""
        self._stamp = _stamp(path)

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __getitem__(self, name: str) -> Topic:
        group = next((group for group in self._groups if name in group), None)
        if group is None:
            names = self._together(name)
            # Evicted first, so that old and new topics are not in memory together.
            self._evict(CACHE_BYTES - self._size(names))
            group = self._read(names)
        else:
            self._groups.remove(group)
        self._groups.append(group)
        self._previous = name
        return group[name]

    def _size(self, names: Iterable[str]) -> int:
        return sum(self._places[name].size for name in names)

    def _evict(self, room: int) -> None:
        """Drop the least recently used groups until the cache fits into `room` bytes."""
        while self._groups and sum(self._size(group) for group in self._groups) > room:
            del self._groups[0]

    def _together(self, name: str) -> list[str]:
        """The topics to gather in one pass: all topics of a small log; for access in order, also
        the next ones."""
        names = list(self._places)
        if self._size(names) <= CACHE_BYTES:
            return names
        k = names.index(name)
        if k > 0 and names[k - 1] != self._previous:
            return [name]
        chosen, total = [name], self._places[name].size
        for following in islice(names, k + 1, None):
            total += self._places[following].size
            if total > CACHE_BYTES:
                break
            chosen.append(following)
        return chosen

    def _read(self, names: list[str]) -> dict[str, Topic]:
        try:
            if _stamp(self._path) != self._stamp:
                raise OSError("it changed while it was read")
            with self._path.open("rb") as handle:
                data = gather(handle, self._survey, [self._places[name].identity for name in names])
        except OSError as error:
            what = f"the topics cannot be read: {error.strerror or error}"
            raise InputError(
                what,
                str(self._path),
                "leave the log in place until it is ingested, and ingest it again",
            ) from error
        read = {}
        for name in names:
            records = data[self._places[name].identity].view(self._places[name].record)
            fields = {
                field: records[field] for field in records.dtype.names or () if field != "timestamp"
            }
            read[name] = Topic(name, records["timestamp"] * 1e-6, fields)
        return read


def _stamp(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns
