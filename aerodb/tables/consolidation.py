"""Consolidation: increments folded into the tables of a database, and the way back from a table
node to its flights.

A regressor's share can be folded exactly where a table on its axis enters linearly: the term is the
table's value times a constant, or times factors that the regressor has too, and the share is
multilinear on the union of the breakpoints. Where it cannot, it stays a layer, and `plan` says why.
Values, standard errors and places are the same either way.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.support import Array
from aerodb.tables.algebra import times
from aerodb.tables.arguments import ScaledChannel, rebuilt
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Expression, Name, Number, TableCall, number
from aerodb.tables.functions import Value
from aerodb.tables.increment import Increment
from aerodb.tables.linear_terms import Site, factors_of, sites
from aerodb.tables.multilinear import NotMultilinearError, merged
from aerodb.tables.node_increment import MAX_NODES, columns_at, knots
from aerodb.tables.table import MAX_DIMENSIONS, Table
from aerodb.tables.uncertainty import Bound, Uncertainty


@dataclass(frozen=True)
class Fold:
    """Where a regressor goes: increment and regressor by number, the table, or "" and the reason
    why it stays a layer."""

    increment: int
    regressor: int
    table: str
    reason: str = ""


@dataclass(frozen=True)
class NodeShare:
    """What one increment adds at a table node: value and standard error in the table's unit, and
    the flights behind it."""

    increment: int
    axis: str
    regressors: tuple[str, ...]
    flights: tuple[str, ...]
    value: float
    standard_error: float


@dataclass
class _Grid:
    """The axes that a table will have: channels (None: a formula) and breakpoints in the unit of
    the argument."""

    site: Site
    channels: list[ScaledChannel | None]
    axes: list[Array]
    shares: list[tuple[int, int, Expression]] = field(default_factory=list)

    def grown(self, found: Mapping[str, set[float]]) -> "_Grid":
        """With the breakpoints of one more share; axes that the table lacks come last."""
        extra = sorted(found.keys() - {channel.name for channel in self.channels if channel})
        channels = [*self.channels, *map(ScaledChannel, extra)]
        axes = []
        for channel, axis in zip(
            channels, [*self.axes, *[np.empty(0) for _ in extra]], strict=True
        ):
            points = (
                channel.argument(np.array(sorted(found.get(channel.name, ()))))
                if channel
                else np.empty(0)
            )
            axes.append(merged(axis, set(points.tolist())))
        return _Grid(self.site, channels, axes, list(self.shares))

    def mesh(self, nodes: list[Array]) -> dict[str, Array]:
        """Channel values at nodes, given in the unit of each argument."""
        return {
            channel.name: channel.channel(x)
            for channel, x in zip(self.channels, nodes, strict=True)
            if channel
        }

    @property
    def size(self) -> int:
        return math.prod(axis.size for axis in self.axes)


def plan(database: AeroDatabase) -> tuple[Fold, ...]:
    """For every regressor that acts as a layer: the table into which `consolidate` folds it, or why
    it stays."""
    return _planned(database)[0]


def consolidate(database: AeroDatabase) -> AeroDatabase:
    """`database` with its increments folded into tables where these enter linearly (`plan`), on the
    union of breakpoints.

    Numbers agree with the layered database to rounding. A table over which an increment fades in a
    further variable (the envelope in beta, say) gets that variable as an axis. Increments stay
    listed with estimates, covariance, envelope and flights; what is folded is marked in
    `Increment.folded`, so that standard errors and lineage remain.
    """
    folds, grids = _planned(database)
    tables = dict(database.tables)
    for name, grid in grids.items():
        tables[name] = _folded(tables[name], grid, database.increments)
    goes = {(fold.increment, fold.regressor): fold.table for fold in folds}
    increments = tuple(
        replace(
            increment,
            folded=tuple(goes.get((i, k), table) for k, table in enumerate(increment.folded)),
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
    """Which increments, and so which flights, stand behind the node of a table; empty where it is
    the source's own value.

    database : layered or consolidated; in a layered one, the shares that belong to the node
    although they act beside the table, where the variables that the table lacks lie inside the
    envelope. node : one index per axis of the table.

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
    where = {site.table: site for site in sites(database)}.get(table)
    if where is None:
        return ()
    at = [axis[index : index + 1] for axis, index in zip(grid.breakpoints, node, strict=True)]
    mesh = _Grid(where, list(where.channels), []).mesh(at)
    planned = {(fold.increment, fold.regressor): fold.table for fold in plan(database)}
    found = []
    for i, increment in enumerate(database.increments):
        own = [k for k, name in enumerate(increment.folded) if (name or planned[i, k]) == table]
        share = _share_at(i, increment, own, where, mesh)
        found += [share] if share is not None else []
    return tuple(found)


def point_lineage(database: AeroDatabase, channels: Mapping[str, Value]) -> tuple[NodeShare, ...]:
    """Which increments act at one point (channels: numbers), with value and standard error on their
    axis."""
    found = []
    names = set[str]().union(*(increment.names for increment in database.increments))
    values = database.resolved(sorted(names), channels)
    for i, increment in enumerate(database.increments):
        columns, weights = increment.columns(values)
        if np.any(columns * weights != 0.0):
            result = increment.evaluate(values)
            regressors = tuple(map(str, increment.regressors))
            value, error = float(result.value[0]), float(result.standard_error[0])
            found.append(NodeShare(i, increment.axis, regressors, increment.flights, value, error))
    return tuple(found)


def _share_at(
    i: int, increment: Increment, own: list[int], site: Site, mesh: Mapping[str, Array]
) -> NodeShare | None:
    found = {
        k: part for k in own if (part := _within_table(increment.regressors[k], site)) is not None
    }
    own = list(found)
    jacobian = (
        _restricted(increment, list(found.values()), mesh or {"alpha": np.zeros(1)}, site)
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
    """Where every regressor goes, and the grids that the tables concerned get."""
    open_sites, grids, folds = sites(database), dict[str, _Grid](), []
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
    site: Site,
    part: Expression,
    increment: Increment,
    k: int,
) -> _Grid:
    """The grid of the site's table with one more share on it; NotMultilinearError where it cannot
    carry that exactly."""
    outside = increment.regressors[k].names - part.names
    fenced = sorted(outside & increment.envelope.keys())
    if fenced:
        raise NotMultilinearError(
            f"the envelope over {', '.join(fenced)} acts on a factor outside the table"
        )
    found = knots(part, increment, increment.fading(k))
    table = database.tables[site.table]
    grid = grids.get(site.table) or _Grid(site, list(site.channels), list(table.breakpoints))
    grown = grid.grown(found)
    if grown.size > MAX_NODES or len(grown.axes) > MAX_DIMENSIONS:
        raise NotMultilinearError(f"table {site.table} would have {grown.size} nodes")
    return grown


def _within_table(regressor: Expression, site: Site) -> Expression | None:
    """What is left of `regressor` when the factors of the site's term are taken out; None where it
    is no function of the table's own channels."""
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
    increment: Increment, parts: list[Expression], mesh: Mapping[str, Array], site: Site
) -> Array:
    """What each of `parts` is at the nodes of `mesh`, (m, len(parts)), in the table's unit, fading
    included."""
    k = len(parts)
    alone = Increment(
        increment.axis, tuple(parts), np.zeros(k), np.zeros((k, k)), increment.envelope
    )
    return columns_at(alone, mesh)[0] / site.constant


def _folded(table: Table, grid: _Grid, increments: tuple[Increment, ...]) -> Table:
    """`table` on its grid with all shares added."""
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
    """The table's declared uncertainty with bounds per node taken along to new nodes."""
    if table.uncertainty is None:
        return None

    def moved(bound: Bound) -> Bound:
        if not isinstance(bound, tuple):
            return bound
        values = np.array(bound).reshape(table.values.shape)
        return tuple(replace(table, values=values, uncertainty=None).evaluate(*mesh).tolist())

    return replace(table.uncertainty, bounds=tuple(map(moved, table.uncertainty.bounds)))
