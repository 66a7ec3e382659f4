"""What a log holds beside the channels that were mapped from it: what it says of itself, the
autopilot's parameters and messages, and every topic.

Topics are read from the store, where the confined reader put them; one column of them at a time,
in parts, so that a log of any length costs little memory.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.logs import in_order, stated_units
from aerodb.recording import Recording
from aerodb.report import decimated, for_people
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import StoredSeries, open_recording, topic_paths
from aerodb.support import Array
from aerodb.tasks.steps import mapping_of
from aerodb.tasks.view.channels import MOST_SERIES, Series, check_window
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Rows of a topic that are in memory at a time.
_PART: Final = 1 << 20
#: Prefix of a parameter as it was at the start of a log.
_PARAMETER: Final = "param:"
#: Prefix of a parameter as it was changed last during a log.
_CHANGED: Final = "param_last:"
#: Last byte of a PX4 release number.
_RELEASES: Final = {0: "dev", 64: "alpha", 128: "beta", 192: "rc", 255: ""}


def has_log_here(access: WorkspaceAccess, row: FlightRow) -> bool:
    """Return whether the topics of a flight's log are in the workspace folder: nothing need be
    fetched from an object store."""
    return access.workspace.recording_path(row.log_sha256).is_dir()


def log_document(access: WorkspaceAccess, row: FlightRow) -> dict[str, Any]:
    """Return what a flight's log says: firmware, information, parameters (with what they were
    changed to in flight) and messages (time [s] on the log's clock).

    Raises InputError if the log is not stored.
    """
    return recording_document(open_recording(access.topics_of(row.log_sha256)))


def recording_document(recording: Recording) -> dict[str, Any]:
    """Return what a recording says, as `log_document`; times [s] on the log's clock."""
    stated = recording.metadata
    changed = {
        name.removeprefix(_CHANGED): value
        for name, value in stated.items()
        if name.startswith(_CHANGED)
    }
    parameters = {
        name.removeprefix(_PARAMETER): value
        for name, value in stated.items()
        if name.startswith(_PARAMETER)
    }
    return {
        "format": recording.format,
        "firmware": firmware_of(stated),
        "information": {
            name: value
            for name, value in stated.items()
            if not name.startswith((_PARAMETER, _CHANGED))
        },
        "parameters": [
            {"name": name, "value": value, "changed_to": changed.get(name)}
            for name, value in sorted({**changed, **parameters}.items())
        ],
        "messages": [
            {"time": entry.time, "level": entry.level, "text": entry.text}
            for entry in recording.messages
        ],
    }


def firmware_of(stated: Mapping[str, str | int | float]) -> str:
    """Return system, version and board of a log's information in one line; empty if unknown.

    ``ver_sw_release`` holds major, minor, patch and kind of the release, one byte each (ULog file
    format, docs.px4.io).

    >>> firmware_of({"sys_name": "PX4", "ver_sw_release": 17498624, "ver_hw": "PX4_FMU_V5"})
    'PX4 1.11.2 dev, PX4_FMU_V5'
    """
    number, version = stated.get("ver_sw_release"), ""
    if isinstance(number, int):
        parts = [(number >> shift) & 255 for shift in (24, 16, 8, 0)]
        kind = _RELEASES.get(parts[3], str(parts[3]))
        version = f"{'.'.join(str(part) for part in parts[:3])} {kind}".strip()
    elif stated.get("ver_sw"):
        version = f"commit {str(stated['ver_sw'])[:10]}"
    system = " ".join(word for word in (str(stated.get("sys_name", "")), version) if word)
    return ", ".join(word for word in (system, str(stated.get("ver_hw", ""))) if word)


def topics_document(access: WorkspaceAccess, row: FlightRow) -> list[dict[str, Any]]:
    """Return every topic of a flight's log (`StoredSeries`): samples, first and last time [s] on
    the log's clock, and its fields with numbers, each with its unit ('' where neither log nor
    mapping states one)."""
    paths = topic_paths(access.topics_of(row.log_sha256))
    units = stated_units(mapping_of(access, row))
    return [_topic_document(StoredSeries.open(path, "topic"), units) for path in paths.values()]


def _topic_document(stored: StoredSeries, units: Mapping[tuple[str, str], str]) -> dict[str, Any]:
    name, clock = stored.metadata["name"], stored.metadata["clock"]
    ends = [float(end) * (1e-6 if clock else 1.0) for end in stored.ends()] if stored.rows else []
    return {
        "topic": name,
        "samples": stored.rows,
        "start": ends[0] if ends else None,
        "end": ends[1] if ends else None,
        "fields": [
            {"field": field, "unit": _unit(stored, field, units)}
            for field, column in _numeric(stored).items()
        ],
    }


def logged_series(
    access: WorkspaceAccess,
    row: FlightRow,
    names: Sequence[str],
    start: float,
    end: float,
    points: int,
) -> list[Series]:
    """Return the lines of logged fields, each named ``TOPIC:FIELD``, between two times [s].

    As recorded, at the topic's own rate, with at most `points` + 2 samples each; extremes are kept.
    Raises UnknownNameError for a topic or field that the log lacks, InputError as `series_of`.
    """
    if len(names) > MOST_SERIES:
        raise InputError(f"{len(names)} fields", "logged", f"at most {MOST_SERIES} at once")
    check_window(start, end, points)
    paths = topic_paths(access.topics_of(row.log_sha256))
    units = stated_units(mapping_of(access, row))
    lines = []
    for name in dict.fromkeys(names):
        stored, field = _field_of(paths, name, row.label)
        unit = _unit(stored, field, units)
        factor, shown = for_people(unit) if unit else (1.0, "unit not logged")
        time, values = _read(stored, _numeric(stored)[field], start, end, points)
        lines.append(Series(name, "logged", unit, f"{name} [{shown}]", factor, time, values))
    return lines


def _field_of(paths: Mapping[str, Path], name: str, flight: str) -> tuple[StoredSeries, str]:
    """Return the stored topic and the field of ``TOPIC:FIELD``; both may contain colons."""
    where = f"log of flight {flight}"
    for topic in sorted(paths, key=len, reverse=True):
        if name.startswith(f"{topic}:"):
            stored, field = StoredSeries.open(paths[topic], "topic"), name[len(topic) + 1 :]
            known = _numeric(stored)
            if field in known:
                return stored, field
            raise UnknownNameError(
                f"no field '{field[:80]}' in topic '{topic[:80]}'", where, nearest(field, known)
            )
    topic = name.partition(":")[0][:80]
    raise UnknownNameError(f"no topic '{topic}'", where, nearest(topic, paths))


def _numeric(stored: StoredSeries) -> dict[str, str]:
    """Return field -> column of the fields of a topic that hold numbers."""
    kinds = stored.metadata["dtypes"]
    pairs = zip(stored.metadata["fields"], stored.metadata["columns"], strict=True)
    return {field: column for field, column in pairs if np.dtype(kinds[column]).kind in "biuf"}


def _unit(stored: StoredSeries, field: str, units: Mapping[tuple[str, str], str]) -> str:
    own = dict(stored.metadata["units"]).get(field)
    return str(own or units.get((stored.metadata["name"].partition(".")[0], field), ""))


def _read(
    stored: StoredSeries, column: str, start: float, end: float, points: int
) -> tuple[Array, Array]:
    """Return time [s] and values between two times, decimated part by part and then as a whole."""
    chosen = [
        decimated(time, values, max(2, -(-points * len(time) // stored.rows)), start, end)
        for time, values in _parts(stored, column)
    ]
    if not chosen:
        return np.empty(0), np.empty(0)
    time, (values,) = in_order(*np.concatenate(chosen, axis=1))
    return decimated(time, values, points, start, end)


def _parts(stored: StoredSeries, column: str) -> Iterator[tuple[Array, Array]]:
    scale = 1e-6 if stored.metadata["clock"] else 1.0
    for first in range(0, stored.rows, _PART):
        found: Mapping[str, NDArray[Any]] = stored.read(["time", column], first, first + _PART)
        time = np.asarray(found["time"], dtype=np.float64) * scale
        time, (values,) = in_order(time, np.asarray(found[column], dtype=np.float64))
        yield time, values
