"""Reader of DataFlash logs as text (``.log``, ArduPilot): what Mission Planner and others make of a
``.bin``, and what former firmware sent.

A line is a record: the message's name and its values between commas. FMT lines describe messages as
in the binary log, so that units, multipliers and instances are those of `dataflash`. What the
binary format implies of a value (centimetres, 1e-7 degrees) is applied in the text already.
"""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording
from aerodb.storage.readers.dataflash import (
    NO_LOG,
    TYPES,
    Format,
    Records,
    backwards,
    described,
    log_metadata,
    start_utc,
    topics_of,
)

_FMT: Final = "FMT"
#: Format characters of texts, and that of 32 numbers, which no text has.
_TEXTS: Final = "nNZa"
#: Longest text of a field [bytes].
_LONGEST: Final = 64


def read_dataflash_text(path: Path) -> Recording:
    """Read a DataFlash log as text, damaged or not.

    Returns a Recording as `read_dataflash` does: time in s, fields in the units that the log
    declares. Lines that are no record of a described message are reported as damage.

    Raises InputError when the log contains no data.
    """
    data = path.read_bytes()
    formats, lines, damage = _lines(data)
    rows: dict[int, NDArray[Any]] = {}
    for identity, entry in formats.items():
        if entry.name in lines:
            rows[identity], bad = _rows(entry, lines[entry.name])
            if bad:
                what = f"{bad} lines of {entry.name} hold values that cannot be read: left out"
                damage.append(Damage("values", what, entry.name))
    log = {name: _applied(records) for name, records in described(rows, formats).items()}
    topics = {topic.name: topic for records in log.values() for topic in topics_of(records)}
    if not topics:
        raise InputError("the log contains no data", str(path), NO_LOG)
    return Recording(
        str(path),
        "dataflash",
        hashlib.sha256(data).hexdigest(),
        len(data),
        topics,
        log_metadata(log),
        (*damage, *backwards(topics)),
        start_utc(topics),
        "ardupilot" if {"IMU", "ATT"} <= topics.keys() else "",
    )


def _lines(data: bytes) -> tuple[dict[int, Format], dict[str, list[list[str]]], list[Damage]]:
    """Formats by message id, the values of each line by message, and what is no record."""
    text = data.decode("utf-8", "replace").replace("\r\n", "\n")
    whole, _, rest = text.rpartition("\n")
    damage = []
    if rest.strip("\0 "):
        what = "the last line has no line end: it may be cut and was left out"
        damage.append(Damage("lost_tail", what, bytes_lost=len(rest.encode())))
    formats: dict[int, Format] = {}
    widths: dict[str, int] = {}
    found: dict[str, list[list[str]]] = {}
    lost = bytes_lost = 0
    for line in whole.split("\n"):
        name, _, values = line.partition(",")
        name = name.strip()
        if name == _FMT:
            entry = _format(values)
            if entry is not None and entry[0] not in formats:
                formats[entry[0]] = entry[1]
                widths.setdefault(entry[1].name, len(entry[1].labels))
                continue
            if entry is not None:
                continue
        width = widths.get(name)
        # A text may hold commas: it is the last field.
        cells = values.split(",", width - 1) if width else []
        if width and len(cells) == width:
            found.setdefault(name, []).append(cells)
        elif line.strip():
            lost, bytes_lost = lost + 1, bytes_lost + len(line.encode()) + 1
    if lost:
        what = f"{lost} lines are no record of a described message"
        damage.append(Damage("framing", what, bytes_lost=bytes_lost))
    return formats, found, damage


def _format(values: str) -> tuple[int, Format] | None:
    """Message id and format of an FMT line; None where it is damaged."""
    cells = [cell.strip() for cell in values.split(",")]
    if len(cells) < 5 or not cells[0].isascii() or not cells[0].isdigit():
        return None
    name, characters, labels = cells[2], cells[3], tuple(cells[4:])
    known = all(character in TYPES for character in characters)
    if not (name and known and len(characters) == len(labels) == len(set(labels))):
        return None
    return int(cells[0]), Format(name, characters, labels, None)


def _applied(records: Records) -> Records:
    """Records without the factors that the text has applied already: those of their characters."""
    entry = records.format
    implied = [TYPES[character][1] != 1.0 for character in entry.characters]
    plain = "".join("d" if done else c for done, c in zip(implied, entry.characters, strict=True))
    done = {label for label, each in zip(entry.labels, implied, strict=True) if each}
    factors = {label: by for label, by in records.factors.items() if label not in done}
    return replace(records, format=replace(entry, characters=plain), factors=factors)


def _rows(entry: Format, lines: list[list[str]]) -> tuple[NDArray[Any], int]:
    """Records (n,) of a message, and how many lines hold no number where others do.

    A field of numbers that holds none in any line, such as a mode by its name, is a text.
    """
    columns: dict[str, NDArray[Any]] = {}
    good = np.ones(len(lines), dtype=bool)
    for k, (label, character) in enumerate(zip(entry.labels, entry.characters, strict=True)):
        cells = [line[k].strip() for line in lines]
        numbers = None if character in _TEXTS else _numbers(cells)
        if numbers is None:
            columns[label] = np.array([cell.encode()[:_LONGEST] for cell in cells], dtype="S64")
            continue
        broken = np.array([cell == "" for cell in cells]) | np.isnan(numbers)
        broken &= np.array([cell.lower() != "nan" for cell in cells])
        good &= ~broken
        columns[label] = numbers
    layout = []
    for label, character in zip(entry.labels, entry.characters, strict=True):
        values = columns[label]
        whole = TYPES[character][0]
        is_whole = TYPES[character][1] == 1.0 and values.dtype.kind == "f"
        is_whole = is_whole and np.dtype(whole).kind in "iu"
        inside = is_whole and _fits(values[good], np.dtype(whole))
        layout.append((label, whole if inside else values.dtype.str))
    rows = np.zeros(int(good.sum()), dtype=np.dtype(layout))
    for label in entry.labels:
        rows[label] = columns[label][good]
    return rows, int((~good).sum())


def _numbers(cells: list[str]) -> NDArray[np.float64] | None:
    """Numbers (n,), nan where a cell is none; None where no cell is one."""
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        values = np.array([_number(cell) for cell in cells])
    return values if np.isfinite(values).any() else None


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _fits(values: NDArray[np.float64], kind: np.dtype[Any]) -> bool:
    """Whether all values are whole numbers that a kind holds exactly."""
    limits = np.iinfo(kind)
    exact = 2.0**53
    return bool(
        np.all(np.isfinite(values))
        and np.all(values == np.round(values))
        and np.all((values >= max(limits.min, -exact)) & (values <= min(limits.max, exact)))
    )
