"""Reader of text tables: CSV (comma, semicolon, tab) and whitespace-separated columns, with or
without a header line."""

import csv
import io
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage

_UNIT = re.compile(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*")
_SYMBOLS = {"°": "deg", "°/s": "deg/s", "°C": "degC", "µs": "us"}
_NEWLINE = 0x0A


@dataclass(frozen=True)
class TextTable:
    """Columns (n,) by name as float64, units from the header, damage, and the names of text
    columns."""

    columns: dict[str, NDArray[Any]]
    units: dict[str, str]
    damage: list[Damage]
    metadata: dict[str, str | int | float] = field(default_factory=dict)


def read_text(data: bytes, where: str) -> TextTable:
    """Read a text table from the bytes of its file.

    Leading lines that begin with ``#`` or ``%`` are comments; the last of them is the header if it
    has as many words as there are columns. A last line without a line end may be truncated within a
    number, so it is left out and reported. Raises InputError for binary files, ragged lines (naming
    the first one), and files without numbers.

    Columns (n,), in the units of the file.
    """
    _refuse_binary(data, where)
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    body, comment, offset = _without_comments(data)
    body, damage = _without_cut_line(body)
    first = body.split(b"\n", 1)[0]
    delimiter = _delimiter(first)
    header = _words(first, delimiter)
    names: list[str] | None = None
    if _is_header(header):
        names, body, offset = header, body[len(first) + 1 :], offset + 1
    if not body.strip():
        raise InputError(
            "the file contains no rows of numbers",
            where,
            "check that the log was written to its end",
        )
    width = _check_ragged(body, delimiter, offset, len(names) if names else None, where)
    if names is None and len(comment) == width:
        names = comment
    frame = _frame(body, delimiter, where)
    columns, text, broken = _columns(frame, names)
    units = {name: unit for name, unit in (_split_unit(name) for name in columns) if unit}
    named = {_split_unit(name)[0]: values for name, values in columns.items()}
    if len(named) < len(columns):
        raise InputError("two columns have the same name", where, "give each column a unique name")
    if not named:
        raise InputError(
            "no column contains numbers", where, "check the delimiter and the decimal sign"
        )
    return TextTable(named, units, damage + broken, {"skipped": ", ".join(text)} if text else {})


def _refuse_binary(data: bytes, where: str) -> None:
    odd = sum(byte < 9 or 13 < byte < 32 for byte in data[:4096])
    if b"\x00" in data or odd > 0.02 * min(len(data), 4096):
        what = f"not a text file: it begins with {data[:8]!r}"
        raise InputError(what, where, "use the suffix of the log's format; save text as UTF-8")


def _without_comments(data: bytes) -> tuple[bytes, list[str], int]:
    """The table itself, the words of the last comment before it, and the number of lines before
    it."""
    position, lines, comment = 0, 0, b""
    while position < len(data):
        end = data.find(b"\n", position)
        line = data[position : end if end >= 0 else len(data)].strip()
        if line and line[:1] not in b"#%":
            break
        comment = line or comment
        lines += 1
        position = end + 1 if end >= 0 else len(data)
    stripped = comment.lstrip(b"#% ")
    return data[position:], _words(stripped, _delimiter(stripped)) if stripped else [], lines


def _without_cut_line(body: bytes) -> tuple[bytes, list[Damage]]:
    if body.endswith(b"\n") or not body:
        return body, []
    whole = body.rfind(b"\n") + 1
    what = "the last line has no line end: it may be cut and was left out"
    return body[:whole], [Damage("lost_tail", what, topic="table", bytes_lost=len(body) - whole)]


def _delimiter(line: bytes) -> str:
    counts = {sign: line.count(sign.encode()) for sign in (";", "\t", ",")}
    best = max(counts, key=lambda sign: counts[sign])
    return best if counts[best] else " "


def _words(line: bytes, delimiter: str) -> list[str]:
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    if delimiter == " ":
        return text.split()
    return [word.strip() for word in next(csv.reader([text], delimiter=delimiter), [])]


def _is_header(words: list[str]) -> bool:
    """Return whether more than half of the words in the line are not numbers: one damaged number
    does not make a header."""
    filled = [word for word in words if word]
    return sum(not _is_number(word) for word in filled) > 0.5 * len(filled)


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _check_ragged(body: bytes, delimiter: str, offset: int, width: int | None, where: str) -> int:
    """The number of columns, equal on all lines that are not blank; InputError names the first line
    that differs."""
    if b'"' in body:
        rows = csv.reader(
            io.StringIO(body.decode("latin-1")), delimiter=delimiter, skipinitialspace=True
        )
        counts = np.array([len(row) for row in rows])
    else:
        counts = _field_counts(np.frombuffer(body, np.uint8), delimiter)
    filled = np.flatnonzero(counts)
    width = int(counts[filled[0]]) if width is None else width
    other = filled[counts[filled] != width]
    if other.size:
        line = int(other[0])
        what = f"line {line + 1 + offset} has {counts[line]} fields, {width} were expected"
        raise InputError(what, where, "repair that line, or quote texts that contain the delimiter")
    return width


def _field_counts(text: NDArray[np.uint8], delimiter: str) -> NDArray[np.int64]:
    """Number of fields of each line, 0 for blank lines."""
    ends = np.flatnonzero(text == _NEWLINE)
    blank = (text == 0x20) | (text == 0x09) | (text == _NEWLINE)
    word_starts = ~blank & np.concatenate([[True], blank[:-1]])
    words = np.diff(np.searchsorted(np.flatnonzero(word_starts), ends), prepend=0)
    if delimiter == " ":
        return words
    marks = np.diff(np.searchsorted(np.flatnonzero(text == ord(delimiter)), ends), prepend=0)
    return np.where((words > 0) | (marks > 0), marks + 1, 0)


def _frame(body: bytes, delimiter: str, where: str) -> pd.DataFrame:
    comma = delimiter in ";\t" and b"," in body and b"." not in body
    try:
        return pd.read_csv(
            io.BytesIO(body),
            header=None,
            sep=r"\s+" if delimiter == " " else delimiter,
            decimal="," if comma else ".",
            quoting=csv.QUOTE_MINIMAL if b'"' in body else csv.QUOTE_NONE,
            encoding="latin-1",
            low_memory=False,
            skipinitialspace=True,
        )
    except (
        ValueError,
        OverflowError,
        MemoryError,
    ) as error:  # pandas' parser errors are ValueErrors
        raise InputError(
            f"not readable as a table: {str(error)[:200]}", where, "check delimiter and quotes"
        ) from error


def _columns(
    frame: pd.DataFrame, names: list[str] | None
) -> tuple[dict[str, NDArray[Any]], list[str], list[Damage]]:
    """Columns of numbers by name, names of those of text or nothing, and damage where single cells
    are not numbers."""
    columns: dict[str, NDArray[Any]] = {}
    text, damage = [], []
    for number, key in enumerate(frame.columns):
        name = (names[number] if names else "") or str(number + 1)
        while name in columns or name in text:
            name += "_"
        series = frame[key]
        values = pd.to_numeric(series, errors="coerce").to_numpy(dtype=np.float64)
        bad = np.isnan(values) & series.notna().to_numpy()
        if bad.sum() > 0.5 * len(values):
            text.append(name)
            continue
        if bad.any():
            row = int(np.argmax(bad))
            what = (
                f"{bad.sum()} cells of column '{name}' are not numbers, the first in row {row + 1}:"
                f" {series[row]!r:.40}"
            )
            damage.append(Damage("values", what, topic="table"))
        if np.all(np.isnan(values)):
            text.append(name)
        else:
            columns[name] = values
    return columns, text, damage


def _split_unit(name: str) -> tuple[str, str]:
    """Name and unit of a header such as ``alpha [deg]`` or ``alpha (deg)``; no unit: empty.

    >>> _split_unit("V (ft/s)")
    ('V', 'ft/s')
    """
    match = _UNIT.fullmatch(name)
    if match is None or not match[1]:
        return name, ""
    unit = (match[2] if match[2] is not None else match[3]).strip()
    return match[1], _SYMBOLS.get(unit, unit)
