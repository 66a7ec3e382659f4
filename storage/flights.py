"""The flight store: flights, raw recordings and results as Parquet files, and exactly back again.

Which file belongs to which flight, result or version is the catalogue's business, not this module's.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.flight import Flight
from aerodb.nomenclature import CHANNELS, RESULT_COLUMNS, Channel, channel
from aerodb.recording import Damage, Recording, Topic
from storage.parquet import Column, json_text, read_columns, read_metadata, write_columns
from storage.workspace import write_atomically

_INDEX = "recording.json"


def write_flight(path: Path, flight: Flight) -> None:
    """Stores `flight` at `path`: column ``time``, one per channel, one ``flags_<channel>`` per flagged channel.

    Raises UnknownNameError for a channel that the glossary does not know; then nothing is written.
    """
    columns = [_registered("time", flight.time)]
    columns += [_registered(name, values) for name, values in flight.channels.items()]
    columns += [_registered(f"flags_{name}", bits) for name, bits in flight.flags.items()]
    metadata = {
        "kind": "flight",
        "id": flight.id,
        "vehicle": flight.vehicle,
        "channels": list(flight.channels),
        "flags": list(flight.flags),
        "missing": list(flight.missing),
        "notes": list(flight.notes),
        "damage": [asdict(d) for d in flight.damage],
        "start_utc": _time_text(flight.start_utc),
        "log_sha256": flight.log_sha256,
        "mapping": flight.mapping,
    }
    write_atomically(path, lambda temporary: write_columns(temporary, columns, metadata))


def read_flight(path: Path, channels: Iterable[str] | None = None) -> Flight:
    """The flight stored at `path`, with all channels or only those named (and their flags).

    Raises InputError when there is no such file or it is damaged, UnknownNameError for a channel that it lacks.
    """
    stored = read_metadata(path, "flight")
    known, flags = stored["channels"], stored["flags"]
    if channels is not None:
        wanted = set(channels)
        for name in sorted(wanted - set(known)):
            raise UnknownNameError(f"no channel '{name}'", f"flight {stored['id']}", nearest(name, known))
        known = [name for name in known if name in wanted]
        flags = [name for name in flags if name in wanted or name == "flight"]
    names = ["time", *known, *(f"flags_{name}" for name in flags)]
    columns, _ = read_columns(path, "flight", names)
    return Flight(
        id=stored["id"],
        vehicle=stored["vehicle"],
        time=columns["time"],
        channels={name: columns[name] for name in known},
        flags={name: columns[f"flags_{name}"] for name in flags},
        missing=tuple(stored["missing"]),
        notes=tuple(stored["notes"]),
        damage=tuple(Damage(**d) for d in stored["damage"]),
        start_utc=_time(stored["start_utc"]),
        log_sha256=stored["log_sha256"],
        mapping=stored["mapping"],
    )


def write_results(path: Path, table: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> None:
    """Stores a result in long form: columns of one length, each a registered result column or channel.

    Raises UnknownNameError for a column that is not registered, ValueError for columns of unequal length.
    """
    columns = [_registered(name, values) for name, values in table.items()]
    document = {"kind": "result", "metadata": dict(metadata)}
    write_atomically(path, lambda temporary: write_columns(temporary, columns, document))


def read_results(path: Path, columns: Iterable[str] | None = None) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """A stored result (all columns or those named) and its metadata; InputError when missing or damaged."""
    table, document = read_columns(path, "result", columns)
    return table, document["metadata"]


def write_recording(folder: Path, recording: Recording, keep: bool = False) -> None:
    """Stores a log's topics as they are in `folder`: one Parquet file per topic, and an index that names them.

    Topics are written one after another, dtypes preserved. A topic's name never becomes a file name. keep : what another
    writer put at `folder` meanwhile stays.
    """

    def write(temporary: Path) -> None:
        temporary.mkdir()
        for number, topic in enumerate(recording.topics.values()):
            _write_topic(temporary / f"{number:04d}.parquet", topic)
        index = {
            "source": recording.source,
            "format": recording.format,
            "sha256": recording.sha256,
            "size": recording.size,
            "topics": list(recording.topics),
            "metadata": dict(recording.metadata),
            # As a list too: the log's own order is not the sorted order of JSON keys.
            "metadata_order": list(recording.metadata),
            "damage": [asdict(d) for d in recording.damage],
            "start_utc": _time_text(recording.start_utc),
            "layout": recording.layout,
        }
        (temporary / _INDEX).write_text(json_text(index), encoding="ascii")

    write_atomically(folder, write, keep)


def read_recording(folder: Path, topics: Iterable[str] | None = None) -> Recording:
    """The recording stored in `folder`, with all topics or only those named (UnknownNameError for one it lacks)."""
    try:
        index = json.loads((folder / _INDEX).read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise InputError("no stored recording here", str(folder), "ingest the log again") from error
    wanted = index["topics"] if topics is None else list(topics)
    for name in wanted:
        if name not in index["topics"]:
            raise UnknownNameError(f"no topic '{name}'", str(folder), nearest(name, index["topics"]))
    read = {
        name: _read_topic(folder / f"{number:04d}.parquet") for number, name in enumerate(index["topics"]) if name in set(wanted)
    }
    return Recording(
        source=index["source"],
        format=index["format"],
        sha256=index["sha256"],
        size=index["size"],
        topics=read,
        metadata={name: index["metadata"][name] for name in index["metadata_order"]},
        damage=tuple(Damage(**d) for d in index["damage"]),
        start_utc=_time(index["start_utc"]),
        layout=index["layout"],
    )


def _write_topic(path: Path, topic: Topic) -> None:
    time, clock = _compact_time(topic.time)
    # A field's name is the log's own and may be anything: columns carry it where Parquet can, the metadata always does.
    names = _column_names(list(topic.fields), taken={"time"})
    columns = [Column("time", time, {"unit": "us" if clock else "s", "description": "time on the log's monotonic clock"})]
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


def _read_topic(path: Path) -> Topic:
    columns, stored = read_columns(path, "topic")
    time = columns["time"]
    if stored["clock"]:
        time = _CLOCKS[stored["clock"]](time)
    fields = {name: columns[column] for name, column in zip(stored["fields"], stored["columns"], strict=True)}
    return Topic(stored["name"], time, fields, dict(stored["units"]))


#: The two ways in which readers turn a microsecond counter into seconds; they differ in the last bit.
_CLOCKS = {"divided": lambda ticks: ticks / 1e6, "multiplied": lambda ticks: ticks * 1e-6}


def _compact_time(time: NDArray[np.float64]) -> tuple[NDArray[Any], str]:
    """Time as int64 microseconds where that is exact to the last bit, and which clock undoes it; else as it is."""
    if len(time) and np.all(np.abs(time) < 2**52 / 1e6):  # false for NaN and infinity too
        ticks = np.rint(time * 1e6).astype(np.int64)
        for clock, seconds in _CLOCKS.items():
            if np.array_equal(seconds(ticks).view(np.int64), np.ascontiguousarray(time, np.float64).view(np.int64)):
                return ticks, clock
    return time, ""


def _column_names(fields: Sequence[str], taken: set[str]) -> list[str]:
    names = []
    for number, field in enumerate(fields):
        plain = field.isascii() and field.isprintable() and 0 < len(field) <= 200 and field not in taken
        name = field if plain else f"field {number}"
        while name in taken:
            name += "_"
        names.append(name)
        taken.add(name)
    return names


def _registered(name: str, values: NDArray[Any]) -> Column:
    entry = _entry(name)
    return Column(name, values, {"unit": entry.unit, "description": entry.description})


def _entry(name: str) -> Channel:
    if name in RESULT_COLUMNS:
        return RESULT_COLUMNS[name]
    try:
        return channel(name)
    except UnknownNameError as error:
        raise UnknownNameError(error.what, "column to be stored", nearest(name, [*CHANNELS, *RESULT_COLUMNS])) from None


def _time_text(time: datetime | None) -> str | None:
    return time.isoformat() if time is not None else None


def _time(text: str | None) -> datetime | None:
    return datetime.fromisoformat(text) if text is not None else None
