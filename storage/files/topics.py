"""Topics of a log as Parquet files, with an exact round trip; read as a whole or on demand."""

from collections import OrderedDict
from collections.abc import ItemsView, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.recording import Topic
from aerodb.storage.files.parquet import (
    Column,
    json_text,
    read_columns,
    read_metadata,
    write_columns,
)

#: Number of topics in the memory cache.
_CACHED: Final = 16


class StoredTopics(Mapping[str, Topic]):
    """Topics of a stored recording by name, read on first access; only the fields used are read.

    folder : of the recording. names : its topics, in the order of their numbers.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._paths = {name: folder / f"{number:04d}.parquet" for number, name in enumerate(names)}
        self._cache: OrderedDict[str, Topic] = OrderedDict()

    def __len__(self) -> int:
        return len(self._paths)

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __contains__(self, name: object) -> bool:
        return name in self._paths

    def __getitem__(self, name: str) -> Topic:
        if name not in self._cache:
            if len(self._cache) >= _CACHED:
                self._cache.popitem(last=False)
            self._cache[name] = _open_topic(self._paths[name])
        self._cache.move_to_end(name)
        return self._cache[name]


class _StoredFields(Mapping[str, NDArray[Any]]):
    """Fields of a stored topic by name; each is a column that is read once."""

    def __init__(self, path: Path, columns: Mapping[str, str]) -> None:
        self._path, self._columns = path, columns
        self._read: dict[str, NDArray[Any]] = {}

    def __len__(self) -> int:
        return len(self._columns)

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._read:
            self._read_in([name])
        return self._read[name]

    def items(self) -> ItemsView[str, NDArray[Any]]:
        """Names and values (n,) in the units of the log. The file is opened once for all columns:
        once for each would take the square of their number."""
        if missing := [name for name in self._columns if name not in self._read]:
            self._read_in(missing)
        return super().items()

    def _read_in(self, names: Sequence[str]) -> None:
        columns = {name: self._columns[name] for name in names}
        values, _ = read_columns(self._path, "topic", columns.values())
        self._read |= {name: values[column] for name, column in columns.items()}


def _open_topic(path: Path) -> Topic:
    plain = read_topic(path, with_fields=False)
    stored = read_metadata(path, "topic")
    fields = _StoredFields(path, dict(zip(stored["fields"], stored["columns"], strict=True)))
    return Topic(plain.name, plain.time, fields, plain.units)


def write_topic(path: Path, topic: Topic) -> None:
    """Write a topic to `path`; dtypes are preserved.

    Time (n,) [s]; fields (n,) in the units of the log.
    """
    time, clock = _compact_time(topic.time)
    # A field's name is the log's own and may be anything: columns carry it where Parquet can, the
    # metadata always does.
    names = _column_names(list(topic.fields), taken={"time"})
    columns = [
        Column(
            "time",
            time,
            {"unit": "us" if clock else "s", "description": "time on the log's monotonic clock"},
        )
    ]
    for column, (name, values) in zip(names, topic.fields.items(), strict=True):
        columns.append(Column(column, values, {"unit": json_text(topic.units.get(name, ""))}))
    metadata = {
        "kind": "topic",
        "name": topic.name,
        "clock": clock,
        "fields": list(topic.fields),
        "columns": names,
        "units": list(topic.units.items()),
    }
    write_columns(path, columns, metadata)


def read_topic(path: Path, with_fields: bool) -> Topic:
    """The topic stored at `path`; without fields, only its time stamps. InputError when it is
    missing or damaged."""
    columns, stored = read_columns(path, "topic", None if with_fields else ["time"])
    time = columns["time"]
    if stored["clock"]:
        time = _CLOCKS[stored["clock"]](time)
    named = zip(stored["fields"], stored["columns"], strict=True)
    fields = {name: columns[column] for name, column in named if with_fields}
    return Topic(stored["name"], time, fields, dict(stored["units"]))


#: The two ways in which readers turn a microsecond counter into seconds; they differ in the last
#: bit.
_CLOCKS = {"divided": lambda ticks: ticks / 1e6, "multiplied": lambda ticks: ticks * 1e-6}


def _compact_time(time: NDArray[np.float64]) -> tuple[NDArray[Any], str]:
    """Time as int64 microseconds if this is exact to the last bit, and the name of the inverse
    conversion; otherwise unchanged."""
    if len(time) and np.all(np.abs(time) < 2**52 / 1e6):  # false for NaN and infinity too
        ticks = np.rint(time * 1e6).astype(np.int64)
        for clock, seconds in _CLOCKS.items():
            if np.array_equal(
                seconds(ticks).view(np.int64), np.ascontiguousarray(time, np.float64).view(np.int64)
            ):
                return ticks, clock
    return time, ""


def _column_names(fields: Sequence[str], taken: set[str]) -> list[str]:
    names = []
    for number, field in enumerate(fields):
        plain = (
            field.isascii() and field.isprintable() and 0 < len(field) <= 200 and field not in taken
        )
        name = field if plain else f"field {number}"
        while name in taken:
            name += "_"
        names.append(name)
        taken.add(name)
    return names
