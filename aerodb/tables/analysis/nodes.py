"""Table nodes as points over channels.

A table's breakpoints are in the unit of its argument, which is an expression. Lineage and
comparison between versions need nodes over channels; these exist only where the expression is one
channel, scaled and offset (``alpha``, ``57.3*alpha``).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import DENSITY_0
from aerodb.support import Array
from aerodb.tables.analysis.arguments import table_calls
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Expression, Name, TableCall

#: An argument counts as a scaled channel where the inverse reproduces every breakpoint to this
#: fraction of the largest one.
_EXACT = 1e-9


@dataclass(frozen=True, eq=False)
class TableGrid:
    """Nodes of a table over channels: per argument the channel and its values (m,) at the
    breakpoints."""

    table: str
    channels: tuple[str, ...]
    values: tuple[Array, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis) for axis in self.values)

    def points(self) -> dict[str, Array]:
        """Channel -> (n,) values in SI units at all n nodes, the last argument varying fastest."""
        mesh = np.meshgrid(*self.values, indexing="ij")
        return {name: grid.ravel() for name, grid in zip(self.channels, mesh, strict=True)}

    def node(self, index: tuple[int, ...]) -> dict[str, float]:
        """Channel -> value at a node. Raises InputError for an index outside the table.

        Values are in the channel's unit ([rad], [m/s], [-]).
        """
        if len(index) != len(self.shape) or any(
            not 0 <= k < n for k, n in zip(index, self.shape, strict=True)
        ):
            shape = ", ".join(f"0..{n - 1}" for n in self.shape)
            raise InputError(
                f"no node {list(index)}", f"table {self.table}", f"indices go from 0: [{shape}]"
            )
        return {
            name: float(axis[k])
            for name, axis, k in zip(self.channels, self.values, index, strict=True)
        }


def table_grids(database: AeroDatabase) -> dict[str, TableGrid]:
    """Return table name -> nodes over channels, arrays (n,) in SI units, for tables whose arguments
    are different channels, scaled and offset."""
    grids: dict[str, TableGrid] = {}
    for call in table_calls(database):
        if call.table not in grids:
            grid = _grid(call, database)
            if grid is not None:
                grids[call.table] = grid
    return grids


def table_axes(database: AeroDatabase) -> dict[str, frozenset[str]]:
    """Return table name -> axes of the terms that use it, directly or through variables."""
    axes: dict[str, set[str]] = {name: set() for name in (*database.tables, *database.scattered)}
    for term in database.coefficient_terms:
        pending, visited = [term.expression], set[str]()
        while pending:
            node = pending.pop()
            pending.extend(node.children)
            if isinstance(node, TableCall):
                axes[node.table].add(term.axis)
            if (
                isinstance(node, Name)
                and node.name in database.variables
                and node.name not in visited
            ):
                visited.add(node.name)
                pending.append(database.variables[node.name].expression)
    return {name: frozenset(names) for name, names in axes.items()}


def air_beside(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return rho [kg/m3] and qbar [Pa] that belong to a stated airspeed V [m/s] and to each other:
    those that are stated, and without any density that of the standard atmosphere at sea level.

    >>> air_beside({"V": 40.0, "qbar": 800.0})
    {'rho': 1.0, 'qbar': 800.0}
    """
    speed = stated["V"]
    alone = 2.0 * stated["qbar"] / speed**2 if "qbar" in stated else DENSITY_0
    rho = stated.get("rho", alone)
    return {"rho": rho, "qbar": stated.get("qbar", 0.5 * rho * speed**2)}


def vary(point: Mapping[str, float], over: Mapping[str, Array]) -> dict[str, Array]:
    """Channels (n,): those of `over` (each (n,)) as given, those of `point` constant."""
    n = max((len(values) for values in over.values()), default=1)
    return {**{name: np.full(n, value) for name, value in point.items()}, **over}


def _grid(call: TableCall, database: AeroDatabase) -> TableGrid | None:
    table = database.tables.get(call.table)
    if table is None:  # on scattered points, which are no grid
        return None
    breakpoints = table.breakpoints
    inverses = [
        _inverse(argument, axis, database)
        for argument, axis in zip(call.arguments, breakpoints, strict=True)
    ]
    known = [entry for entry in inverses if entry is not None]
    channels = tuple(name for name, _ in known)
    if len(known) < len(inverses) or len(set(channels)) < len(channels):
        return None
    return TableGrid(call.table, channels, tuple(values for _, values in known))


def _inverse(
    argument: Expression, breakpoints: Array, database: AeroDatabase
) -> tuple[str, Array] | None:
    """The only channel that an argument depends on, and its values at the breakpoints; None where
    the argument is not one channel, scaled and offset."""
    definitions = {name: variable.expression for name, variable in database.variables.items()}
    program = database.compiled([argument], definitions, {**database.tables, **database.scattered})
    if len(program.inputs) != 1:
        return None
    (name,) = program.inputs
    low, high = (
        float(np.asarray(program.run({name: np.array([x])}).values[0])[0]) for x in (0.0, 1.0)
    )
    if not np.isfinite(low + high) or high == low:
        return None
    values = (breakpoints - low) / (high - low)
    back = np.asarray(program.run({name: values}).values[0])
    scale = float(np.max(np.abs(breakpoints))) or 1.0
    return (name, values) if np.allclose(back, breakpoints, rtol=0.0, atol=_EXACT * scale) else None
