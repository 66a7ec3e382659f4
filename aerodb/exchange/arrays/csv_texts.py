"""CSV texts and the numbers in them: no cell is a formula, floats read back exactly."""

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array

#: What begins a formula in a spreadsheet, and the apostrophe that marks a cell as text.
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "'")
#: A negative number, which is no formula.
_NEGATIVE: Final = re.compile(r"-\d+(\.\d+)?(e[-+]?\d+)?", re.ASCII)


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return CSV text (RFC 4180, lines ended by LF); floats in their shortest form that reads back
    exactly; no text is a formula."""
    written = io.StringIO(newline="")
    writer = csv.writer(written, lineterminator="\n")
    for row in (header, *rows):
        writer.writerow([_as_text(cell) if isinstance(cell, str) else cell for cell in row])
    return written.getvalue()


def _as_text(cell: str) -> str:
    """A cell that spreadsheets show as text: a description may begin with ``=cmd|...``, and of an
    expression such as ``-beta`` they would make an error, or a number. A negative number is one for
    them too.

    >>> [_as_text(cell) for cell in ("-0.5", "-beta", "-1+2")]
    ['-0.5', "'-beta", "'-1+2"]
    """
    return f"'{cell}" if cell.startswith(_FORMULA) and not _NEGATIVE.fullmatch(cell) else cell


def from_text(cell: str) -> str:
    """Inverse of `_as_text`."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell


def csv_rows(text: str, where: str) -> tuple[list[str], list[list[str]]]:
    """Return header and rows (n, k) of equal width, as text (RFC 4180). Raises InputError
    otherwise."""
    try:
        rows = [row for row in csv.reader(io.StringIO(text, newline=""), strict=True) if row]
    except csv.Error as error:
        raise InputError(f"not CSV: {error}", where, "separate columns by commas") from error
    if not rows:
        raise InputError("empty", where, "export the database again")
    wrong = next((k for k, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if wrong is not None:
        raise InputError(
            f"row {wrong + 1} has {len(rows[wrong])} columns, the header {len(rows[0])}",
            where,
            "use commas",
        )
    return [from_text(cell) for cell in rows[0]], rows[1:]


def as_numbers(rows: Sequence[Sequence[str]], width: int, where: str) -> Array:
    """Cells as numbers, (len(rows), width). Raises InputError for text.

    The unit is the file's; rows : (n,) of `width` cells.
    """
    try:
        return np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64).reshape(
            len(rows), width
        )
    except ValueError as error:
        raise InputError(f"{error}", where, "write numbers with a decimal point") from error


def grid_of(points: Array, where: str) -> tuple[list[Array], Array]:
    """Breakpoints and values of a table from one row per node, in any order.

    points : (n, arguments + 1), the last column is the value.

    Raises InputError for numbers that are not finite, and for rows that fill no grid.
    """
    if not np.all(np.isfinite(points)):
        raise InputError("numbers that are not finite", where, "give every node a finite value")
    axes = [np.unique(column) for column in points[:, :-1].T]
    shape = tuple(axis.size for axis in axes)
    what = f"{len(points)} rows for a grid of {' x '.join(map(str, shape))} nodes"
    remedy = "give each combination of breakpoints exactly one row"
    if math.prod(shape) != len(points):
        raise InputError(what, where, remedy)
    index = np.ravel_multi_index(
        [np.searchsorted(a, x) for a, x in zip(axes, points[:, :-1].T, strict=True)], shape
    )
    if np.unique(index).size != len(points):
        raise InputError(f"{what}, some of them repeated", where, remedy)
    values = np.empty(len(points))
    values[index] = points[:, -1]
    return axes, values.reshape(shape)
