"""A table of a version as a document: breakpoints, values, and what its arguments are."""

from typing import Any, Final

import numpy as np

from aerodb.errors import UnknownNameError, nearest
from aerodb.tables import AeroDatabase, channel_of, table_calls, table_grids

#: A table with more nodes than this is shown without its values.
MOST_NODES: Final = 100_000


def table_document(database: AeroDatabase, name: str) -> dict[str, Any]:
    """Return a table: table, arguments, breakpoints, values, channels and nodes.

    values are nested, last argument fastest; None if the table is too large. channels and nodes say
    what each argument is and its values [SI] at the breakpoints; None if an argument is not a
    channel. A table on scattered points has points, one per value, in place of breakpoints and
    nodes. Raises UnknownNameError for an unknown table.
    """
    if name in database.scattered:
        return _scattered_document(database, name)
    if name not in database.tables:
        raise UnknownNameError(
            f"no table '{name[:80]}'",
            f"database {database.name}",
            nearest(name[:80], [*database.tables, *database.scattered]),
        )
    table, grid = database.tables[name], table_grids(database).get(name)
    return {
        "table": name,
        "arguments": list(table.arguments),
        "breakpoints": [np.asarray(points).tolist() for points in table.breakpoints],
        "channels": None if grid is None else list(grid.channels),
        "nodes": None if grid is None else [values.tolist() for values in grid.values],
        "values": np.asarray(table.values).tolist()
        if np.size(table.values) <= MOST_NODES
        else None,
    }


def _scattered_document(database: AeroDatabase, name: str) -> dict[str, Any]:
    table = database.scattered[name]
    calls = [call for call in table_calls(database) if call.table == name]
    channels = [channel_of(each, database) for each in calls[0].arguments] if calls else [None]
    return {
        "table": name,
        "arguments": list(table.arguments),
        "points": np.asarray(table.points).tolist(),
        "channels": None if None in channels else channels,
        "values": np.asarray(table.values).tolist(),
    }
