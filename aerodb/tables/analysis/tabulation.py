"""A database as tables over stated ranges, with its largest error between the breakpoints.

Each coefficient becomes a table over the stated variables, and its slope by each rate without
dimension another: ``C = T(x) + T_p(x) p_hat + ...``. Terms that none of these change, such as the
thrust over airspeed and throttle, stay as they are. Other inputs keep one value.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.support import Array
from aerodb.tables.algebra import times
from aerodb.tables.analysis.linear_terms import depends_on
from aerodb.tables.analysis.nodes import air_beside
from aerodb.tables.analysis.sensitivity import uses
from aerodb.tables.analysis.unstated_inputs import unstated_inputs
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.definitions import LIFT_INCREMENTS
from aerodb.tables.expression import Expression, Name, TableCall, check_identifier, number
from aerodb.tables.reference import HAT_RATES, WIND_AXES
from aerodb.tables.table import Table

#: Most nodes of a table: 16 MB of it in a document.
MOST_NODES: Final = 1_000_000
#: Rates without dimension between which slopes are taken, and up to which the error is looked for:
#: the helix angle p b/(2 V) of a full aileron (.07 to .09: Perkins & Hage, Airplane Performance,
#: Stability and Control, 1949, section 9.1); pitch and yaw of a pull-up or a turn of 2 g at twice
#: the chord or span of a light aircraft.
RATE_SIZES: Final = {"p_hat": 0.07, "q_hat": 0.01, "r_hat": 0.03, "alphadot_hat": 0.01}
#: Points between the nodes at which the error is looked for, beside the middles of cells.
_POINTS: Final = 4000
#: Most middles of cells; of more cells, as many at random.
_MIDDLES: Final = 20_000
#: Coefficients below this are rounding.
_ROUNDING: Final = 1e-13


@dataclass(frozen=True)
class TabulationError:
    """How far tables are from what they were made of, on one axis.

    largest, rms : of the coefficient between the nodes. span : between its extremes there. at : the
    inputs of the largest, SI.
    """

    largest: float
    rms: float
    span: float
    at: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Tabulation:
    """Tables of a database.

    over : variable -> nodes (n,) [SI]. held : other inputs that the tables do not follow -> value.
    rates : those by whose slopes the tables are linear. kept : names of terms that stay as they
    are. errors : axis -> error, moments about the moment reference. points : how many were looked
    at.
    """

    database: AeroDatabase
    over: Mapping[str, Array]
    held: Mapping[str, float]
    rates: tuple[str, ...]
    kept: tuple[str, ...]
    errors: Mapping[str, TabulationError]
    points: int


def tabulate(
    database: AeroDatabase, over: Mapping[str, Array], at: Mapping[str, float]
) -> Tabulation:
    """Return a database as tables.

    Parameters
    ----------
    over : input -> nodes (n,), increasing [SI].
    at : values of other inputs [SI]; those not stated are zero, the air is that of the airspeed.

    Raises InputError for a variable that is no input, too many nodes, an airspeed that is needed
    and not stated, and coefficients that are not finite at a node.
    """
    where = f"tables of {database.name}"
    for name in (*over, *at):
        if name not in database.inputs:
            raise InputError(f"'{name}' is not an input", where, nearest(name, database.inputs))
    nodes = math.prod(len(axis) for axis in over.values())
    if nodes > MOST_NODES:
        raise InputError(f"{nodes} nodes", where, f"at most {MOST_NODES}: take fewer per variable")
    kept = _untouched(database, over)
    part = replace(database, terms=tuple(t for t in database.terms if t not in kept), parts={})
    rates = tuple(
        hat
        for hat, (rate, _) in HAT_RATES.items()
        if rate in part.inputs and rate not in over and rate not in at
    )
    maker = _Maker(part, over, _held(part, over, at, rates, where), rates)
    grid = dict(zip(over, np.meshgrid(*over.values(), indexing="ij"), strict=True))
    tables, terms = _tables(maker, {name: x.ravel() for name, x in grid.items()}, where)
    made = _with_tables(database, kept, tables, terms, where)
    errors, points = _errors(maker, made, kept)
    return Tabulation(
        made, over, maker.held, rates, tuple(term.name for term in kept), errors, points
    )


@dataclass(frozen=True, eq=False)
class _Maker:
    """Coefficients of the tabulated part of a database, at points of the variables and rates."""

    part: AeroDatabase
    over: Mapping[str, Array]
    held: Mapping[str, float]
    rates: tuple[str, ...]

    def channels(self, points: Mapping[str, Array], hats: Mapping[str, Any]) -> dict[str, Any]:
        """Inputs (n,) at points of the variables, with rates without dimension."""
        found: dict[str, Any] = {**self.held, **points}
        if "qbar" in self.part.inputs and "qbar" not in found:
            stated: dict[str, Any] = {n: found[n] for n in found if n in ("V", "rho")}
            found["qbar"] = air_beside(stated)["qbar"]
        for hat in self.rates:
            rate, length = HAT_RATES[hat]
            arm = getattr(self.part.reference, length) / 2.0
            found[rate] = hats.get(hat, 0.0) * found["V"] / arm
        return found

    def coefficients(self, points: Mapping[str, Array], **hats: Any) -> dict[str, Array]:
        n = len(next(iter(points.values())))
        found = self.part.predict(self.channels(points, hats)).coefficients
        return {axis: np.broadcast_to(value, (n,)) for axis, value in found.items()}


def _untouched(database: AeroDatabase, over: Mapping[str, Array]) -> tuple[Term, ...]:
    """The terms that neither a variable nor a rate changes."""
    moving = {*over, *(rate for rate, _ in HAT_RATES.values()), LIFT_INCREMENTS}
    return tuple(
        term
        for term in database.terms
        if term.axis not in WIND_AXES
        and moving.isdisjoint(uses(database, term.expression))
        and uses(database, term.expression)
    )


def _held(
    part: AeroDatabase,
    over: Mapping[str, Array],
    at: Mapping[str, float],
    rates: tuple[str, ...],
    where: str,
) -> dict[str, float]:
    """Values of the inputs that the tables do not follow."""
    of_rates = {HAT_RATES[hat][0] for hat in rates}
    stated = {name: value for name, value in at.items() if name in part.inputs}
    if "V" in part.inputs and "V" not in over and "V" not in stated:
        raise InputError(
            "the airspeed is not stated", where, "state it, --at V=50, or tabulate over it"
        )
    values = {**unstated_inputs(part, {**dict.fromkeys(over, 1.0), **stated}), **stated}
    names = set(part.inputs) - set(over) - of_rates
    if {"V", "rho"} & set(over) and "qbar" not in stated:
        names -= {"qbar"}  # it follows from the others
    return {name: float(values[name]) for name in sorted(names) if name in values}


def _tables(
    maker: _Maker, points: Mapping[str, Array], where: str
) -> tuple[dict[str, Table], list[Term]]:
    """The tables of all axes that are not zero, and their terms."""
    arguments = tuple(Name(name) for name in maker.over)
    shape = tuple(len(axis) for axis in maker.over.values())
    tables: dict[str, Table] = {}
    terms: list[Term] = []
    for hat in ("", *maker.rates):
        if not hat:
            values = maker.coefficients(points)
        else:
            size = RATE_SIZES[hat]
            above, below = (maker.coefficients(points, **{hat: x}) for x in (size, -size))
            values = {axis: (above[axis] - below[axis]) / (2.0 * size) for axis in above}
        for axis in values:
            if not np.all(np.isfinite(values[axis])):
                raise InputError(
                    f"{axis} is not finite at a node", where, "choose ranges inside its validity"
                )
            largest = float(np.max(np.abs(values[axis])))
            if largest < _ROUNDING:
                continue
            name = f"TAB_{axis}{f'_{hat}' if hat else ''}"
            call: Expression = TableCall(name, arguments)
            if np.ptp(values[axis]) < _ROUNDING * max(largest, 1.0):
                call = number(float(values[axis][0]))
            else:
                tables[name] = Table(
                    name, tuple(maker.over), tuple(maker.over.values()), values[axis].reshape(shape)
                )
            terms.append(
                Term(
                    f"{axis}{f'_{hat}' if hat else ''}",
                    axis,
                    times(call, Name(hat)) if hat else call,
                )
            )
    return tables, terms


def _with_tables(
    database: AeroDatabase,
    kept: tuple[Term, ...],
    tables: Mapping[str, Table],
    terms: list[Term],
    where: str,
) -> AeroDatabase:
    """The kept terms, with what they use, and the tables."""
    needed = {name for term in kept for name in depends_on(term.expression, database)}
    taken = {*database.variables, *database.tables, *database.scattered, *database.free_inputs}
    for name in tables:
        check_identifier(name)
        if name in taken & needed:
            raise InputError(f"'{name}' is taken", where, "rename it in the database")
    names = {term.name for term in kept}
    return AeroDatabase(
        name=f"{database.name}, tabulated",
        reference=database.reference,
        variables={
            name: replace(variable, part="")
            for name, variable in database.variables.items()
            if name in needed
        },
        tables={**{n: t for n, t in database.tables.items() if n in needed}, **tables},
        scattered={n: t for n, t in database.scattered.items() if n in needed},
        terms=(
            *(replace(term, part="") for term in kept),
            *(replace(t, name=f"TAB_{t.name}") if t.name in names else t for t in terms),
        ),
        free_inputs=database.free_inputs,
        description=database.description,
        source=database.source,
    )


def _between(over: Mapping[str, Array]) -> Iterator[dict[str, Array]]:
    """Middles of the cells, and points anywhere between the nodes."""
    rng = np.random.default_rng(0)
    axes = dict(over)
    middles = [0.5 * (a[1:] + a[:-1]) if len(a) > 1 else a for a in axes.values()]
    if math.prod(map(len, middles)) <= _MIDDLES:
        grid = np.meshgrid(*middles, indexing="ij")
        yield {name: x.ravel() for name, x in zip(axes, grid, strict=True)}
    else:
        yield {n: rng.choice(m, _MIDDLES) for n, m in zip(axes, middles, strict=True)}
    yield {name: rng.uniform(axis[0], axis[-1], _POINTS) for name, axis in axes.items()}


def _errors(
    maker: _Maker, made: AeroDatabase, kept: tuple[Term, ...]
) -> tuple[dict[str, TabulationError], int]:
    """Errors between the nodes, and the number of points."""
    rng = np.random.default_rng(1)
    names = {term.name for term in kept}
    alone = replace(made, terms=tuple(term for term in made.terms if term.name not in names))
    gathered: list[tuple[dict[str, Array], dict[str, Array], dict[str, Array]]] = []
    for points in _between(maker.over):
        n = len(next(iter(points.values())))
        hats = {hat: rng.uniform(-1.0, 1.0, n) * RATE_SIZES[hat] for hat in maker.rates}
        true = maker.coefficients(points, **hats)
        given = alone.predict({**maker.channels(points, hats), **_ones(n)}).coefficients
        gathered.append(
            (
                {**points, **hats},
                {axis: given.get(axis, 0.0) - value for axis, value in true.items()},
                true,
            )
        )
    places = {name: np.concatenate([each[0][name] for each in gathered]) for name in gathered[0][0]}
    found = {}
    for axis in maker.part.axes:
        wrong, right = (np.concatenate([each[k][axis] for each in gathered]) for k in (1, 2))
        worst = int(np.argmax(np.abs(wrong)))
        found[axis] = TabulationError(
            float(abs(wrong[worst])),
            float(np.sqrt(np.mean(wrong**2))),
            float(np.ptp(right)),
            {name: float(values[worst]) for name, values in places.items()},
        )
    return found, sum(len(next(iter(each[0].values()))) for each in gathered)


def _ones(n: int) -> dict[str, Array]:
    """A channel that nothing reads, so that a database without inputs gives (n,) too."""
    return {"time": np.ones(n)}
