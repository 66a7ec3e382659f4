"""Flights, raw recordings and results as Parquet files, with an exact round trip.

The catalogue records which file belongs to which flight, result or version.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.flight import Flight
from aerodb.nomenclature import CHANNELS, RESULT_COLUMNS, Channel, channel
from aerodb.recording import Damage, LoggedMessage, Recording, Topic
from aerodb.storage.catalogue import measured
from aerodb.storage.files.parquet import (
    Column,
    json_text,
    read_columns,
    read_metadata,
    write_columns,
)
from aerodb.storage.files.topics import StoredTopics, read_topic, write_topic
from aerodb.storage.workspace import write_atomically
from aerodb.support import in_threads

#: Index file of a stored recording, which names its topics.
INDEX: Final = "recording.json"


def write_flight(path: Path, flight: Flight) -> None:
    """Store `flight` at `path`: column ``time``, one per channel, and one ``flags_<channel>`` per
    flagged channel.

    Raises UnknownNameError for a channel that is not in the glossary; then nothing is written.
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
        **({"estimated": sorted(flight.estimated)} if flight.estimated else {}),
    }
    write_atomically(path, lambda temporary: write_columns(temporary, columns, metadata))


def read_flight(path: Path, channels: Iterable[str] | None = None) -> Flight:
    """The flight stored at `path`, with all channels or only the named ones (and their flags).

    Raises InputError when the file is missing or damaged, UnknownNameError for a channel that it
    does not contain.
    """
    stored = read_metadata(path, "flight")
    known, flags = stored["channels"], stored["flags"]
    if channels is not None:
        wanted = set(channels)
        for name in sorted(wanted - set(known)):
            raise UnknownNameError(
                f"no channel '{name}'", f"flight {stored['id']}", nearest(name, known)
            )
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
        estimated=frozenset(stored.get("estimated", ())),
    )


def write_results(
    path: Path, table: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]
) -> None:
    """Store a result in long form: columns of one length, each a registered result column or
    channel.

    Raises UnknownNameError for a column that is not registered, ValueError for columns of unequal
    length.

    Columns (n,), in the registered unit of their name.
    """
    columns = [_registered(name, values) for name, values in table.items()]
    document = {"kind": "result", "metadata": dict(metadata)}
    write_atomically(path, lambda temporary: write_columns(temporary, columns, document))


def read_results(
    path: Path, columns: Iterable[str] | None = None
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """A stored result (all columns or the named ones) and its metadata; InputError when it is
    missing or damaged.

    Columns (n,), in the units of their names, SI.
    """
    table, document = read_columns(path, "result", columns)
    return table, document["metadata"]


def write_topics(folder: Path, recording: Recording) -> None:
    """Create `folder` and store a log's topics in it unchanged: one Parquet file per topic, and an
    index that names them.

    Topics are written one by one, a core for each, so the folder is not written atomically. dtypes
    are preserved. A topic's name never becomes a file name.

    Raises FileExistsError when the folder is there; values (n,) in the units of the log.
    """
    folder.mkdir()

    def written(numbered: tuple[int, Topic]) -> tuple[int, tuple[str, int]]:
        number, topic = numbered
        path = folder / f"{number:04d}.parquet"
        write_topic(path, topic)
        return number, measured(path)

    # The largest come first: a core that is left alone with one of them waits for nobody.
    numbered = sorted(enumerate(recording.topics.values()), key=lambda each: -_cells(each[1]))
    files = [file for _, file in sorted(in_threads(written, numbered), key=lambda each: each[0])]
    index = {
        "source": recording.source,
        "format": recording.format,
        "sha256": recording.sha256,
        "size": recording.size,
        "topics": list(recording.topics),
        # Hash and size of each topic's file, so the hash of the index covers all of them.
        "files": files,
        "metadata": dict(recording.metadata),
        # Also as a list, because the order in the log differs from the sorted order of JSON keys.
        "metadata_order": list(recording.metadata),
        "damage": [asdict(d) for d in recording.damage],
        "start_utc": _time_text(recording.start_utc),
        "layout": recording.layout,
        "messages": [asdict(entry) for entry in recording.messages],
    }
    (folder / INDEX).write_text(json_text(index), encoding="ascii")


def _cells(topic: Topic) -> int:
    return len(topic.time) * (1 + len(topic.fields))


def files_of(folder: Path) -> dict[str, tuple[str, int]]:
    """Return file name -> (sha256, size [bytes]) of the topic files of a stored recording, from its
    index; InputError without one.

    The hash is empty if the index is from a version that did not store hashes.
    """
    known = files_in(_index(folder))
    if all(sha256 for sha256, _ in known.values()):
        return known
    sizes = {path.name: path.stat().st_size for path in folder.iterdir()}
    return {
        name: (sha256, size if sha256 else sizes.get(name, 0))
        for name, (sha256, size) in known.items()
    }


def files_in(index: Mapping[str, Any]) -> dict[str, tuple[str, int]]:
    """Return `files_of` for an index that has already been read, sizes [bytes]; without a hash
    there is no size either: 0. KeyError for another document."""
    names = [f"{number:04d}.parquet" for number in range(len(index["topics"]))]
    known = index.get("files") or [("", 0)] * len(names)
    return {name: (sha256, size) for name, (sha256, size) in zip(names, known, strict=True)}


def _index(folder: Path) -> dict[str, Any]:
    try:
        index: dict[str, Any] = json.loads((folder / INDEX).read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise InputError(
            "there is no stored recording here, or its index is damaged",
            str(folder),
            "ingest the log again",
        ) from error
    return index


def read_recording(
    folder: Path, topics: Iterable[str] | None = None, fields: bool = True
) -> Recording:
    """The recording stored in `folder`, with all topics or only the named ones (UnknownNameError
    for an unknown one).

    fields : if False, only time stamps are read, which is much faster.
    """
    index = _index(folder)
    wanted = index["topics"] if topics is None else list(topics)
    for name in wanted:
        if name not in index["topics"]:
            raise UnknownNameError(
                f"no topic '{name}'", str(folder), nearest(name, index["topics"])
            )
    read = {
        name: read_topic(folder / f"{number:04d}.parquet", fields)
        for number, name in enumerate(index["topics"])
        if name in set(wanted)
    }
    return _recording(index, read)


def open_recording(folder: Path) -> Recording:
    """The recording stored in `folder`; its topics and fields are read on demand, so the folder
    must stay in place until then.

    Raises InputError without an index; times (n,) [s].
    """
    index = _index(folder)
    return _recording(index, StoredTopics(folder, index["topics"]))


def topic_paths(folder: Path) -> dict[str, Path]:
    """Topic name -> file of the recording stored in `folder`; InputError without one."""
    names = _index(folder)["topics"]
    return {name: folder / f"{number:04d}.parquet" for number, name in enumerate(names)}


def _recording(index: Mapping[str, Any], topics: Mapping[str, Topic]) -> Recording:
    return Recording(
        source=index["source"],
        format=index["format"],
        sha256=index["sha256"],
        size=index["size"],
        topics=topics,
        metadata={name: index["metadata"][name] for name in index["metadata_order"]},
        damage=tuple(Damage(**d) for d in index["damage"]),
        start_utc=_time(index["start_utc"]),
        layout=index["layout"],
        # Recordings of former versions have none.
        messages=tuple(LoggedMessage(**entry) for entry in index.get("messages", ())),
    )


def _registered(name: str, values: NDArray[Any]) -> Column:
    entry = _entry(name)
    return Column(name, values, {"unit": entry.unit, "description": entry.description})


def _entry(name: str) -> Channel:
    if name in RESULT_COLUMNS:
        return RESULT_COLUMNS[name]
    try:
        return channel(name)
    except UnknownNameError as error:
        raise UnknownNameError(
            error.what, "column to be stored", nearest(name, [*CHANNELS, *RESULT_COLUMNS])
        ) from None


def _time_text(time: datetime | None) -> str | None:
    return time.isoformat() if time is not None else None


def _time(text: str | None) -> datetime | None:
    return datetime.fromisoformat(text) if text is not None else None
