"""Reader of text tables as tools write them: CSV (comma, semicolon, tab, pipe) and columns between
blanks, with or without a header line."""

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage
from aerodb.storage.readers.labview import without_labview_header
from aerodb.storage.readers.text_cells import Cells, is_number, numbers_of
from aerodb.storage.readers.text_layout import SAMPLE, SEP, Layout, closing_lines, text_layout
from aerodb.storage.readers.text_times import seconds_of_digits
from aerodb.units import is_spelled

_UNIT: Final = re.compile(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*")
#: What stands behind a comma, a slash, "in" or in braces, if it is a unit: ``alpha,__deg`` of
#: X-Plane, ``alpha/deg`` and ``V/(m/s)`` of ISO 80000, ``alpha in deg``, ``alpha {deg}``.
_BEHIND: Final = re.compile(
    r"([^/].*?)(?:\s*(?:,|\s/\s)[\s_]*\(?([^,()]+?)\)?|\s*/\s*(?:\(([^()]+)\)|([^/()\s]+))"
    r"|\s+in\s+(\S+)|\s+\{([^{}]+)\})\s*"
)
#: A unit before a slash: ``degrees/ROLL`` and ``ft Baro/AltB`` of CloudAhoy.
_AHEAD: Final = re.compile(r"(G|[A-Za-z ]{2,})/([^/]+)")
_INDEX: Final = re.compile(r"\d+(,\d+)*|[xyzXYZ]|")
_SYMBOLS: Final = {"°": "deg", "°/s": "deg/s", "°C": "degC", "µs": "us"}
#: Most columns of a table; a log of ArduPilot or PX4 has some 5,000 signals.
_MOST_COLUMNS: Final = 20_000
_NEWLINE: Final = 0x0A
_COMMENTS: Final = (b"#", b"%")
_UTF16: Final = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class TextTable:
    """Columns (n,) by name as float64, units from the header, damage, and in `metadata` what was
    not read or not read as it stands."""

    columns: dict[str, NDArray[Any]]
    units: dict[str, str]
    damage: list[Damage]
    metadata: dict[str, str | int | float] = field(default_factory=dict)


def read_text(data: bytes, where: str) -> TextTable:
    """Read a text table from the bytes of its file.

    Lines above the data are comments (``#`` or ``%``), titles, names and units (`text_layout`);
    names in a comment count if there are as many as columns. Closing lines without a number,
    comments and names that are repeated between the data are left out and said. A last line without
    a line end may be truncated within a number, so it is left out and reported; so are zeros at the
    end. The decimal sign,
    thousands, dates and durations are decided column by column (`numbers_of`).

    Raises InputError for binary files, ragged lines (naming the first one), and files without
    numbers. Columns (n,), in the units of the file; times in [s].
    """
    data = without_labview_header(_as_utf8(data))
    data, reserved = _without_reserved(data)
    _refuse_binary(data, where)
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not data.strip():
        what = "the file contains no rows of numbers"
        raise InputError(what, where, "check that the log was written to its end")
    lines = data.split(b"\n", SAMPLE)[:SAMPLE]
    _refuse_wide(lines, where)
    layout = text_layout(lines, where)
    remarks = [_quoted_title(lines, layout)] if layout.titles else []
    body = data[sum(len(line) + 1 for line in lines[: layout.first]) :]
    if layout.delimiter == "|":  # those at the ends of a line are a frame
        body = re.sub(rb"^[ \t]*\|", b"", body, flags=re.MULTILINE)
    body, damage = _without_cut_line(body)
    damage = reserved + damage
    body, closing = _without_closing(body, layout)
    body, again = _without_repeats(body, lines[: layout.first], layout)
    remarks += closing + again
    if not body.strip():
        raise InputError(
            "the file contains no rows of numbers",
            where,
            "check that the log was written to its end",
        )
    _check_ragged(body, layout, where)
    frame = _frame(body, layout, where)
    columns, units, text, broken, said = _columns(frame, layout)
    if not columns:
        raise InputError(
            "no column contains numbers", where, "check the delimiter and the decimal sign"
        )
    metadata: dict[str, str | int | float] = {"skipped": ", ".join(text)} if text else {}
    if remarks + said:
        metadata["remarks"] = "; ".join(remarks + said)
    return TextTable(columns, units, damage + broken, metadata)


def _as_utf8(data: bytes) -> bytes:
    """Text that Excel saves as "Unicode" is UTF-16."""
    return data.decode("utf-16", "replace").encode() if data[:2] in _UTF16 else data


def _refuse_binary(data: bytes, where: str) -> None:
    odd = sum(byte < 9 or 13 < byte < 32 for byte in data[:4096])
    if b"\x00" in data or odd > 0.02 * min(len(data), 4096):
        what = f"not a text file: it begins with {data[:8]!r}"
        raise InputError(what, where, "use the suffix of the log's format; save text as UTF-8")


def _refuse_wide(lines: list[bytes], where: str) -> None:
    """Raise InputError for more columns than any log has: time grows with their square."""
    marks = (b",", b";", b"\t", b"|")
    widest = max(max(len(line.split()), *map(line.count, marks)) for line in lines)
    if widest > _MOST_COLUMNS:
        what = f"more than {_MOST_COLUMNS} columns in a line"
        raise InputError(what, where, "write one line per sample, and a column per signal")


def _quoted_title(lines: list[bytes], layout: Layout) -> str:
    filled = [line for line in lines if line.strip() and not SEP.fullmatch(line)]
    title = filled[0].decode("utf-8", "replace").strip()
    more = f" and {layout.titles - 1} more" if layout.titles > 1 else ""
    return f"titles above the table are not read: '{title:.40}'{more}"


def _without_reserved(data: bytes) -> tuple[bytes, list[Damage]]:
    """Leave out zeros at the end: a logger reserves room, and loses power before it is filled."""
    filled = data.rstrip(b"\x00")
    if not filled or len(filled) == len(data):
        return data, []
    what = "the file ends in zeros: it was not closed, and its last lines may be lost"
    lost = len(data) - len(filled)
    return filled, [Damage("lost_tail", what, topic="table", bytes_lost=lost)]


def _without_cut_line(body: bytes) -> tuple[bytes, list[Damage]]:
    """Leave out the last line if it has no line end, unless it holds no number."""
    whole = body.rfind(b"\n") + 1
    if not re.search(rb"\d", body[whole:]):
        return body, []
    what = "the last line has no line end: it may be cut and was left out"
    return body[:whole], [Damage("lost_tail", what, topic="table", bytes_lost=len(body) - whole)]


def _without_closing(body: bytes, layout: Layout) -> tuple[bytes, list[str]]:
    """Leave out the last lines if they hold no number: closing words of a tool."""
    begin = closing_lines(body, layout)
    if begin == len(body):
        return body if body.endswith(b"\n") else body + b"\n", []
    first = body[begin:].strip().split(b"\n", 1)[0].decode("utf-8", "replace")
    return body[:begin], [f"closing lines are not read: '{first:.40}'"]


def _without_repeats(body: bytes, above: list[bytes], layout: Layout) -> tuple[bytes, list[str]]:
    """Blank comments between the data, and names that stand there again."""
    found = 0
    for line in dict.fromkeys(above) if layout.names else ():
        if line.strip() and (body.startswith(line + b"\n") or b"\n" + line + b"\n" in body):
            body, times = re.subn(rb"^" + re.escape(line) + rb"$", b"", body, flags=re.MULTILINE)
            found += times
    if body[:1] in _COMMENTS or any(b"\n" + mark in body for mark in _COMMENTS):
        body, times = re.subn(rb"^[#%][^\n]*$", b"", body, flags=re.MULTILINE)
        found += times
    return body, [f"{found} comments or repeated headers between the data"] if found else []


def _check_ragged(body: bytes, layout: Layout, where: str) -> None:
    """Refuse lines that are not blank and have another number of fields; InputError names the first
    of them."""
    if b'"' in body:
        rows = csv.reader(
            io.StringIO(body.decode("latin-1")),
            delimiter=layout.delimiter,
            skipinitialspace=True,
        )
        counts = np.array([len(row) for row in rows])
    else:
        counts = _field_counts(np.frombuffer(body, np.uint8), layout.delimiter)
    filled = np.flatnonzero(counts)
    other = filled[counts[filled] != layout.width]
    if other.size:
        line, width = int(other[0]), layout.width
        what = f"line {line + 1 + layout.first} has {counts[line]} fields, {width} were expected"
        raise InputError(what, where, "repair that line, or quote texts that contain the delimiter")


def _field_counts(text: NDArray[np.uint8], delimiter: str) -> NDArray[np.int64]:
    """Number of fields of each line, 0 for blank lines."""
    ends = np.flatnonzero(text == _NEWLINE)
    if delimiter == " ":
        return _words(text, ends)
    marks = np.diff(np.searchsorted(np.flatnonzero(text == ord(delimiter)), ends), prepend=0)
    if marks.all():
        return marks + 1
    return np.where((marks > 0) | (_words(text, ends) > 0), marks + 1, 0)


def _words(text: NDArray[np.uint8], ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of words of each line (m,), which end at `ends`."""
    blank = (text == 0x20) | (text == 0x09) | (text == _NEWLINE)
    starts = ~blank & np.concatenate([[True], blank[:-1]])
    return np.diff(np.searchsorted(np.flatnonzero(starts), ends), prepend=0)


def _frame(body: bytes, layout: Layout, where: str) -> pd.DataFrame:
    try:
        return pd.read_csv(
            io.BytesIO(body),
            header=None,
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal="," if layout.comma and layout.delimiter != "," else ".",
            quoting=csv.QUOTE_MINIMAL if b'"' in body else csv.QUOTE_NONE,
            encoding="utf-8",
            encoding_errors="replace",
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
    frame: pd.DataFrame, layout: Layout
) -> tuple[dict[str, NDArray[Any]], dict[str, str], list[str], list[Damage], list[str]]:
    """Columns of numbers by name, their units, names of those of text or nothing, damage where
    single cells are not numbers, and how texts were read."""
    headers = [(layout.names[k] if layout.names else "") for k in range(len(frame.columns))]
    split = [split_unit(header, headers) for header in headers]
    shorts = [short for short, _ in split]
    columns: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    text, damage, said = list[str](), list[Damage](), list[str]()
    for number, key in enumerate(frame.columns):
        short, unit = split[number]
        name = (short if shorts.count(short) == 1 else headers[number]) or str(number + 1)
        while name in columns or name in text:
            name += "_"
        series = frame[key]
        cells = numbers_of(series, layout.comma)
        if cells is not None and not cells.is_time:
            clock = seconds_of_digits(cells.values)
            if clock is not None:
                cells = Cells(clock, "s", "digits of a clock (hhmmss) as seconds", is_time=True)
        if cells is None:
            if headers[number] or series.notna().any():
                text.append(name)
            continue
        bad = np.isnan(cells.values) & series.notna().to_numpy(dtype=bool)
        bad[bad] = [not is_number(str(each)) for each in series[bad]]
        if bad.any():
            row = int(np.argmax(bad))
            what = (
                f"{bad.sum()} cells of column '{name}' are not numbers, the first in row {row + 1}:"
                f" {series[row]!r:.40}"
            )
            damage.append(Damage("values", what, topic="table"))
        columns[name] = cells.values
        stated = unit or layout.units[number].strip("[]() ") or cells.unit
        unit = cells.unit if cells.is_time else stated
        if unit:
            units[name] = _SYMBOLS.get(unit, unit)
        if cells.read_as:
            said.append(f"{name}: {cells.read_as}")
    return columns, units, text, damage, said


def split_unit(name: str, others: Sequence[str] = ()) -> tuple[str, str]:
    """Return name and unit of a header such as ``alpha [deg]`` or ``alpha,__deg``; no unit: empty.

    A number or an axis in brackets is an index, but for a 1 that stands apart where
    no other header has the same name: the unit of numbers.

    >>> split_unit("V (ft/s)"), split_unit("gyro[0]"), split_unit("Vtrue,_ktas")
    (('V', 'ft/s'), ('gyro[0]', ''), ('Vtrue', 'ktas'))
    >>> split_unit("mach [1]"), split_unit("gyro [1]", ["gyro [0]", "gyro [1]"])
    (('mach', '1'), ('gyro [1]', ''))
    >>> split_unit("V/(m/s)"), split_unit("alpha in deg"), split_unit("q {deg/s}")
    (('V', 'm/s'), ('alpha', 'deg'), ('q', 'deg/s'))
    >>> split_unit("degrees/ROLL"), split_unit("m/s")
    (('ROLL', 'degrees'), ('m/s', ''))
    """
    match = _UNIT.fullmatch(name)
    if match is not None and match[1] and not match[1].endswith("/"):
        unit = (match[2] if match[2] is not None else match[3]).strip()
        apart = unit == "1" and name[len(match[1])].isspace()
        alone = apart and not any(_is_beside(other, name, match[1]) for other in others)
        if alone or not _INDEX.fullmatch(unit):
            return match[1], _SYMBOLS.get(unit, unit)
    behind = _BEHIND.fullmatch(name)
    if behind is not None and behind[1].strip("_ ") and not is_spelled(name):
        unit = next(each for each in behind.groups()[1:] if each is not None).strip()
        if is_spelled(unit):
            return behind[1].strip("_ "), _SYMBOLS.get(unit, unit)
    ahead = _AHEAD.fullmatch(name)
    if ahead is not None and is_spelled(ahead[1]) and not is_spelled(name):
        return ahead[2], ahead[1]
    return name, ""


def _is_beside(other: str, name: str, short: str) -> bool:
    """Whether another header is the same name with another index."""
    match = _UNIT.fullmatch(other)
    return match is not None and other != name and match[1] == short
