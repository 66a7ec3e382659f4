"""Messages collected by topic: from messages of MCAP files and bags to columns of numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aerodb.recording import Damage, Topic
from aerodb.storage.readers.mcap_messages import (
    MOST_NAMES,
    MessageContent,
    MessageError,
    Reader,
    Values,
)

#: Header stamps that differ from the recorder's clock by more than this [s] are from another clock.
_CLOCKS_APART = 60.0


@dataclass
class Series:
    """Messages collected for one topic.

    Log times [ns], header stamps [ns] (0 if absent) and values per message; all names found, the
    length of each sequence and the names of sequences whose length changes; omitted fields; and the
    number of values that were not finite.
    """

    log_times: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    values: list[Values] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    lengths: dict[str, int] = field(default_factory=dict)
    varying: set[str] = field(default_factory=set)
    skipped: set[str] = field(default_factory=set)
    not_finite: int = 0

    def add(self, log_time: int, numbers: MessageContent) -> None:
        """Add a message; MessageError if it has more names than a topic may have."""
        names = numbers.names()
        if not names <= self.names:
            names |= self.names
            if len(names) > MOST_NAMES:
                raise MessageError(f"more than {MOST_NAMES} fields in the topic")
            self.names = names
        self.log_times.append(log_time)
        self.stamps.append(numbers.stamp)
        self.values.append(numbers.values)
        self.varying |= {
            name for name, n in numbers.lengths.items() if self.lengths.setdefault(name, n) != n
        }
        self.skipped |= numbers.skipped
        self.not_finite += numbers.not_finite


@dataclass
class Collected:
    """Messages collected so far: by topic; those that could not be read, by topic and reason; the
    first and the last log time [ns]; and how many were met."""

    series: dict[str, Series] = field(default_factory=dict)
    unread: Counter[tuple[str, str]] = field(default_factory=Counter)
    first: int | None = None
    last: int | None = None
    seen: int = 0

    def take(self, topic: str, log_time: int, reader: Reader | str, data: bytes) -> None:
        """Add a message; reader : of its topic, or the reason why there is none.

        ValueError for a time that is out of range.
        """
        if not 0 <= log_time < 2**63:
            raise ValueError("its time is out of range")
        self.seen += 1
        self.first = log_time if self.first is None else min(self.first, log_time)
        self.last = log_time if self.last is None else max(self.last, log_time)
        if isinstance(reader, str):
            self.unread[topic, reader] += 1
            return
        try:
            numbers = reader(data)
            series = self.series.get(topic) or Series()
            series.add(log_time, numbers)
        except MemoryError:
            raise
        except (
            Exception
        ) as error:  # the reader is made of the file's own text: what it raises is no closed list
            self.unread[topic, f"not decodable ({words_of_error(error)})"] += 1
        else:
            self.series[topic] = series


def words_of_error(error: Exception) -> str:
    """Return why a message cannot be read: the text of a MessageError, else the error's kind."""
    return str(error) if isinstance(error, MessageError) else type(error).__name__


def left_out(found: Mapping[str, Series]) -> dict[str, str]:
    """Fields that cannot be channels, by topic: they are not damaged, but they are not read, and
    this is reported."""
    notes = {
        name: sorted({*s.skipped, *(f"{v} of changing length" for v in s.varying)})
        for name, s in found.items()
    }
    return {
        f"not read: {name}": ", ".join(topics[:4])
        for name, topics in sorted(notes.items())
        if topics
    }


def topics_of(
    found: Mapping[str, Series], unread: Mapping[tuple[str, str], int], start: int
) -> tuple[dict[str, Topic], list[Damage]]:
    """Return topics by name, and what of them is damaged or in an unsupported encoding.

    unread : (topic, reason) -> number of messages. start [ns] : from which times [s] count.
    """
    topics: dict[str, Topic] = {}
    damage = [
        Damage("values", f"{n} messages not read: {why}", topic)
        for (topic, why), n in unread.items()
    ]
    for name, series in sorted(found.items()):
        log_time = np.float64(1e-9) * (np.array(series.log_times, dtype=np.int64) - start)
        stamped = np.float64(1e-9) * (np.array(series.stamps, dtype=np.int64) - start)
        apart = float(np.median(np.abs(stamped - log_time)))
        time = stamped if all(series.stamps) and apart < _CLOCKS_APART else log_time
        if any(series.stamps) and time is log_time:
            damage.append(
                Damage(
                    "time",
                    f"header stamps are {apart:.3g} s off the recorder's clock: log times used",
                    name,
                )
            )
        back = np.flatnonzero(np.diff(time) < 0)
        if len(back):
            where = float(time[back[0]])
            damage.append(
                Damage(
                    "time",
                    f"time runs backwards {len(back)} times, first at {where:.6f} s",
                    name,
                    where,
                    where,
                )
            )
        if series.not_finite:
            what = (
                f"{series.not_finite} numbers are NaN or infinite, which JSON does not"
                " allow: read as missing"
            )
            damage.append(Damage("values", what, name))
        topics[name] = Topic(name, time, _columns(series))
    return topics, damage


def _columns(series: Series) -> dict[str, np.ndarray[Any, Any]]:
    """Values of all messages by field, NaN where a message has none; sequences of changing length
    are not fields."""
    names = dict.fromkeys(name for row in series.values for name in row)
    kept = (
        name
        for name in names
        if not any(c == "[" and name[:k] in series.varying for k, c in enumerate(name))
    )
    return {name: _column([row.get(name, np.nan) for row in series.values]) for name in kept}


def _column(values: Sequence[float | int | bool]) -> np.ndarray[Any, Any]:
    column = np.array(values)
    if (
        column.dtype == np.float64
        and all(type(value) is int for value in values)
        and min(values) >= 0
    ):
        return np.array(values, dtype=np.uint64)  # NumPy takes integers from 2**63 on for floats
    return column
