"""Layout of the lineage of a version as boxes and lines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

WIDTH: Final = 168
HEIGHT: Final = 92
#: Distance of the corners of two neighbours in a row, in the unit of `WIDTH`.
_ACROSS: Final = 218
#: Distance of the corners of two neighbours in a column, in the same unit.
_DOWN: Final = 118
#: Free margin around the figure, in the same unit.
_EDGE: Final = 12


@dataclass(frozen=True)
class Relative:
    """A version in the lineage graph.

    created : display text of its time. names : names that point to it now. flights : role -> number
    of flights.
    """

    id: str
    label: str
    parent: str | None
    created: str
    names: tuple[str, ...]
    flights: Mapping[str, int]
    stale: bool = False


@dataclass(frozen=True)
class Box:
    """A version and the position of its upper left corner [px]."""

    relative: Relative
    x: int
    y: int
    current: bool


@dataclass(frozen=True)
class Graph:
    """Boxes, lines (x, y, x, y) from parent to child, the size of the drawing, and width and height
    of a box, all in px."""

    boxes: tuple[Box, ...]
    lines: tuple[tuple[int, int, int, int], ...]
    width: int
    height: int
    box: tuple[int, int] = (WIDTH, HEIGHT)


def lineage_graph(family: Sequence[Relative], current: str) -> Graph:
    """Lay out the lineage from left to right: one column per generation, one row per branch.

    family : versions, parents before their children; one whose parent is not among them starts a
    new row. current : id of the version to highlight. Places are in [px]; see `Graph`.
    """
    column: dict[str, int] = {}
    row: dict[str, int] = {}
    rows = 0
    for relative in family:
        parent = relative.parent
        column[relative.id] = column[parent] + 1 if parent in column else 0
        straight = parent in row and (column[relative.id], row[parent]) not in {
            (column[k], row[k]) for k in row
        }
        row[relative.id] = row[parent] if straight and parent is not None else rows
        rows = max(rows, row[relative.id] + 1)
    corner = {id: (_EDGE + _ACROSS * column[id], _EDGE + _DOWN * row[id]) for id in column}
    boxes = tuple(
        Box(relative, *corner[relative.id], relative.id == current) for relative in family
    )
    lines = tuple(
        (
            corner[relative.parent][0] + WIDTH,
            corner[relative.parent][1] + HEIGHT // 2,
            corner[relative.id][0],
            corner[relative.id][1] + HEIGHT // 2,
        )
        for relative in family
        if relative.parent in corner
    )
    width = max((x for x, _ in corner.values()), default=0) + WIDTH + _EDGE
    height = max((y for _, y in corner.values()), default=0) + HEIGHT + _EDGE
    return Graph(boxes, lines, width, height)
