"""What in tables over the height above ground no ground effect has: humps, and ends before it has
faded.

Ground effect grows towards the ground and fades upwards without a turn. A table that turns inside
holds a mistaken number; one whose values still change where they end makes a kink in every
approach.
"""

from typing import Final

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.arguments import table_calls
from aerodb.tables.analysis.linear_terms import depends_on
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Expression
from aerodb.tables.table import Table

#: Channel that makes a table one of height.
_HEIGHT: Final = "height_above_ground"
#: Share of a table's range from which a turn counts: numbers printed with two digits turn by 1 %.
_TURN: Final = 0.02
#: Slope before a table's values end, over its mean slope, from which the end is a kink: an effect
#: that fades by an exponential or a power of height ends below a fifth of it.
_KINK: Final = 0.5


def uneven_height_tables(database: AeroDatabase) -> dict[str, str]:
    """Return table -> what no ground effect has, in a sentence with the values at breakpoints in
    their own units, for tables on a grid over the height above ground.

    A table over more than the height is judged along its line with the largest turn, and with the
    sharpest end.
    """
    found = dict[str, str]()
    for call in table_calls(database):
        table = database.tables.get(call.table)
        if table is None or call.table in found:
            continue
        over = [k for k, each in enumerate(call.arguments) if _of_height(each, database)]
        if len(over) == 1 and (words := _judged(table, over[0])):
            found[call.table] = f"table {call.table} {words}"
    return found


def _of_height(argument: Expression, database: AeroDatabase) -> bool:
    read = {*argument.names}
    for name in depends_on(argument, database) & database.variables.keys():
        read |= database.variables[name].expression.names
    return _HEIGHT in read


def _judged(table: Table, axis: int) -> str:
    """What a table (any shape) has along one of its axes that no ground effect has."""
    points, label = table.breakpoints[axis], table.arguments[axis]
    lines = np.moveaxis(table.values, axis, -1).reshape(-1, len(points))
    lines = lines[np.ptp(lines, axis=1) > 0.0]
    if not len(lines) or len(points) < 3:
        return ""
    turns = [_turn(line) for line in lines]
    size, at = max(turns)
    said = list[str]()
    if size > _TURN:
        line = lines[turns.index((size, at))]
        near = slice(max(at - 1, 0), at + 2)
        values, places = (", ".join(f"{x:.4g}" for x in each[near]) for each in (line, points))
        said.append(f"turns by {100.0 * size:.0f} % of its range: {values} at {label} {places}")
    slope, end = max(_end(line, points) for line in lines)
    way = table.extrapolation[axis] if table.extrapolation else "neither"
    if slope > _KINK and way in ("neither", "min"):
        said.append(
            f"changes at {slope:.2g} times its mean slope up to where it ends, at {end:.4g}"
        )
    return " and ".join(said)


def _turn(line: Array) -> tuple[float, int]:
    """The largest way back against the trend of a line (n,), over its range, and the node that it
    leads to."""
    rising = line if line[-1] > line[0] else -line
    back = np.maximum.accumulate(rising) - rising
    if line[-1] == line[0]:  # no trend: the lesser of both
        other = np.maximum.accumulate(-rising) + rising
        back = min(back, other, key=lambda each: float(each.max()))
    at = int(np.argmax(back))
    return float(back[at] / np.ptp(line)), at


def _end(line: Array, points: Array) -> tuple[float, float]:
    """The slope before the last change of a line (n,), over its mean slope, and where it ends."""
    last = int(np.flatnonzero(np.diff(line))[-1])
    slope = abs(line[last + 1] - line[last]) / (points[last + 1] - points[last])
    mean = np.ptp(line) / (points[last + 1] - points[0])
    return float(slope / mean), float(points[last + 1])
