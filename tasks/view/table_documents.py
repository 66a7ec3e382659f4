"""A table of a version as a document: breakpoints, values, and what its arguments are."""

from typing import Any, Final

import numpy as np

from aerodb.errors import UnknownNameError, nearest
from aerodb.tables import AeroDatabase, table_grids

#: A table with more nodes than this is shown without its values.
MOST_NODES: Final = 100_000


def table_document(database: AeroDatabase, name: str) -> dict[str, Any]:
    """Return a table: table, arguments, breakpoints, values, channels and nodes.

    values are nested, last argument fastest; None if the table is too large. channels and nodes say
    what each argument is and its values [SI] at the breakpoints; None if an argument is not a
    channel. Raises UnknownNameError for an unknown table.
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
