"""ULog reader (PX4's log format).

pyulog interprets the definitions: formats, nested fields, information, parameters. The data and the
search for damage are handled by the compiled loops of `ulog_framing`, because pyulog hides
truncation and fails on flipped bytes. Limits of the format: it has no checksums, so flipped bits
inside a payload pass as data, and a file cut exactly between two messages looks complete. ULog
contains no units; the mapping file declares them.
"""

import hashlib
import io
from collections.abc import Collection, Iterable, Mapping
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from pyulog import ULog
from pyulog.exceptions import ULogException

from aerodb.errors import InputError
from aerodb.recording import Damage, DamageKind, LoggedMessage, Recording, Topic
from aerodb.storage.readers.missing_samples import missing_by_topic
from aerodb.storage.readers.ulog_framing import HEADER_BYTES, Survey, survey
from aerodb.storage.readers.ulog_topics import LoggedTopics, TopicRecords

MAGIC = b"ULog\x01\x12\x35"
#: Maximum number of damaged intervals listed one by one; the rest is one entry.
_LISTED = 200
#: Most messages of the autopilot that are kept.
_MOST_MESSAGES = 10_000
_TYPES = {name: np.dtype(entry[2]).newbyteorder("<") for name, entry in ULog._UNPACK_TYPES.items()}
_NO_LOG = "check that the transfer was complete; the original on the vehicle may still be intact"


def read_ulog(path: Path, topics: Collection[str] | None = None) -> Recording:
    """Read a ULog file, damaged or not.

    Parameters
    ----------
    path :
        The file.
    topics :
        Names of the topics to read (every instance of them); None for all. Fewer topics take less
        memory.

    Returns
    -------
    Recording
        Time in s (the log's microseconds since boot), fields in their own types as views into
        packed records, arrays as ``q[0]``, nested fields as ``battery.voltage``, instance i > 0 as
        ``name.i``. Topics of a large log are read on demand (`ulog_topics`), so the file must stay
        in place while they are used. Damage with an empty topic concerns the file (its `bytes_lost`
        add up to all bytes that belong to no record); for the same interval, entries with a topic
        say how many of its samples are missing, by its own median interval.

    Raises
    ------
    InputError
        When the file is not a ULog file, or contains no data.

    References
    ----------
    ULog file format, docs.px4.io, dev_log.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        head = handle.read(4096)
        check_header(head, size, path)
        appended = _appended_offsets(head)
        survey_of_file = survey(handle, size, appended)
        definitions = parse_definitions(head, survey_of_file, path)
        handle.seek(0)
        sha256 = hashlib.file_digest(handle, "sha256").hexdigest()
    places = places_of(definitions, survey_of_file, topics)
    if not places and topics is None:
        raise InputError("the log contains no data", str(path), _NO_LOG)
    read = LoggedTopics(path, survey_of_file, places)
    is_cut = any(offset > size for offset in appended)
    damage = [
        *_file_damage(survey_of_file, is_cut),
        *_dropouts(survey_of_file),
        *_undecoded(survey_of_file, definitions),
        *_backwards(survey_of_file, places),
    ]
    damage += missing_by_topic(read, damage)
    metadata = metadata_of(definitions)
    start = _start_utc(definitions, read)
    layout = "px4" if metadata.get("sys_name") == "PX4" or "sensor_combined" in read else ""
    said = messages_of(definitions)
    return Recording(
        str(path), "ulog", sha256, size, read, metadata, tuple(damage), start, layout, said
    )


def check_header(head: bytes, size: int, path: Path) -> None:
    """Raise InputError for a file of `size` bytes that does not begin as a ULog file."""
    if size == 0:
        raise InputError("the file is empty", str(path), _NO_LOG)
    if head[: len(MAGIC)] != MAGIC:
        raise InputError(
            "not a ULog file: its first bytes are not 'ULog'",
            str(path),
            "name the format, or convert the log",
        )
    if size < HEADER_BYTES:
        raise InputError(f"only {size} bytes: the header is incomplete", str(path), _NO_LOG)


def _appended_offsets(head: bytes) -> list[int]:
    """Offsets at which data were appended (from the flag bits message, which must be first); only
    increasing offsets are used."""
    body = head[HEADER_BYTES + 3 : HEADER_BYTES + 43]
    if head[HEADER_BYTES + 2 : HEADER_BYTES + 3] != b"B" or len(body) < 40 or not body[8] & 1:
        return []
    offsets = [int.from_bytes(body[k : k + 8], "little") for k in (16, 24, 32)]
    used = [offset for offset in offsets if offset]
    return used if used == sorted(set(used)) and used[0] > HEADER_BYTES else []


def parse_definitions(head: bytes, survey: Survey, path: Path) -> ULog:
    """Let pyulog parse the definitions (ULog specification, section "Definitions"): all messages
    except data, with one blank data message per topic. Raises InputError where pyulog cannot."""
    skeleton = io.BytesIO()
    # A known file version keeps pyulog from writing warnings to the terminal.
    skeleton.write(head[:7] + bytes([min(head[7], 1)]) + head[8:HEADER_BYTES])
    for k, message in enumerate(survey.definitions):
        if message[2] != ord("B"):
            skeleton.write(message)
        elif k == 0:
            skeleton.write(
                b"\x28\x00B"
                + message[3:11]
                + bytes([message[11] & ~1])
                + message[12:19]
                + bytes(24)
            )
    for identity, topic in survey.subscriptions.items():
        # At a topic without a timestamp, pyulog silently stops and omits all following topics.
        if topic.layout is not None and _is_timed(survey, identity) and survey.count[identity]:
            blank = identity.to_bytes(2, "little") + bytes(topic.layout.trimmed)
            skeleton.write(len(blank).to_bytes(2, "little") + b"D" + blank)
    skeleton.seek(0)
    try:
        return ULog(skeleton)
    except ULogException as error:
        raise InputError(
            f"cannot be read: {error}", str(path), "it may need a newer version of this program"
        ) from error


def places_of(
    definitions: ULog, survey: Survey, topics: Collection[str] | None
) -> dict[str, TopicRecords]:
    """Return the location of the data of each topic, by topic name; records as numpy types of their
    fields, (n,) samples (`TopicRecords`)."""
    places: dict[str, TopicRecords] = {}
    for item in definitions.data_list:
        if (topics is None or item.name in topics) and _is_timed(survey, item.msg_id):
            record = np.dtype([(f.field_name, _TYPES[f.type_str]) for f in item.field_data])
            instance = item.multi_id
            while (name := f"{item.name}.{instance}" if instance else item.name) in places:
                instance += 1
            places[name] = TopicRecords(item.msg_id, record, int(survey.count[item.msg_id]))
    return dict(sorted(places.items()))


def _is_timed(survey: Survey, identity: int) -> bool:
    layout = survey.subscriptions[identity].layout
    return layout is not None and layout.stamp >= 0


def _undecoded(survey: Survey, definitions: ULog) -> Iterable[Damage]:
    known = {item.msg_id for item in definitions.data_list}
    for identity, topic in survey.subscriptions.items():
        n = int(survey.count[identity])
        if n and (identity not in known or not _is_timed(survey, identity)):
            why = (
                "their format is damaged"
                if topic.name
                else f"the announcement of message id {identity} is damaged"
            )
            if topic.layout is not None and not _is_timed(survey, identity):
                why = "they have no 64-bit timestamp"
            yield Damage("values", f"{n} messages not decoded: {why}", topic.name)


def _seconds(stamp: int) -> float | None:
    return stamp * 1e-6 if stamp >= 0 else None


def _file_damage(survey: Survey, is_cut: bool) -> Iterable[Damage]:
    for lost in survey.lost[:_LISTED]:
        n = lost.end - lost.start
        kind: DamageKind = "lost_tail" if lost.tail else "framing"
        place = "the file ends inside a record" if lost.tail else "bytes that belong to no record"
        what = f"{place}: {n} bytes from offset {lost.start}"
        yield Damage(kind, what, "", _seconds(lost.before), _seconds(lost.after), n)
    rest = survey.lost[_LISTED:]
    if rest:
        n = sum(lost.end - lost.start for lost in rest)
        start, end = _seconds(rest[0].before), _seconds(rest[-1].after)
        yield Damage("framing", f"{len(rest)} more damaged places: {n} bytes", "", start, end, n)
    if is_cut and not any(lost.tail for lost in survey.lost):
        yield Damage(
            "lost_tail", "the file ends before the data that its header announces", "", None, None
        )


def _dropouts(survey: Survey) -> Iterable[Damage]:
    """Dropouts that the logger itself reported: its buffer was full between the messages before and
    after the report."""
    for before, after, milliseconds in survey.dropouts:
        yield Damage(
            "dropout",
            f"the logger reported {milliseconds} ms lost",
            "",
            _seconds(before),
            _seconds(after),
        )


def _backwards(survey: Survey, places: Mapping[str, TopicRecords]) -> Iterable[Damage]:
    for name, place in places.items():
        n, latest = (int(value) for value in survey.back[place.identity])
        if n:
            where = latest * 1e-6
            yield Damage(
                "time", f"time runs backwards {n} times, first at {where:.6f} s", name, where, where
            )


def metadata_of(definitions: ULog) -> dict[str, str | int | float]:
    """Single-value information, initial parameters as ``param:NAME``, and parameters changed later
    as ``param_last:NAME``."""
    values: dict[str, Any] = dict(definitions.msg_info_dict)
    values |= {f"param:{name}": value for name, value in definitions.initial_parameters.items()}
    values |= {f"param_last:{name}": value for _, name, value in definitions.changed_parameters}
    return {name: value for name, value in values.items() if isinstance(value, (str, int, float))}


def messages_of(definitions: ULog) -> tuple[LoggedMessage, ...]:
    """Return what the autopilot said, with and without a tag, by time; at most `_MOST_MESSAGES`.

    Times [s].
    """
    said = [*definitions.logged_messages, *chain(*definitions.logged_messages_tagged.values())]
    return tuple(
        LoggedMessage(entry.timestamp * 1e-6, entry.log_level_str().lower(), entry.message)
        for entry in sorted(said, key=lambda entry: entry.timestamp)[:_MOST_MESSAGES]
    )


def _start_utc(definitions: ULog, read: Mapping[str, Topic]) -> datetime | None:
    """UTC at the time of the file's header: from the log's own information, from satellite
    navigation, or from the time of booting."""
    stated = definitions.msg_info_dict.get("start_utc")
    if isinstance(stated, str):
        try:
            return datetime.fromisoformat(stated).astimezone(UTC)
        except ValueError:
            pass
    for name in read:
        if name.split(".")[0] not in ("vehicle_gps_position", "sensor_gps"):
            continue
        topic = read[name]
        if "time_utc_usec" in topic.fields:
            utc = np.asarray(topic.fields["time_utc_usec"], dtype=np.float64) * 1e-6
            fixed = np.flatnonzero((utc > 1e9) & (utc < 1e10))  # 2001 to 2286: no fix is zero
            if len(fixed):
                first = int(fixed[0])
                elapsed = float(topic.time[first]) - definitions.start_timestamp * 1e-6
                return datetime.fromtimestamp(float(utc[first]), UTC) - timedelta(seconds=elapsed)
    booted = definitions.msg_info_dict.get("boot_time_utc_us")  # PX4 from version 1.17
    if isinstance(booted, int) and 1e15 < booted < 1e16:
        return datetime.fromtimestamp((booted + definitions.start_timestamp) * 1e-6, UTC)
    return None
