"""Pictures of rolls on the ground: speed over time, with where the deceleration jumps."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

#: Width and height of a picture, as its template states them, and its margins: left and below for
#: numbers, elsewhere for the curve [pixels].
_WIDTH: Final = 600
_HEIGHT: Final = 200
_LEFT: Final = 40
_BELOW: Final = 20
_EDGE: Final = 8
#: Most lines of a grid in each direction.
_LINES: Final = 6


def drawn_rolls(rolls: Sequence[Mapping[str, Any]], zero: float, factor: float) -> list[Any]:
    """Return what is drawn of each roll of a flight's document: the points of its phases (`seen`)
    and on to its standstill (`ahead`), where it jumps (`spots`), and a `grid` with numbers.

    zero : time [s] that the page counts from. factor : from [m/s] to the unit that is shown.
    """
    return [_drawn(roll, zero, factor) for roll in rolls]


def _drawn(roll: Mapping[str, Any], zero: float, factor: float) -> dict[str, Any]:
    phases, first = roll["phases"], roll["start"]
    corners = [(phases[0]["start"], phases[0]["fast"])]
    corners += [(each["end"], each["slow"]) for each in phases]
    last = max(first + roll["time"], corners[-1][0])
    top = max(speed for _, speed in corners)

    def across(time: float) -> float:
        return round(_LEFT + (time - first) / (last - first) * (_WIDTH - _LEFT - _EDGE), 1)

    def up(speed: float) -> float:
        return round(_EDGE + (1.0 - speed / top) * (_HEIGHT - _EDGE - _BELOW), 1)

    def points(some: Sequence[tuple[float, float]]) -> str:
        return " ".join(f"{across(time)},{up(max(speed, 0.0))}" for time, speed in some)

    grid: list[dict[str, Any]] = []
    for each in _round_numbers(0.0, top * factor):
        y = up(each / factor)
        ends = {"x1": _LEFT, "y1": y, "x2": _WIDTH - _EDGE, "y2": y}
        text = {"x": _LEFT - 6, "y": y + 4.0, "anchor": "end", "text": f"{each:g}"}
        grid.append(ends | text)
    for each in _round_numbers(first - zero, last - zero):
        x = across(each + zero)
        ends = {"x1": x, "y1": _EDGE, "x2": x, "y2": _HEIGHT - _BELOW}
        text = {"x": x, "y": _HEIGHT - 5, "anchor": "middle", "text": f"{each:g}"}
        grid.append(ends | text)
    return {
        "seen": points(corners),
        "ahead": points([corners[-1], (last, 0.0)]) if roll["stands"] else "",
        "spots": [(across(time), up(speed)) for time, speed in corners[1:-1]],
        "grid": grid,
    }


def _round_numbers(low: float, high: float) -> Iterator[float]:
    """Multiples of 1, 2 or 5 times a power of ten between two numbers, six at most.

    >>> list(_round_numbers(0.0, 70.0)), list(_round_numbers(3.1, 9.0))
    ([0.0, 20.0, 40.0, 60.0], [4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    """
    least = (high - low) / _LINES
    decade = 10.0 ** math.floor(math.log10(least))
    step = next(decade * k for k in (1.0, 2.0, 5.0, 10.0) if decade * k >= least)
    for k in range(math.ceil(low / step), math.floor(high / step) + 1):
        yield k * step
