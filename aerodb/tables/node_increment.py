"""An increment on table nodes: the same correction as values on a grid, with the covariance between all nodes.

Within a cell of the grid every regressor, its hold at the envelope's edge and its fading are linear in each variable, so
that the table carries them exactly: evaluation through the nodes and through the expressions agree to rounding.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.arguments import breakpoints_over
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Value
from aerodb.tables.increment import Increment, IncrementValue
from aerodb.tables.multilinear import NotMultilinearError, breaks, merged
from aerodb.tables.table import MAX_DIMENSIONS, Table

#: Nodes of one grid: more would cost more memory than an exact table is worth.
MAX_NODES: Final = 500_000


@dataclass(frozen=True, eq=False)
class NodeIncrement:
    """An increment as a table.

    table : node values. jacobian : (nodes, k), the regressors as they act at each node, fading included. held : (nodes,
    k), the same without fading. Node values are ``jacobian @ estimates``; their covariance is ``J C J'``, of rank k.
    """

    increment: Increment
    table: Table
    jacobian: Array
    held: Array

    def covariance(self, nodes: Any = slice(None)) -> Array:
        """Covariance (m, m) between `nodes` (flat indices, all of them by default) of the table."""
        rows = self.jacobian[nodes]
        return np.asarray(rows @ self.increment.covariance @ rows.T, dtype=np.float64)

    @property
    def standard_error(self) -> Array:
        """Standard error of every node from the estimates alone, in the shape of the table."""
        variance = np.einsum("mk,kl,ml->m", self.jacobian, self.increment.covariance, self.jacobian)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)).reshape(self.table.values.shape))

    def evaluate(self, channels: Mapping[str, Value]) -> IncrementValue:
        """Value, standard error and whether inside the envelope, (n,), as `Increment.evaluate` gives them."""
        basis = self.table.basis(*[np.asarray(channels[name], dtype=np.float64) for name in self.table.arguments])
        inside = np.ones(basis.shape[0], dtype=np.bool_)
        for name, interval in self.increment.envelope.items():
            inside &= interval.contains(channels[name])
        return self.increment.combined(basis @ self.jacobian, basis @ self.held, inside)


def on_nodes(increment: Increment, database: AeroDatabase) -> NodeIncrement:
    """`increment` on the union of the database's breakpoints over its variables, its slope breaks and its envelope's corners.

    Raises InputError, with the reason, where a regressor is linear in its variables nowhere, has a variable without
    envelope, or where the grid would have more than `MAX_NODES` nodes.
    """
    where, found = f"increment on {increment.axis}", dict[str, set[float]]()
    for k, regressor in enumerate(increment.regressors):
        try:
            for name, points in knots(regressor, increment, increment.fading(k)).items():
                found[name] = found.get(name, set()) | points
        except NotMultilinearError as error:
            raise InputError(str(error), where, "keep it as an expression") from error
    found = found or {"alpha": {0.0}}  # a constant without envelope: one node says it all
    axes = [merged(union(breakpoints_over(name, database)), points) for name, points in sorted(found.items())]
    size = math.prod(axis.size for axis in axes)
    if size > MAX_NODES or len(axes) > MAX_DIMENSIONS:
        raise InputError(f"a grid of {size} nodes over {', '.join(sorted(found))}", where, f"at most {MAX_NODES}")
    mesh = dict(zip(sorted(found), (x.ravel() for x in np.meshgrid(*axes, indexing="ij")), strict=True))
    jacobian, held = columns_at(increment, mesh)
    shape = tuple(axis.size for axis in axes)
    values = (jacobian @ increment.estimates).reshape(shape)
    table = Table(f"increment_{increment.axis}", tuple(sorted(found)), tuple(axes), values)
    return NodeIncrement(increment, table, jacobian, held)


def knots(regressor: Expression, increment: Increment, fading: frozenset[str]) -> dict[str, set[float]]:
    """Per variable, where `regressor` under the envelope rule bends; `fading`: whose envelopes take weight from it.

    Raises NotMultilinearError with the reason where it is not multilinear between such points.
    """
    free = sorted(regressor.names - increment.envelope.keys())
    if free:
        raise NotMultilinearError(f"'{regressor}' goes on without end in {', '.join(free)}, which has no envelope")
    found = breaks(regressor, {name: (i.low, i.high) for name, i in increment.envelope.items()})
    for name in sorted(fading):
        interval = increment.envelope[name]
        if interval.cell == 0.0:
            raise NotMultilinearError(f"its envelope over {name} ends in a step")
        corners = {interval.low - 2 * interval.cell, interval.low - interval.cell}
        corners |= {interval.high + interval.cell, interval.high + 2 * interval.cell}
        found[name] = found.get(name, set()) | corners | ({interval.low, interval.high} if name in found else set())
    return found


def columns_at(increment: Increment, mesh: Mapping[str, Array]) -> tuple[Array, Array]:
    """Regressors at nodes as they act and without fading, (m, k) each; variables that `mesh` lacks lie inside the envelope."""
    m = len(next(iter(mesh.values())))
    middle = {name: np.full(m, (i.low + i.high) / 2) for name, i in increment.envelope.items()}
    columns, weights = increment.columns({**middle, **mesh})
    k = columns.shape[1]
    return np.broadcast_to(columns * weights, (m, k)), np.broadcast_to(columns, (m, k))


def union(axes: list[Array]) -> Array:
    """Breakpoints of several axes as one increasing axis."""
    return np.unique(np.concatenate(axes)) if axes else np.empty(0)
