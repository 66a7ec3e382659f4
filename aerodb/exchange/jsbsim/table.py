"""Read JSBSim's inline tables into breakpoints and values."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.xml_elements import shortened
from aerodb.support import Array
from aerodb.tables import Table

#: Lookups of a table of one to four dimensions; `axis4` as of JSBSim 1.3.
LOOKUPS: Final = ("row", "column", "table", "axis4")
MAX_NUMBERS: Final = 1_000_000


@dataclass(frozen=True)
class InlineTable:
    """An inline table.

    properties : looked up, in the order row, column, table, axis4. breakpoints : along each. values
    : one axis per property.
    """

    properties: tuple[str, ...]
    breakpoints: tuple[Array, ...]
    values: Array


def read_table(element: Any, where: str) -> InlineTable:
    """Return a ``<table>`` of one to four dimensions: breakpoints (n,) each, values in their
    product's shape.

    Raises InputError for anything that is not in JSBSim's form.
    """
    properties: dict[str, str] = {}
    blocks: list[Any] = []
    for child in element:
        if child.tag == "independentVar":
            lookup = child.get("lookup", "row")
            unknown = set(child.attrib) - {"lookup"}
            if lookup not in LOOKUPS or lookup in properties or unknown:
                raise InputError(
                    f"unsupported <independentVar {dict(child.attrib)}>",
                    where,
                    f"use each of {', '.join(LOOKUPS)} once",
                )
            properties[lookup] = (child.text or "").strip()
        elif child.tag == "tableData":
            blocks.append(child)
        elif child.tag != "description":
            raise InputError(f"unsupported element <{child.tag}> in a table", where)
    order = LOOKUPS[: len(properties)]
    if not blocks or set(order) != set(properties):
        raise InputError(
            f"a table needs data, and lookups in the order {', '.join(LOOKUPS)}", where
        )
    names = tuple(properties[lookup] for lookup in order)
    breakpoints, values = _read(blocks, len(order), where)
    return InlineTable(names, breakpoints, values)


def _read(blocks: list[Any], dimensions: int, where: str) -> tuple[tuple[Array, ...], Array]:
    """Breakpoints and values of the ``tableData`` elements of a table or of one of its slices."""
    if dimensions > 2:
        slices = [
            _read(block.findall("tableData") if dimensions > 3 else [block], dimensions - 1, where)
            for block in blocks
            if dimensions < 4 or _only_slices(block, where)
        ]
        return stack_slices(_levels(blocks, where), slices, where)
    if len(blocks) != 1:
        raise InputError(
            f"{len(blocks)} blocks of data for a {dimensions}-dimensional table", where
        )
    grid = _numbers(blocks[0], where)
    if dimensions == 2:
        return (grid[1:, 0], grid[0, 1:]), grid[1:, 1:]
    if grid.shape[1] != 2:
        raise InputError(
            f"a one-dimensional table has {grid.shape[1]} columns instead of two", where
        )
    return (grid[:, 0],), grid[:, 1]


def _only_slices(block: Any, where: str) -> bool:
    if (
        (block.text or "").strip()
        or not len(block)
        or any(child.tag != "tableData" for child in block)
    ):
        raise InputError(
            "a block of a four-dimensional table must contain only <tableData> elements", where
        )
    return True


def _levels(blocks: list[Any], where: str) -> Array:
    try:
        return np.array([float(block.get("breakPoint", "")) for block in blocks])
    except ValueError:
        raise InputError(
            "a block of a table of three or more dimensions needs a number as breakPoint", where
        ) from None


def _numbers(element: Any, where: str) -> Array:
    """Lines of ``tableData`` as a matrix; a shorter first line gets NaN in its corner."""
    if len(element):
        raise InputError(f"unsupported element <{element[0].tag}> in table data", where)
    try:
        lines = [
            [float(word) for word in line.split()]
            for line in (element.text or "").splitlines()
            if line.strip()
        ]
    except ValueError as error:
        raise InputError(f"table data: {shortened(str(error))}", where) from None
    if not lines or sum(map(len, lines)) > MAX_NUMBERS:
        raise InputError(
            f"table data of {len(lines)} lines", where, f"between one and {MAX_NUMBERS} numbers"
        )
    width = len(lines[-1])
    if len(lines) > 1 and len(lines[0]) == width - 1:
        lines[0].insert(0, np.nan)
    if any(len(line) != width for line in lines):
        raise InputError("lines of table data differ in length", where)
    return np.array(lines)


def stack_slices(
    levels: Array, slices: list[tuple[tuple[Array, ...], Array]], where: str
) -> tuple[tuple[Array, ...], Array]:
    """Return slices at the `levels` of an additional last axis as one table.

    Slices with different breakpoints are interpolated to the union of them. This is exact, because
    they are linear in between and hold their end values.

    levels : (n,), one for each slice.
    """
    dimensions = len(slices[0][0])
    axes = tuple(
        np.unique(np.concatenate([breakpoints[k] for breakpoints, _ in slices]))
        for k in range(dimensions)
    )
    shape = (*(axis.size for axis in axes), len(slices))
    if np.prod(shape, dtype=np.float64) > MAX_NUMBERS:
        raise InputError(
            f"slices of a table on different breakpoints, {shape} on their union", where
        )
    values = np.empty(shape)
    mesh = [axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")]
    for k, (breakpoints, inside) in enumerate(slices):
        try:
            part = Table("slice", ("",) * dimensions, breakpoints, inside)
        except InputError as error:
            raise InputError(error.what, where, error.remedy) from None
        values[..., k] = part.evaluate(*mesh).reshape(shape[:-1])
    return (*axes, levels), values
