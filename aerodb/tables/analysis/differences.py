"""Differences between two databases: per term, and per table node the change, its standard error,
coverage and flights.

Nodes are compared by the coefficients of the whole database there, so that it does not matter
whether an update is a layer beside a table or folded into it. Figures are in `aerodb.report`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from aerodb.nomenclature import AXES, in_order
from aerodb.support import Array, half_interval
from aerodb.tables.analysis.nodes import TableGrid, table_axes, table_grids, vary
from aerodb.tables.analysis.part_changes import changed_parts
from aerodb.tables.analysis.slopes import new_increments
from aerodb.tables.analysis.unstated_inputs import neutral_point
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.parameter import sigma_of
from aerodb.tables.reference import WIND_AXES, ReferenceGeometry, wind_to_body

#: Values of a variable at which the size of a coefficient is looked at.
_ALONG = 21
#: Changes below this fraction of the largest coefficient at the nodes are rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class TermChange:
    """A part, term, variable, reference value or regressor of an increment that differs.

    Parameters
    ----------
    kind : ``part``, ``term``, ``variable``, ``parameter``, ``reference`` or ``increment``.
    before, after : its text; empty where it does not exist.
    change, sigma : coefficient of a regressor and its standard error, or by how much a parameter
        changes and what is known of it afterwards; None for other kinds.
    envelope : of a regressor, variable of its own (of one without, those of every regressor) ->
        flown interval, SI.
    fades : whether it fades beyond the envelope, within two cells; else it is held or continued.
    share : of a regressor, its largest effect within the envelope as a part of the largest
        coefficient that `before` has on the axis where flights have been; None where either is not
        known; of a parameter, its change as a part of its value before.
    unit : of a parameter.
    """

    kind: str
    name: str
    axis: str
    before: str
    after: str
    change: float | None = None
    sigma: float | None = None
    flights: tuple[str, ...] = ()
    envelope: Mapping[str, Interval] = field(default_factory=dict)
    fades: bool = False
    share: float | None = None
    unit: str = ""


@dataclass(frozen=True, eq=False)
class NodeChanges:
    """Change of the coefficient on `axis` at the nodes of a table, all other inputs neutral.

    Parameters
    ----------
    change, sigma, inside : in the shape of the table. sigma is the standard error of the change, 0
        where no increment acts; inside is true where the flights behind the change have been.
    acting : (sources, nodes) whether each source's increment acts at a node.
    sources : the flights of each source.
    """

    axis: str
    grid: TableGrid
    change: Array
    sigma: Array
    inside: NDArray[np.bool_]
    acting: NDArray[np.bool_]
    sources: tuple[tuple[str, ...], ...]

    def flights(self, node: int) -> tuple[str, ...]:
        """Return the flights behind the change at a node, given by its index in the flattened
        table."""
        acting = [
            flights
            for flights, acts in zip(self.sources, self.acting[:, node], strict=True)
            if acts
        ]
        return tuple(sorted(set[str]().union(*acting)))


@dataclass(frozen=True)
class DatabaseDiff:
    """All differences between two databases.

    Parameters
    ----------
    terms : terms, variables, reference values and regressors that differ.
    nodes : one entry per table and axis whose nodes change.
    tables : table name -> what differs, for tables that are new, gone or of another shape.
    not_addressable : table name -> largest difference of its values, for tables whose nodes are not
        points over channels (see `aerodb.tables.analysis.nodes`).
    edited : names of the tables that are not the same in both, as they are stored: increments are
        beside them.
    kept : number of tables that are.
    """

    terms: tuple[TermChange, ...]
    nodes: tuple[NodeChanges, ...]
    tables: Mapping[str, str]
    not_addressable: Mapping[str, float]
    edited: tuple[str, ...] = ()
    kept: int = 0

    @property
    def empty(self) -> bool:
        return not (self.terms or self.nodes or self.tables or self.not_addressable)


def diff(before: AeroDatabase, after: AeroDatabase) -> DatabaseDiff:
    """Differences from `before` to `after`; changes are after - before.

    A table's nodes are those of `after` (of `before` where it is gone). The standard error is that
    of the increments that only one of the databases has, taken as independent; a change of the
    tables themselves has none.
    """
    terms = (
        *_reference(before.reference, after.reference),
        *_expressions(before, after),
        *_regressors(before, after),
    )
    grids = {**table_grids(before), **table_grids(after)}
    axes = {
        name: table_axes(before).get(name, frozenset()) | table_axes(after).get(name, frozenset())
        for name in grids
    }
    gone, added = new_increments(after, before), new_increments(before, after)
    increments = [*gone, *added]
    point = {**neutral_point(before, increments), **neutral_point(after, increments)}
    nodes = [
        entry
        for name, grid in sorted(grids.items())
        for entry in _nodes(grid, axes[name], (before, gone), (after, added), point)
    ]
    forms, edited = _table_forms(before, after), _values_only(before, after)
    return DatabaseDiff(
        terms,
        tuple(nodes),
        forms,
        {name: largest for name, largest in edited.items() if name not in grids},
        tuple(sorted({*forms, *edited})),
        len({*after.tables, *after.scattered} - {*forms, *edited}),
    )


def _nodes(
    grid: TableGrid,
    axes: frozenset[str],
    before: tuple[AeroDatabase, Sequence[Increment]],
    after: tuple[AeroDatabase, Sequence[Increment]],
    point: Mapping[str, float],
) -> list[NodeChanges]:
    """Changes at one table's nodes, on each body axis that changes.

    before, after : a database, and those of its increments that the other lacks.
    """
    channels = vary(point, grid.points())
    old, new = before[0].predict(channels).coefficients, after[0].predict(channels).coefficients
    body = in_order(axes | ({"CX", "CY", "CZ"} if axes & set(WIND_AXES) else set()))
    owned = [
        (increment, database)
        for database, increments in (before, after)
        for increment in increments
    ]
    turn = (
        {"alpha", "beta"}
        if any(increment.axis in WIND_AXES for increment, _ in owned)
        else set[str]()
    )
    changes = []
    nothing = np.zeros(len(new["CX"]))
    for axis in body:
        old_values, new_values = (each.get(axis, nothing) for each in (old, new))
        change = new_values - old_values
        scale = np.nanmax(np.abs([old_values, new_values]), initial=1e-12)
        if not np.any(np.abs(change) > _ROUNDING * scale) and np.array_equal(
            np.isnan(old_values), np.isnan(new_values)
        ):
            continue
        effects = [
            _effect(i, axis, database.resolved(sorted(i.names | turn), channels))
            for i, database in owned
        ]
        acting = np.array([value != 0.0 for value, _, _ in effects]).reshape(
            len(effects), change.size
        )
        variance = sum(
            (error**2 * (value != 0.0) for value, error, _ in effects), np.zeros(change.size)
        )
        inside = np.full(change.size, bool(effects))
        for value, _, where in effects:
            inside &= where | (value == 0.0)
        inside &= acting.any(axis=0)
        sources = tuple(increment.flights for increment, _ in owned)
        sigma, where = np.sqrt(variance).reshape(grid.shape), inside.reshape(grid.shape)
        changes.append(
            NodeChanges(axis, grid, change.reshape(grid.shape), sigma, where, acting, sources)
        )
    return changes


def _effect(
    increment: Increment, axis: str, channels: Mapping[str, Array]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """An increment's contribution on a body axis, its standard error, and where its flights have
    been, each (n,)."""
    own = increment.evaluate(channels)
    if increment.axis not in WIND_AXES:
        share = 1.0 if increment.axis == axis else 0.0
        return own.value * share, own.standard_error * share, own.inside

    def turned(values: Array) -> tuple[Array, Array, Array]:
        drag, side, lift = (
            values if name == increment.axis else 0.0 * values for name in WIND_AXES
        )
        return wind_to_body(drag, side, lift, channels["alpha"], channels["beta"])

    if axis not in AXES[:3]:
        return 0.0 * own.value, 0.0 * own.value, own.inside
    k = AXES.index(axis)
    return turned(own.value)[k], np.abs(turned(own.standard_error)[k]), own.inside


def _reference(before: ReferenceGeometry, after: ReferenceGeometry) -> list[TermChange]:
    names = [field.name for field in fields(ReferenceGeometry)]
    pairs = [(name, str(getattr(before, name)), str(getattr(after, name))) for name in names]
    return [TermChange("reference", name, "", old, new) for name, old, new in pairs if old != new]


def _expressions(before: AeroDatabase, after: AeroDatabase) -> list[TermChange]:
    parts = changed_parts(before, after)
    changes = [TermChange("part", name, "", old, new) for name, (old, new) in parts.items()]
    old_terms, new_terms = (
        {term.name: term for term in database.terms if term.part not in parts}
        for database in (before, after)
    )
    for name in dict.fromkeys([*old_terms, *new_terms]):
        old, new = old_terms.get(name), new_terms.get(name)
        if old is None or new is None or (old.axis, old.expression) != (new.axis, new.expression):
            axes = list(dict.fromkeys(term.axis for term in (old, new) if term is not None))
            texts = [str(term.expression) if term is not None else "" for term in (old, new)]
            changes.append(TermChange("term", name, " to ".join(axes), texts[0], texts[1]))
    for name in dict.fromkeys([*before.variables, *after.variables]):
        if name in before.parameters and name in after.parameters:
            changes += _parameter(name, before, after)
            continue
        sides = [database.variables.get(name) for database in (before, after)]
        if any(side is not None and side.part in parts for side in sides):
            continue
        texts = [str(variable.expression) if variable is not None else "" for variable in sides]
        if texts[0] != texts[1]:
            changes.append(TermChange("variable", name, "", texts[0], texts[1]))
    return changes


def _parameter(name: str, before: AeroDatabase, after: AeroDatabase) -> list[TermChange]:
    """What differs in a parameter of both databases: its value, or what is known of it."""
    sides = [database.variables[name] for database in (before, after)]
    values = [database.parameters[name] for database in (before, after)]
    errors = [sigma_of(variable.uncertainty) for variable in sides]
    if values[0] == values[1] and errors[0] == errors[1]:
        return []
    texts = [
        f"{value:.6g}" + ("" if error is None else f" +- {half_interval(error):.2g}")
        for value, error in zip(values, errors, strict=True)
    ]
    change, known = values[1] - values[0], sides[1].parameter
    return [
        TermChange(
            "parameter",
            name,
            "",
            texts[0],
            texts[1],
            change,
            errors[1],
            known.flights if known else (),
            share=abs(change / values[0]) if values[0] else None,
            unit=sides[1].unit,
        )
    ]


def _regressors(before: AeroDatabase, after: AeroDatabase) -> list[TermChange]:
    """Coefficients of increments that only one of the databases has. Increments of several updates
    on the same regressor are listed separately."""
    changes = []
    sizes = _largest_coefficients(
        before, (*new_increments(after, before), *new_increments(before, after))
    )
    for increments, side in (
        (new_increments(after, before), -1.0),
        (new_increments(before, after), 1.0),
    ):
        for increment in increments:
            errors = np.sqrt(np.diag(increment.covariance))
            effects = _largest_effects(increment)
            for k, (regressor, value, error) in enumerate(
                zip(increment.regressors, increment.estimates, errors, strict=True)
            ):
                text = f"{value:.6g} +- {half_interval(error):.2g}"
                old, new = ("", text) if side > 0 else (text, "")
                change, sigma = side * float(value), float(error)
                changes.append(
                    TermChange(
                        "increment",
                        str(regressor),
                        increment.axis,
                        old,
                        new,
                        change,
                        sigma,
                        increment.flights,
                        {
                            name: increment.envelope[name]
                            for name in sorted(regressor.names or increment.limiting(k))
                            if name in increment.envelope
                        },
                        bool(increment.fading(k)),
                        _part(effects[k], sizes.get(increment.axis)),
                    )
                )
    return changes


def _part(effect: float, size: float | None) -> float | None:
    return effect / size if size and np.isfinite(effect) else None


def _largest_coefficients(
    database: AeroDatabase, increments: Sequence[Increment]
) -> dict[str, float]:
    """Largest coefficient of a database on each axis where flights have been, over one variable at
    a time; that of the body axis beside it on a wind axis."""
    point = neutral_point(database, increments)
    flown: dict[str, list[float]] = {}
    for each in increments:
        for name, interval in each.envelope.items():
            flown.setdefault(name, []).extend((interval.low, interval.high))
    sizes = dict.fromkeys(database.axes, 0.0)
    for name, ends in flown.items():
        over = {name: np.linspace(min(ends), max(ends), _ALONG)}
        found = database.predict(vary(point, over)).coefficients
        for axis in sizes:
            sizes[axis] = max(sizes[axis], float(np.nanmax(np.abs(found[axis]), initial=0.0)))
    return sizes | {"C_drag": sizes["CX"], "C_side": sizes["CY"], "C_lift": sizes["CZ"]}


def _largest_effects(increment: Increment) -> Array:
    """(k,) largest effect of each regressor within the envelope, NaN where one of its variables has
    none."""
    names = sorted(increment.names)
    middle = {
        name: 0.5 * (increment.envelope[name].low + increment.envelope[name].high)
        if name in increment.envelope
        else 0.0
        for name in names
    }
    effects = np.full(len(increment.regressors), np.nan)
    for k, regressor in enumerate(increment.regressors):
        if regressor.names <= increment.envelope.keys():
            ends = {
                name: np.linspace(increment.envelope[name].low, increment.envelope[name].high, 5)
                for name in regressor.names
            }
            mesh = np.meshgrid(*ends.values(), indexing="ij") if ends else []
            over = {name: grid.ravel() for name, grid in zip(ends, mesh, strict=True)}
            values, _ = increment.columns(vary(middle, over))
            effects[k] = float(np.max(np.abs(values[:, k] * increment.estimates[k])))
    return effects


def _table_forms(before: AeroDatabase, after: AeroDatabase) -> dict[str, str]:
    changes = {}
    for name in sorted({*before.tables, *after.tables}):
        old, new = before.tables.get(name), after.tables.get(name)
        if old is None or new is None:
            changes[name] = "new" if old is None else "gone"
        elif old.values.shape != new.values.shape:
            changes[name] = f"{list(old.values.shape)} nodes before, {list(new.values.shape)} after"
        elif any(
            not np.array_equal(a, b) for a, b in zip(old.breakpoints, new.breakpoints, strict=True)
        ):
            changes[name] = "breakpoints moved"
    for name in sorted({*before.scattered, *after.scattered}):
        one, other = before.scattered.get(name), after.scattered.get(name)
        if one is None or other is None:
            changes[name] = "new" if one is None else "gone"
        elif not np.array_equal(one.points, other.points):
            changes[name] = f"{len(one.points)} scattered points before, {len(other.points)} after"
    return changes


def _values_only(before: AeroDatabase, after: AeroDatabase) -> dict[str, float]:
    """Table name -> largest difference of its values, where they differ alone."""
    largest = {}
    for name in sorted(before.tables.keys() & after.tables.keys()):
        old, new = before.tables[name].values, after.tables[name].values
        if old.shape == new.shape and not np.array_equal(old, new):
            largest[name] = float(np.max(np.abs(new - old)))
    for name in sorted(before.scattered.keys() & after.scattered.keys()):
        old, new = before.scattered[name].values, after.scattered[name].values
        if old.shape == new.shape and not np.array_equal(old, new):
            largest[name] = float(np.max(np.abs(new - old)))
    return largest
