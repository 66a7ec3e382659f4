"""The family of a version as boxes and lines: where each stands, for a drawing on a page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

WIDTH: Final = 168
HEIGHT: Final = 92
_ACROSS, _DOWN, _EDGE = 218, 118, 12


@dataclass(frozen=True)
class Relative:
    """A version in the graph. made : when, for people. names : those that point at it now. flights
    : role -> how many."""

    id: str
    label: str
    parent: str | None
    made: str
    names: tuple[str, ...]
    flights: Mapping[str, int]
    stale: bool = False


@dataclass(frozen=True)
class Box:
    """A relative at its place (px, upper left corner)."""

    relative: Relative
    x: int
    y: int
    current: bool


@dataclass(frozen=True)
class Graph:
    """Boxes, lines between them as (x, y, x, y) from parent to child, and the size of the drawing,
    px."""

    boxes: tuple[Box, ...]
    lines: tuple[tuple[int, int, int, int], ...]
    width: int
    height: int


def lineage_graph(family: Sequence[Relative], current: str) -> Graph:
    """The family (parents before their children) from left to right: a generation per column, a
    branch per row.

    A version whose parent is not in `family` begins a row of its own.
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
    place = {id: (_EDGE + _ACROSS * column[id], _EDGE + _DOWN * row[id]) for id in column}
    boxes = tuple(Box(relative, *place[relative.id], relative.id == current) for relative in family)
    lines = tuple(
        (
            place[relative.parent][0] + WIDTH,
            place[relative.parent][1] + HEIGHT // 2,
            place[relative.id][0],
            place[relative.id][1] + HEIGHT // 2,
        )
        for relative in family
        if relative.parent in place
    )
    width = max((x for x, _ in place.values()), default=0) + WIDTH + _EDGE
    height = max((y for _, y in place.values()), default=0) + HEIGHT + _EDGE
    return Graph(boxes, lines, width, height)
