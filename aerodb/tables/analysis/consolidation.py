"""Consolidation: fold increments into the tables of a database, and trace a table node back to its
flights.

A regressor can be folded in exactly where a table on its axis enters linearly: the term is the
table's value times a constant, or times factors that the regressor has too, and the regressor's
contribution is multilinear on the union of the breakpoints. Otherwise it remains a layer added to
the coefficient, and `plan_consolidation` gives the reason. Values, standard errors and places are
the same either way.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.support import Array
from aerodb.tables.algebra import times
from aerodb.tables.analysis.arguments import ScaledChannel, rebuilt
from aerodb.tables.analysis.linear_terms import LinearTable, factors_of, linear_tables
from aerodb.tables.analysis.multilinear import NotMultilinearError, merged
from aerodb.tables.analysis.node_increment import MAX_NODES, columns_at, knots
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Expression, Name, Number, TableCall, number
from aerodb.tables.functions import Value
from aerodb.tables.increment import Increment
from aerodb.tables.table import MAX_DIMENSIONS, Table
from aerodb.tables.uncertainty import Bound, Uncertainty


@dataclass(frozen=True)
class Fold:
    """Where a regressor is folded in.

    Parameters
    ----------
    increment, regressor : indices.
    table : name; empty where the regressor remains a layer.
    reason : why it remains a layer; empty where it is folded.
    """

    increment: int
    regressor: int
    table: str
    reason: str = ""


@dataclass(frozen=True)
class NodeShare:
    """Contribution of one increment at a table node: value and standard error in the table's unit,
    and the flights that it was identified from."""

    increment: int
    axis: str
    regressors: tuple[str, ...]
    flights: tuple[str, ...]
    value: float
    standard_error: float


@dataclass
class _Grid:
    """The axes that a table will have: channels (None: a formula), breakpoints in the unit of the
    argument, and contributions as (increment, regressor, expression within the table)."""

    site: LinearTable
    channels: list[ScaledChannel | None]
    axes: list[Array]
    shares: list[tuple[int, int, Expression]] = field(default_factory=list)

    def grown(self, new_knots: Mapping[str, set[float]]) -> "_Grid":
        """The grid with the breakpoints of one more contribution; new axes come last."""
        extra = sorted(new_knots.keys() - {channel.name for channel in self.channels if channel})
        channels = [*self.channels, *map(ScaledChannel, extra)]
        axes = []
        for channel, axis in zip(
            channels, [*self.axes, *[np.empty(0) for _ in extra]], strict=True
        ):
            points = (
                channel.argument(np.array(sorted(new_knots.get(channel.name, ()))))
                if channel
                else np.empty(0)
            )
            axes.append(merged(axis, set(points.tolist())))
        return _Grid(self.site, channels, axes, list(self.shares))

    def mesh(self, nodes: list[Array]) -> dict[str, Array]:
        """Channel values at `nodes`, which are in the unit of each argument."""
        return {
            channel.name: channel.channel(x)
            for channel, x in zip(self.channels, nodes, strict=True)
            if channel
        }

    @property
    def size(self) -> int:
        return math.prod(axis.size for axis in self.axes)


def plan_consolidation(database: AeroDatabase) -> tuple[Fold, ...]:
    """Return for every regressor that acts as a layer: the table that `consolidate` folds it into,
    or the reason why it remains a layer."""
    return _planned(database)[0]


def consolidate(database: AeroDatabase) -> AeroDatabase:
    """Fold increments into tables that enter linearly, on the union of breakpoints.

    `plan_consolidation` tells which are folded and which are not. Results agree with the layered
    database to rounding. Where an increment fades in a variable that the table lacks (the envelope
    in beta, say), the table gets that variable as an axis. Increments remain listed with estimates,
    covariance, envelope and flights; `Increment.folded` marks what is folded, so that standard
    errors and lineage are kept. Coefficients stay dimensionless.
    """
    folds, grids = _planned(database)
    tables = dict(database.tables)
    for name, grid in grids.items():
        tables[name] = _folded(tables[name], grid, database.increments)
    tables_of = {(fold.increment, fold.regressor): fold.table for fold in folds}
    increments = tuple(
        replace(
            increment,
            folded=tuple(tables_of.get((i, k), table) for k, table in enumerate(increment.folded)),
        )
        for i, increment in enumerate(database.increments)
    )

    def extended(node: Expression) -> Expression:
        if not isinstance(node, TableCall) or node.table not in grids:
            return node
        extra = grids[node.table].channels[len(node.arguments) :]
        return TableCall(
            node.table, (*node.arguments, *[Name(channel.name) for channel in extra if channel])
        )

    return replace(
        database,
        tables=tables,
        terms=tuple(
            replace(term, expression=rebuilt(term.expression, extended)) for term in database.terms
        ),
        variables={
            n: replace(v, expression=rebuilt(v.expression, extended))
            for n, v in database.variables.items()
        },
        increments=increments,
    )


def node_lineage(
    database: AeroDatabase, table: str, node: tuple[int, ...]
) -> tuple[NodeShare, ...]:
    """The increments, and so the flights, behind a table node; empty where the node has the
    source's own value.

    Parameters
    ----------
    database : layered or consolidated. In a layered one, the contributions that would be folded
        into the node, with the variables that the table lacks inside the envelope.
    node : (N,) one index per axis of the table, from 0.

    Raises UnknownNameError for an unknown table and InputError for an index beyond its axes.
    """
    if table not in database.tables:
        raise UnknownNameError(
            f"no table '{table}'", f"database {database.name}", nearest(table, database.tables)
        )
    grid = database.tables[table]
    if len(node) != grid.values.ndim:
        raise InputError(
            f"node {node}", f"table {table}", f"one index for each of: {', '.join(grid.arguments)}"
        )
    if any(not 0 <= index < size for index, size in zip(node, grid.values.shape, strict=True)):
        raise InputError(
            f"node {node}", f"table {table}", f"indices below {grid.values.shape}, counted from 0"
        )
    where = {site.table: site for site in linear_tables(database)}.get(table)
    if where is None:
        return ()
    at = [axis[index : index + 1] for axis, index in zip(grid.breakpoints, node, strict=True)]
    mesh = _Grid(where, list(where.channels), []).mesh(at)
    planned = {
        (fold.increment, fold.regressor): fold.table for fold in plan_consolidation(database)
    }
    shares = []
    for i, increment in enumerate(database.increments):
        own = [k for k, name in enumerate(increment.folded) if (name or planned[i, k]) == table]
        share = _share_at(i, increment, own, where, mesh)
        shares += [share] if share is not None else []
    return tuple(shares)


def point_lineage(database: AeroDatabase, channels: Mapping[str, Value]) -> tuple[NodeShare, ...]:
    """The increments that act at one point (channels: numbers), with value and standard error on
    their axis.

    channels in SI units; values and standard errors [-].
    """
    shares = []
    names = set[str]().union(*(increment.names for increment in database.increments))
    values = database.resolved(sorted(names), channels)
    for i, increment in enumerate(database.increments):
        columns, weights = increment.columns(values)
        if np.any(columns * weights != 0.0):
            result = increment.evaluate(values)
            regressors = tuple(map(str, increment.regressors))
            value, error = float(result.value[0]), float(result.standard_error[0])
            shares.append(NodeShare(i, increment.axis, regressors, increment.flights, value, error))
    return tuple(shares)


def _share_at(
    i: int, increment: Increment, own: list[int], site: LinearTable, mesh: Mapping[str, Array]
) -> NodeShare | None:
    within_table = {
        k: part for k in own if (part := _within_table(increment.regressors[k], site)) is not None
    }
    own = list(within_table)
    jacobian = (
        _restricted(increment, list(within_table.values()), mesh or {"alpha": np.zeros(1)}, site)
        if own
        else np.zeros((1, 0))
    )
    if not np.any(jacobian):
        return None
    covariance = increment.covariance[np.ix_(own, own)]
    error = float(np.sqrt(max(float(jacobian[0] @ covariance @ jacobian[0]), 0.0)))
    names = tuple(str(increment.regressors[k]) for k in own)
    value = float(jacobian[0] @ increment.estimates[own])
    return NodeShare(i, increment.axis, names, increment.flights, value, error)


def _planned(database: AeroDatabase) -> tuple[tuple[Fold, ...], dict[str, _Grid]]:
    """Return where every regressor is folded in, and the new grids of the tables concerned."""
    open_sites, grids, folds = linear_tables(database), dict[str, _Grid](), []
    for i, increment in enumerate(database.increments):
        for k, table in enumerate(increment.folded):
            if table:
                continue
            best, reason = None, f"no table on {increment.axis} over its variables enters linearly"
            for site in open_sites:
                part = (
                    _within_table(increment.regressors[k], site)
                    if site.axis == increment.axis
                    else None
                )
                if part is None:
                    continue
                try:
                    grid = _grown(database, grids, site, part, increment, k)
                except NotMultilinearError as error:
                    reason = str(error)
                    continue
                if best is None or (len(grid.channels), grid.size) < (
                    len(best[0].channels),
                    best[0].size,
                ):
                    best = grid, part
            if best is None:
                folds.append(Fold(i, k, "", reason))
                continue
            best[0].shares.append((i, k, best[1]))
            grids[best[0].site.table] = best[0]
            folds.append(Fold(i, k, best[0].site.table))
    return tuple(folds), grids


def _grown(
    database: AeroDatabase,
    grids: Mapping[str, _Grid],
    site: LinearTable,
    part: Expression,
    increment: Increment,
    k: int,
) -> _Grid:
    """The grid of the site's table with one more contribution; NotMultilinearError where the table
    cannot represent it exactly."""
    outside = increment.regressors[k].names - part.names
    fenced = sorted(outside & increment.envelope.keys())
    if fenced:
        raise NotMultilinearError(
            f"the flown range over {', '.join(fenced)} acts on a factor outside the table"
        )
    if increment.margins is not None:
        raise NotMultilinearError("it continues beyond its flown range, and a table would end")
    new_knots = knots(part, increment, increment.fading(k))
    table = database.tables[site.table]
    grid = grids.get(site.table) or _Grid(site, list(site.channels), list(table.breakpoints))
    grown = grid.grown(new_knots)
    if grown.size > MAX_NODES or len(grown.axes) > MAX_DIMENSIONS:
        raise NotMultilinearError(f"table {site.table} would have {grown.size} nodes")
    return grown


def _within_table(regressor: Expression, site: LinearTable) -> Expression | None:
    """`regressor` divided by the factors of the site's term; None where the quotient is not a
    function of the table's own channels."""
    constant, left = factors_of(regressor)
    for factor in site.factors:
        if factor not in left:
            return None
        left.remove(factor)
    part: Expression = Number(1.0)
    for k, factor in enumerate(left):
        part = factor if k == 0 else times(part, factor)
    if constant != 1.0:
        part = number(constant) if not left else times(number(constant), part)
    return part if part.names <= site.own else None


def _restricted(
    increment: Increment, parts: list[Expression], mesh: Mapping[str, Array], site: LinearTable
) -> Array:
    """Values of `parts` at the nodes of `mesh`, (m, len(parts)), in the table's unit, fading
    included."""
    k = len(parts)
    alone = Increment(
        increment.axis, tuple(parts), np.zeros(k), np.zeros((k, k)), increment.envelope
    )
    return columns_at(alone, mesh)[0] / site.constant


def _folded(table: Table, grid: _Grid, increments: tuple[Increment, ...]) -> Table:
    """`table` on its new grid, with all contributions added."""
    mesh = [x.ravel() for x in np.meshgrid(*grid.axes, indexing="ij")]
    channels = grid.mesh(mesh)
    dimensions = len(table.breakpoints)
    values = table.evaluate(*mesh[:dimensions])
    for i, k, part in grid.shares:
        share = _restricted(increments[i], [part], channels, grid.site)
        values = values + share[:, 0] * increments[i].estimates[k]
    extra = tuple(channel.name for channel in grid.channels[dimensions:] if channel)
    own = table.extent or tuple((float(axis[0]), float(axis[-1])) for axis in table.breakpoints)
    return replace(
        table,
        arguments=(*table.arguments, *extra),
        breakpoints=tuple(grid.axes),
        values=values.reshape([axis.size for axis in grid.axes]),
        extent=(*own, *[None for _ in extra]),
        uncertainty=_on_grid(table, mesh[:dimensions]),
    )


def _on_grid(table: Table, mesh: list[Array]) -> Uncertainty | None:
    """The table's declared uncertainty, with bounds per node interpolated to the new nodes."""
    if table.uncertainty is None:
        return None

    def moved(bound: Bound) -> Bound:
        if not isinstance(bound, tuple):
            return bound
        values = np.array(bound).reshape(table.values.shape)
        return tuple(replace(table, values=values, uncertainty=None).evaluate(*mesh).tolist())

    return replace(table.uncertainty, bounds=tuple(map(moved, table.uncertainty.bounds)))
