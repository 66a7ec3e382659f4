"""JSBSim's inline tables: text to breakpoints and values."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.tables.table import Table

Array = NDArray[np.float64]

_LOOKUPS = ("row", "column", "table")
MAX_NUMBERS = 1_000_000


@dataclass(frozen=True)
class InlineTable:
    """Properties looked up, breakpoints along each, and values, in the order row, column, table."""

    properties: tuple[str, ...]
    breakpoints: tuple[Array, ...]
    values: Array


def read_table(element: Any, where: str) -> InlineTable:
    """A ``<table>`` of one, two or three dimensions. Raises InputError for what is not in JSBSim's form."""
    properties: dict[str, str] = {}
    blocks: list[tuple[str, Array]] = []
    for child in element:
        if child.tag == "independentVar":
            lookup = child.get("lookup", "row")
            unknown = set(child.attrib) - {"lookup"}
            if lookup not in _LOOKUPS or lookup in properties or unknown:
                raise InputError(f"unsupported <independentVar {dict(child.attrib)}>", where, "row, column and table, once each")
            properties[lookup] = (child.text or "").strip()
        elif child.tag == "tableData":
            blocks.append((child.get("breakPoint", ""), _numbers(child, where)))
        elif child.tag != "description":
            raise InputError(f"unsupported element <{child.tag}> in a table", where)
    order = _LOOKUPS[: len(properties)]
    if not blocks or set(order) != set(properties):
        raise InputError("a table needs data and lookups row, column, table in this order", where)
    names = tuple(properties[lookup] for lookup in order)
    if len(order) == 3:
        return _stacked(names, blocks, where)
    if len(blocks) != 1:
        raise InputError(f"{len(blocks)} blocks of data for a {len(order)}-dimensional table", where)
    grid = blocks[0][1]
    if len(order) == 2:
        rows, columns, values = _plane(grid)
        return InlineTable(names, (rows, columns), values)
    if grid.shape[1] != 2:
        raise InputError(f"a one-dimensional table has two columns, here {grid.shape[1]}", where)
    return InlineTable(names, (grid[:, 0],), grid[:, 1])


def _numbers(element: Any, where: str) -> Array:
    """Lines of ``tableData`` as a matrix; a first line that is one shorter gets NaN in its corner."""
    if len(element):
        raise InputError(f"unsupported element <{element[0].tag}> in table data", where)
    try:
        lines = [[float(word) for word in line.split()] for line in (element.text or "").splitlines() if line.strip()]
    except ValueError as error:
        raise InputError(f"table data: {error}", where) from None
    if not lines or sum(map(len, lines)) > MAX_NUMBERS:
        raise InputError(f"table data of {len(lines)} lines", where, f"between one and {MAX_NUMBERS} numbers")
    width = len(lines[-1])
    if len(lines) > 1 and len(lines[0]) == width - 1:
        lines[0].insert(0, np.nan)
    if any(len(line) != width for line in lines):
        raise InputError("lines of table data differ in length", where)
    return np.array(lines)


def _plane(grid: Array) -> tuple[Array, Array, Array]:
    return grid[1:, 0], grid[0, 1:], grid[1:, 1:]


def _stacked(names: tuple[str, ...], blocks: list[tuple[str, Array]], where: str) -> InlineTable:
    """Planes at breakpoints of the third lookup; planes on different breakpoints are brought to their union, which is
    exact because they are linear in between and held outside."""
    try:
        levels = np.array([float(level) for level, _ in blocks])
    except ValueError:
        raise InputError("a block of a three-dimensional table has no number as breakPoint", where) from None
    planes = [_plane(grid) for _, grid in blocks]
    rows = np.unique(np.concatenate([plane[0] for plane in planes]))
    columns = np.unique(np.concatenate([plane[1] for plane in planes]))
    values = np.empty((rows.size, columns.size, len(planes)))
    mesh = [axis.ravel() for axis in np.meshgrid(rows, columns, indexing="ij")]
    for k, (plane_rows, plane_columns, plane_values) in enumerate(planes):
        try:
            plane = Table("plane", names[:2], (plane_rows, plane_columns), plane_values)
        except InputError as error:
            raise InputError(error.what, where, error.remedy) from None
        values[:, :, k] = plane.evaluate(*mesh).reshape(values.shape[:2])
    return InlineTable(names, (rows, columns, levels), values)
