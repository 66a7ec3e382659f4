"""DataFlash reader (``.bin``, ArduPilot's log format).

A log describes itself: an FMT record gives a message id's length, name, types and labels; every
record is ``A3 95``, the id, and its fields, packed. FMTU, UNIT and MULT records give units and
multipliers. There are no checksums: flipped bits inside a record pass as data, and a file cut
between two records looks complete.
"""

import hashlib
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording, Topic
from aerodb.storage.readers.dataflash_kernels import FMT, FMT_BYTES, walk
from aerodb.storage.readers.ulog_kernels import Bytes

MAGIC: Final = b"\xa3\x95"
#: Format character -> numpy type, and the factor that the character itself implies.
TYPES: Final[dict[str, tuple[str, float]]] = {
    "a": ("(32,)<i2", 1.0),
    **{"b": ("i1", 1.0), "B": ("u1", 1.0), "M": ("u1", 1.0)},
    **{"h": ("<i2", 1.0), "H": ("<u2", 1.0), "i": ("<i4", 1.0), "I": ("<u4", 1.0)},
    **{"g": ("<f2", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "q": ("<i8", 1.0)},
    **{"Q": ("<u8", 1.0), "n": ("S4", 1.0), "N": ("S16", 1.0), "Z": ("S64", 1.0)},
    **{"c": ("<i2", 1e-2), "C": ("<u2", 1e-2), "e": ("<i4", 1e-2), "E": ("<u4", 1e-2)},
    "L": ("<i4", 1e-7),
}
#: Label of the first field -> s.
_CLOCKS: Final = {"TimeUS": 1e-6, "TimeMS": 1e-3}
#: Units of ArduPilot that other programs write differently; those without meaning here are ''.
_UNITS: Final = {
    **dict.fromkeys(("deglatitude", "deglongitude", "degheading"), "deg"),
    **{"m/s/s": "m/s^2", "deg/s/s": "deg/s^2", "rad/s/s": "rad/s^2", "Gauss": "gauss"},
    **{"%": "percent", "Watt": "W", "satellites": "1", "B": "byte", "B/s": "byte/s"},
    **dict.fromkeys(("UNKNOWN", "instance"), ""),
}
#: Messages that describe others or are metadata, as in AP_Logger/LogStructure.h.
_PARAMETERS: Final = "PARM"
_TEXTS: Final = "MSG"
_UNITS_OF: Final = "FMTU"
_UNIT: Final = "UNIT"
_MULTIPLIER: Final = "MULT"
_GPS_EPOCH: Final = datetime(1980, 1, 6, tzinfo=UTC)
#: GPS time less UTC since 2017.
_LEAP_SECONDS: Final = 18
_FIX: Final = 3
_FIRMWARE: Final = re.compile(r"(Ardu\w+|Rover|Blimp|AntennaTracker) V\d")
_LABEL: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
#: Stretches of lost bytes listed one by one; the rest is one entry.
_LISTED: Final = 200
NO_LOG: Final = "check that the transfer was complete; the original on the vehicle may be intact"


@dataclass(frozen=True)
class Format:
    """A kind of record: its name, format characters and labels; `layout` is None where they do not
    agree with its length."""

    name: str
    characters: str
    labels: tuple[str, ...]
    layout: np.dtype[Any] | None


@dataclass(frozen=True)
class Records:
    """Records of one name: `rows` (n,), units and multipliers by label ('' and 1 where the log
    declares none), and the label of the instance; '' where there is none."""

    rows: NDArray[Any]
    format: Format
    units: Mapping[str, str]
    factors: Mapping[str, float]
    instance: str


def read_dataflash(path: Path) -> Recording:
    """Read a DataFlash log, damaged or not.

    Returns
    -------
    Recording
        Time in s (microseconds since boot in the log), fields in the units that the log declares:
        multipliers are applied, so that they are float64 where one differs from 1. Instance i > 0
        of a sensor is the topic ``NAME.i``; texts (MSG) and parameters (``param:NAME``) are
        metadata. Bytes that belong to no record are reported as damage.

    Raises
    ------
    InputError
        When the file is not a DataFlash log, or contains no data.

    References
    ----------
    AP_Logger/README.md and LogStructure.h, github.com/ArduPilot/ardupilot.
    """
    data = np.fromfile(path, dtype=np.uint8)
    if bytes(data[:2]) != MAGIC:
        raise InputError(
            "not a DataFlash log: it does not begin with A3 95", str(path), "give a .bin file"
        )
    kind, start, lost = framed(data)
    formats, unreadable = _formats(data, start[kind == FMT])
    unreadable += _doubled(formats, set(np.unique(kind).tolist()))
    log = _records(data, kind, start, formats)
    topics = {topic.name: topic for records in log.values() for topic in topics_of(records)}
    if not topics:
        raise InputError("the log contains no data", str(path), NO_LOG)
    return Recording(
        str(path),
        "dataflash",
        hashlib.sha256(data.data).hexdigest(),
        len(data),
        topics,
        log_metadata(log),
        (*_lost(lost, len(data)), *unreadable, *backwards(topics)),
        start_utc(topics),
        "ardupilot" if {"IMU", "ATT"} <= topics.keys() else "",
    )


def framed(data: Bytes) -> tuple[Bytes, NDArray[np.int64], NDArray[np.int64]]:
    """Return ids (n,) and positions (n,) of all records, and the stretches (m, 2) [bytes] that
    belong to none."""
    none, nowhere = np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=np.int64)
    length = np.zeros(256, dtype=np.int64)
    length[FMT] = FMT_BYTES
    count, gaps = walk(data, length.copy(), none, nowhere, nowhere.reshape(0, 2))
    kind, start = np.zeros(count, dtype=np.uint8), np.zeros(count, dtype=np.int64)
    lost = np.zeros((gaps, 2), dtype=np.int64)
    walk(data, length, kind, start, lost)
    return kind, start, lost


def _taken(data: Bytes, start: NDArray[np.int64], layout: np.dtype[Any]) -> NDArray[Any]:
    """Records (n,) of one layout, which includes the header."""
    rows = data[start[:, None] + np.arange(layout.itemsize)]
    return np.ascontiguousarray(rows).view(layout).reshape(-1)


_FMT_LAYOUT: Final = np.dtype(
    [
        *(("head", "S3"), ("type", "u1"), ("length", "u1")),
        *(("name", "S4"), ("format", "S16"), ("labels", "S64")),
    ]
)


def _formats(data: Bytes, start: NDArray[np.int64]) -> tuple[dict[int, Format], list[Damage]]:
    """Formats by message id, the first of each id; and those that cannot be used."""
    found: dict[int, Format] = {}
    damage: dict[str, Damage] = {}
    for row in _taken(data, start, _FMT_LAYOUT):
        identity, name = int(row["type"]), _text(row["name"])
        entry = _format(name, _text(row["format"]), _text(row["labels"]), int(row["length"]))
        if identity not in found:
            found[identity] = entry
            if entry.layout is None:
                what = f"the description of message {name!r} is damaged: its records are not used"
                damage.setdefault(what, Damage("values", what, name))
        elif entry != found[identity] and identity != FMT:
            what = f"message {found[identity].name!r} is described twice, differently"
            damage.setdefault(what, Damage("values", what, found[identity].name))
    return found, list(damage.values())


def _doubled(formats: Mapping[int, Format], seen: Collection[int]) -> list[Damage]:
    """Damage of the names that several of the ids with records have: the first is used."""
    names = [
        entry.name
        for identity, entry in formats.items()
        if identity in seen and entry.layout is not None
    ]
    return [
        Damage("values", f"message {name!r} has several ids: the records of the first count", name)
        for name, count in Counter(names).items()
        if count > 1
    ]


def _format(name: str, characters: str, labels: str, length: int) -> Format:
    named = tuple(labels.split(",")) if labels else ()
    usable = (
        bool(_LABEL.fullmatch(name))
        and len(named) == len(characters) == len(set(named))
        and all(_LABEL.fullmatch(label) for label in named)
        and all(character in TYPES for character in characters)
    )
    layout = None
    if usable:
        fields = [(label, TYPES[c][0]) for label, c in zip(named, characters, strict=True)]
        layout = np.dtype([(" ", "S3"), *fields])
    if layout is not None and layout.itemsize != length:
        layout = None
    return Format(name, characters, named, layout)


def _records(
    data: Bytes, kind: Bytes, start: NDArray[np.int64], formats: Mapping[int, Format]
) -> dict[str, Records]:
    """Records by name; of two ids with one name, the first."""
    rows: dict[int, NDArray[Any]] = {}
    order = np.argsort(kind, kind="stable")
    first = np.searchsorted(kind[order], np.arange(257))
    for identity, entry in formats.items():
        places = start[order[first[identity] : first[identity + 1]]]
        if identity != FMT and entry.layout is not None and len(places):
            rows[identity] = _taken(data, places, entry.layout)
    return described(rows, formats)


def described(
    rows: Mapping[int, NDArray[Any]], formats: Mapping[int, Format]
) -> dict[str, Records]:
    """Records (n,) by message id -> by name with their units, multipliers and instances, as UNIT,
    MULT and FMTU among them declare; of two ids with one name, the first."""
    by_name = {formats[identity].name: each for identity, each in rows.items()}
    unit_of, factor_of = (
        _by_character(by_name, _UNIT, "Label"),
        _by_character(by_name, _MULTIPLIER, "Mult"),
    )
    declared = {}
    for row in _named(by_name, _UNITS_OF, "FmtType", "UnitIds", "MultIds"):
        declared[int(row["FmtType"])] = (_text(row["UnitIds"]), _text(row["MultIds"]))
    found: dict[str, Records] = {}
    for identity, each in rows.items():
        entry = formats[identity]
        units, factors = declared.get(identity, ("", ""))
        found.setdefault(
            entry.name,
            Records(
                each,
                entry,
                {
                    label: _UNITS.get(text, text)
                    for label, id_ in zip(entry.labels, units, strict=False)
                    if (text := _text(unit_of.get(id_, b"")))
                },
                {
                    label: float(factor_of.get(id_, 1.0))
                    for label, id_ in zip(entry.labels, factors, strict=False)
                },
                entry.labels[units.index("#")] if "#" in units[: len(entry.labels)] else "",
            ),
        )
    return found


def _named(rows: Mapping[str, NDArray[Any]], name: str, *labels: str) -> NDArray[Any]:
    """Records of a name; none where it is not there or lacks one of these labels."""
    found = rows.get(name)
    if found is None or not set(labels) <= set(found.dtype.names or ()):
        return np.zeros(0)
    return found


def _by_character(rows: Mapping[str, NDArray[Any]], name: str, label: str) -> dict[str, Any]:
    """Entries of a table of the log by their character."""
    return {chr(int(row["Id"]) & 0x7F): row[label] for row in _named(rows, name, "Id", label)}


def topics_of(records: Records) -> Iterator[Topic]:
    """Yield the topics of records with a clock [s], one per instance; fields are (n,)."""
    labels = records.format.labels
    clock = labels[0] if labels else ""
    about = (_PARAMETERS, _TEXTS, _UNITS_OF, _UNIT, _MULTIPLIER)
    if records.format.name in about or clock not in _CLOCKS:
        return
    if records.rows.dtype[clock].kind not in "iu":
        return
    instances = np.zeros(len(records.rows), dtype=np.int64)
    if records.instance and records.rows.dtype[records.instance].kind in "iu":
        instances = records.rows[records.instance].astype(np.int64)
    for number in np.unique(instances):
        rows = records.rows[instances == number]
        fields: dict[str, NDArray[Any]] = {}
        units: dict[str, str] = {}
        for label, character in zip(labels[1:], records.format.characters[1:], strict=True):
            values = rows[label]
            if values.dtype.kind not in "iuf" or label == records.instance:
                continue
            factor = TYPES[character][1]
            if factor == 1.0:
                factor = records.factors.get(label, 1.0) or 1.0
            with np.errstate(over="ignore", invalid="ignore"):  # a damaged multiplier
                scaled = values if factor == 1.0 else values * factor
            parts = [scaled] if scaled.ndim == 1 else list(scaled.T)
            names = [label] if scaled.ndim == 1 else [f"{label}[{k}]" for k in range(len(parts))]
            fields |= dict(zip(names, parts, strict=True))
            if records.units.get(label):
                units |= dict.fromkeys(names, records.units[label])
        if fields:
            name = records.format.name + (f".{number}" if number else "")
            yield Topic(name, rows[clock] * _CLOCKS[clock], fields, units)


def log_metadata(log: Mapping[str, Records]) -> dict[str, str | int | float]:
    """Return parameters as set last, the texts that the firmware wrote, and its name."""
    by_name = {name: each.rows for name, each in log.items()}
    found: dict[str, str | int | float] = {}
    for row in _named(by_name, _PARAMETERS, "Name", "Value"):
        found[f"param:{_text(row['Name'])}"] = float(row["Value"])
    said = [_text(row["Message"]) for row in _named(by_name, _TEXTS, "Message")]
    firmware = next((text for text in said if _FIRMWARE.match(text)), "")
    if firmware:
        found |= {"sys_name": firmware.split()[0], "ver_sw": firmware}
    if said:
        found["messages"] = "\n".join(said[:_LISTED])
    return found


def start_utc(topics: Mapping[str, Topic]) -> datetime | None:
    """Return UTC at the first sample with a position of the first receiver that has one."""
    for name in ("GPS", "GPS.1", "GPS2"):
        topic = topics.get(name)
        if topic is None or not {"Status", "GMS", "GWk"} <= topic.fields.keys():
            continue
        known = (topic.fields["Status"] >= _FIX) & (topic.fields["GWk"] > 0)
        if not known.any():
            continue
        k = int(np.argmax(known))
        at = timedelta(
            weeks=float(topic.fields["GWk"][k]),
            seconds=float(topic.fields["GMS"][k]) * (1.0 if "GMS" in topic.units else 1e-3)
            - _LEAP_SECONDS
            - float(topic.time[k] - _first(topics)),
        )
        return _GPS_EPOCH + at
    return None


def _first(topics: Mapping[str, Topic]) -> float:
    return min(float(topic.time[0]) for topic in topics.values())


def _lost(stretches: NDArray[np.int64], size: int) -> Iterator[Damage]:
    """Bytes that belong to no record, as damage."""
    for since, until in stretches[:_LISTED].tolist():
        tail = until == size
        what = (
            f"the file ends inside a record: {until - since} bytes"
            if tail
            else f"{until - since} bytes from byte {since} belong to no record"
        )
        yield Damage("lost_tail" if tail else "framing", what, bytes_lost=until - since)
    rest = stretches[_LISTED:]
    if len(rest):
        lost = int((rest[:, 1] - rest[:, 0]).sum())
        what = f"{lost} bytes in {len(rest)} more places belong to no record"
        yield Damage("framing", what, bytes_lost=lost)


def backwards(topics: Mapping[str, Topic]) -> Iterator[Damage]:
    """Yield clocks that run backwards, as damage; times [s]."""
    for name, topic in topics.items():
        back = np.flatnonzero(np.diff(topic.time) < 0.0)
        if len(back):
            at = float(topic.time[back[0]])
            yield Damage("time", f"its clock runs backwards {len(back)} times", name, at, at)


def _text(value: bytes) -> str:
    return bytes(value).split(b"\0", 1)[0].decode("utf-8", errors="replace").strip()
