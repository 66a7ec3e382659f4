"""A table of a version as a document: breakpoints, values, and how its nodes are called."""

from typing import Any, Final

import numpy as np

from aerodb.errors import UnknownNameError, nearest
from aerodb.tables import AeroDatabase, table_grids

#: A table of more nodes than this is shown by its breakpoints alone.
MOST_NODES: Final = 100_000


def table_document(database: AeroDatabase, name: str) -> dict[str, Any]:
    """Document of a table: table, arguments, breakpoints, values (nested, last argument fastest;
    None where it is too large), channels and nodes: what each argument is, and its values [SI] at
    the breakpoints, None where it is no channel.

    Raises UnknownNameError for a name that no table of the database has.
    """
    if name not in database.tables:
        raise UnknownNameError(
            f"no table '{name[:80]}'",
            f"database {database.name}",
            nearest(name[:80], database.tables),
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
