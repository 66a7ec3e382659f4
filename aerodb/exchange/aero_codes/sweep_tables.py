"""Tables of points from CSV, text, MAT and Excel files: columns of numbers by name.

A MAT file may hold columns of one length, or breakpoints and tables over them; scalars named as
lengths are the reference.
"""

import io
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.lines import MAX_BYTES, Line, lines_of
from aerodb.exchange.arrays import mat_variables
from aerodb.exchange.xml_elements import parsed
from aerodb.support import Array

#: Names of lengths in a MAT file -> the answer that they are.
_LENGTHS: Final = {
    **dict.fromkeys(("sref", "s", "area", "aref"), "S_ref"),
    **dict.fromkeys(("cref", "cbar", "c", "mac", "chord", "lref"), "c_ref"),
    **dict.fromkeys(("bref", "b", "span"), "b_ref"),
}
#: Endings of names that say only that it is a table or a list of breakpoints.
_ENDING: Final = re.compile(r"_?(bp|breakpoints|table|tab|lut|data|vec|grid)$", re.IGNORECASE)
_BRACKETS: Final = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
#: A number with a decimal comma, between other delimiters.
_COMMA: Final = re.compile(r"[-+\u2212]?\d*,\d+([eE][-+]?\d+)?")
#: Most points of a sweep.
_MOST: Final = 200_000


@dataclass(frozen=True)
class RawTable:
    """Columns (n,) by name, their units as written, and reference lengths [SI] that it states."""

    where: str
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    lengths: Mapping[str, float] = field(default_factory=dict)


def read_table(where: str, data: bytes) -> RawTable:
    """Return the table of a file, by its content. Raises InputError with file and line for one that
    is no table of numbers."""
    if len(data) > MAX_BYTES:
        raise InputError(f"{len(data)} bytes", where, f"at most {MAX_BYTES}")
    if data.startswith(b"PK\x03\x04"):
        return _of_cells(where, _excel(where, data))
    if data[126:128] in (b"IM", b"MI"):
        return _mat(where, data)
    return _text(where, data)


def _text(where: str, data: bytes) -> RawTable:
    """A table whose header is the last line of names before the first line of numbers."""
    header: list[str] = []
    rows: list[list[float]] = []
    between = ""
    for line in lines_of([(where, data)]):
        text = line.text.strip().lstrip("#%").strip()
        if not text:
            continue
        if not between and not rows:
            cells = _cells(text, _separator(text))
            if not _is_number(cells[0]):
                header = cells
                continue
            between = _separator(text)
        cells = _cells(text, between)
        if rows and not _is_number(cells[0]):
            line.refuse(f"'{text[:40]}' among numbers", "give one table to a file")
        if len(cells) != len(header):
            line.refuse(f"{len(cells)} columns below a header of {len(header)}", "name each column")
        rows.append([line.value(cell, name) for cell, name in zip(cells, header, strict=True)])
        if len(rows) > _MOST:
            line.refuse(f"more than {_MOST} points", "give a sweep")
    return _named(where, header, rows)


def _separator(text: str) -> str:
    parts = text.split()
    if len(parts) > 1 and all(_is_number(p) or _COMMA.fullmatch(p) for p in parts):
        return "\t" if "\t" in text else " "
    return next((mark for mark in (";", ",", "\t") if mark in text), " ")


def _cells(text: str, separator: str) -> list[str]:
    blanks = separator == " "
    cells = [cell.strip().strip('"').strip() for cell in text.split(None if blanks else separator)]
    cells = cells or [""]
    while len(cells) > 1 and not cells[-1]:
        cells.pop()
    return [cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell for cell in cells]


def _is_number(text: str) -> bool:
    try:
        float(text.replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        return False
    return True


def _named(where: str, header: list[str], rows: list[list[float]]) -> RawTable:
    if not rows or len(header) < 2:
        raise InputError("no columns of numbers below their names", where, "give a header line")
    names = [_BRACKETS.sub("", cell) or cell for cell in header]
    if len(set(names)) != len(names):  # the brackets tell them apart: Cd(f), Cd(r)
        names = list(header)
    if len(set(names)) != len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise InputError(f"two columns are called '{twice}'", where, "rename one")
    units = {
        name: match[1].strip()
        for name, cell in zip(names, header, strict=True)
        if (match := _BRACKETS.search(cell))
    }
    values = np.array(rows)
    return RawTable(where, {n: values[:, k] for k, n in enumerate(names)}, units)


def _mat(where: str, data: bytes) -> RawTable:
    """Columns of equal length, or tables over breakpoints, made columns."""
    try:
        variables = mat_variables(data)
    except (OverflowError, LookupError, TypeError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", where, "save it with -v7") from None
    arrays = {n: x for n, x in variables.items() if isinstance(x, np.ndarray) and x.size}
    scalars = {n: float(x.ravel()[0]) for n, x in arrays.items() if x.size == 1}
    lengths = {_LENGTHS[n.lower()]: x for n, x in scalars.items() if n.lower() in _LENGTHS}
    vectors = {n: x.ravel() for n, x in arrays.items() if 1 < x.size == max(x.shape)}
    grids = {n: x for n, x in arrays.items() if x.size > max(x.shape)}
    if not vectors:
        raise InputError("no vectors of numbers", where, "save columns, or breakpoints and tables")
    if any(not np.all(np.isfinite(x)) for x in (*vectors.values(), *grids.values())):
        raise InputError("numbers that are not finite", where, "give every point a finite value")
    names = {n: _ENDING.sub("", n) or n for n in (*vectors, *grids)}
    if not grids:
        if len({len(x) for x in vectors.values()}) != 1:
            sizes = ", ".join(f"{n} {len(x)}" for n, x in vectors.items())
            raise InputError(f"vectors of different lengths: {sizes}", where, "save one sweep")
        return RawTable(where, {names[n]: x for n, x in vectors.items()}, {}, lengths)
    shape = next(iter(grids.values())).shape
    if any(x.shape != shape for x in grids.values()):
        raise InputError("tables of different shapes", where, "save one grid to a file")
    axes = {n: x for n, x in vectors.items() if len(x) in shape}
    ordered = [[n for n, x in axes.items() if len(x) == size] for size in shape]
    if len(axes) != len(shape) or any(len(each) != 1 for each in ordered):
        raise InputError(
            f"lengths do not tell the breakpoints of a table of {' x '.join(map(str, shape))}",
            where,
            "save a column per condition and coefficient instead",
        )
    mesh = np.meshgrid(*(axes[each[0]] for each in ordered), indexing="ij")
    columns = {names[each[0]]: x.ravel() for each, x in zip(ordered, mesh, strict=True)}
    return RawTable(where, columns | {names[n]: x.ravel() for n, x in grids.items()}, {}, lengths)


def _excel(where: str, data: bytes) -> list[list[Any]]:
    """Rows of cells of the first sheet of a workbook: numbers and texts."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as book:
            names = book.namelist()
            sheets = sorted(n for n in names if re.fullmatch(r"xl/worksheets/sheet\d+\.xml", n))
            if not sheets:
                raise InputError("no sheet in the workbook", where, "save it as .xlsx or CSV")
            first = _member(book, sheets[0], where)
            shared = "xl/sharedStrings.xml"
            texts = _member(book, shared, where) if shared in names else b""
    except InputError:
        raise
    except Exception as error:  # damaged bytes make zipfile raise any error
        raise InputError(f"not a workbook: {error}", where, "save it as CSV") from error
    strings = [
        "".join(part.text or "" for part in item.iter("{*}t"))
        for item in (parsed(texts, where, MAX_BYTES).iter("{*}si") if texts else ())
    ]
    rows = []
    for row in parsed(first, where, MAX_BYTES).iter("{*}row"):
        cells: dict[int, Any] = {}
        for cell in row.iter("{*}c"):
            at = _column(cell.get("r") or "")
            text = "".join(part.text or "" for part in cell.iter("{*}v", "{*}t"))
            if cell.get("t") == "s" and text.isdigit() and int(text) < len(strings):
                text = strings[int(text)]
            cells[at if at >= 0 else len(cells)] = text.strip()
        if cells and max(cells) < 1000:
            rows.append([cells.get(k, "") for k in range(max(cells) + 1)])
    return rows


def _member(book: zipfile.ZipFile, name: str, where: str) -> bytes:
    with book.open(name) as member:
        content = member.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise InputError("the sheet is too large", where, f"at most {MAX_BYTES} bytes")
    return content


def _column(reference: str) -> int:
    """
    >>> _column("A1"), _column("AB12"), _column("")
    (0, 27, -1)
    """
    letters = re.match(r"[A-Z]{0,3}", reference)
    at = 0
    for letter in letters[0] if letters else "":
        at = at * 26 + ord(letter) - 64
    return at - 1


def _of_cells(where: str, rows: list[list[Any]]) -> RawTable:
    """The block of numbers below the last row of names."""
    header: list[str] = []
    numbers: list[list[float]] = []
    for at, row in enumerate(rows, 1):
        cells = row[: len(header)] if numbers else row
        filled = [cell for cell in cells if cell != ""]
        if not filled:
            if numbers:
                break
            continue
        if not _is_number(filled[0]):
            if numbers:
                break
            header = [str(cell) for cell in row]
            while header and not header[-1]:
                header.pop()
            continue
        line = Line(where, at, " ".join(map(str, row)))
        cells = row[: len(header)]
        if len(filled) < len(header) or len(cells) != len(header):
            line.refuse(f"{len(filled)} numbers below {len(header)} names", "fill every cell")
        numbers.append([line.value(str(c), n) for c, n in zip(cells, header, strict=True)])
    return _named(where, header, numbers)
